# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is found of the laws' discontinuity, and the laws that are studied."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig

if TYPE_CHECKING:
    from manifold_mpc_ros.lab.discontinuity.study import AntipodeStudy, AxisStudy, JumpMap

LAWS = {
    'paper': 'paper: J = I, no limits',
    'unlimited': 'configured body, no limits',
    'configured': 'configured body and limits',
}
WHY = """\
Why no continuous law can do without the jump: a continuous closed loop that takes every state to
one equilibrium, by steps that can be deformed to standing still, would shrink M to a point within
M. SO(3) and S^2, with their rates or without, do not shrink. By indices (Lefschetz, Hopf): one
attractor counts 1, but over a compact M the count is the Euler characteristic, 0 for SO(3) and 2
for S^2."""


def paper_config() -> AttitudeMpcConfig:
    """Return the paper's controller, with J = I and h = 0.5 s chosen by us."""
    inertia = np.eye(3)
    return AttitudeMpcConfig(
        inertia_kg_m2=inertia, step_s=0.5, horizon=10, attitude_weight=np.eye(3),
        rate_weight=np.trace(inertia) / 2.0 * np.eye(3) - inertia,
        torque_weight=2.0 * np.eye(3), terminal_scale=0.1, forcing='paper')


@dataclass
class Findings:
    """Everything that is found of one law; None where it was not asked for."""

    name: str
    axis: AxisStudy | None = None
    map: JumpMap | None = None
    antipode: AntipodeStudy | None = None

    @property
    def label(self) -> str:
        """What pictures and tables call the law."""
        return LAWS[self.name]
