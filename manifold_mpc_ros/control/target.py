# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is commanded, as a function of time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.program.options import SETPOINT_MOVED_RAD
from manifold_mpc_ros.mpc.reference import Reference


class Target(Protocol):
    """A commanded attitude at every time; `FixedTarget` and moving/trajectory.py are such."""

    moves: bool

    def at(self, time_ns: int) -> tuple[Array, Array]:
        """Return R_ND (3, 3) and omega_DN_D (3,) [rad/s] at a time [ns]."""

    def over_horizon(self, time_ns: int, step_s: float, steps: int) -> Reference | None:
        """Return how it moves in so many steps from a time [ns]; None: it is fixed."""

    def warning(self, time_ns: int) -> str:
        """Say what is wrong with it at a time [ns], empty when nothing is."""


@dataclass(frozen=True, eq=False)
class FixedTarget:
    """The attitude R_ND (3, 3)."""

    R_ND: Array
    moves = False

    def at(self, _time_ns: int) -> tuple[Array, Array]:
        """Return it, at rest."""
        return self.R_ND, np.zeros(3)

    def over_horizon(self, _time_ns: int, _step_s: float, _steps: int) -> None:
        """Return that it does not move."""

    def warning(self, _time_ns: int) -> str:
        """Return that nothing is wrong."""
        return ''


def goes_on(before: Target, after: Target, time_ns: int, step_s: float) -> bool:
    """Return whether a target is at a time [ns] where the one before it was, rate included."""
    (R_1, omega_1), (R_2, omega_2) = before.at(time_ns), after.at(time_ns)
    if not before.moves and not after.moves:
        return np.array_equal(R_1, R_2)
    change = float(so3.angle(R_1.T @ R_2)) + step_s * float(np.linalg.norm(omega_2 - omega_1))
    return change <= SETPOINT_MOVED_RAD
