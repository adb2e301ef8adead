# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How far cones cut the terminal set: no attitude of it may violate one.

In ``xi^T P xi <= c`` the error angle is at most ``sqrt(c lambda_max((P^-1)_gg))``, and a body axis
moves by no more than that; so c is at most the square of the least margin of the target over that
eigenvalue (docs/theory.md, section 13).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from manifold_mpc_ros.config.cones import Cone, alone, joined
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.design import TerminalDesign
from manifold_mpc_ros.terminal.level import SAFETY

# A set cut to less than this part of its level counts as none.
LEAST_PART = 1e-4


def counts_for_target(config: AttitudeMpcConfig, cones: Sequence[Cone]) -> list[bool]:
    """Return which cones a target keeps or not: for pointing those of its own axis."""
    return [config.target == 'attitude'
            or abs(float(config.pointing_axis_B @ each.axis_B)) > 1.0 - 1e-12 for each in cones]


def target_margins_rad(config: AttitudeMpcConfig, kept: Sequence[Cone], R_ND: Any = None,
                       directions_N: Any = None) -> dict[str, float]:
    """Return by which angle a target keeps each cone or group [rad], over directions (k, n, 3).

    A group by a member that makes its mean 1 or more by itself, as nodes keep the mean.
    A pointing target leaves the roll free: cones of other axes than its own do not count (inf).
    """
    R, kept = np.eye(3) if R_ND is None else np.asarray(R_ND), alone(kept)
    s = np.array([[each.direction_N for each in kept]]) if directions_N is None else directions_N
    counts = counts_for_target(config, kept)
    margins = np.array([each.margins_rad(R, s[:, i]) if counts[i] else np.full(len(s), np.inf)
                        for i, each in enumerate(kept)])
    return {name: float(np.min(each)) for name, each in joined(kept, margins).items()}


def spread(config: AttitudeMpcConfig, P: Array) -> float:
    """Return lambda_max((P^-1)_gg): the squared error angle over c [rad^2]."""
    errors = 3 if config.target == 'attitude' else 2
    return float(np.linalg.eigvalsh(np.linalg.inv(P)[:errors, :errors])[-1])


def cut_level(level: float, margins: Mapping[str, float], spread: float) -> float:
    """Return the largest level up to one at which every margin is kept; 0 where none is left."""
    least = min(margins.values(), default=np.inf)
    cut = min(level, SAFETY * max(least, 0.0) ** 2 / spread)
    return cut if cut >= LEAST_PART * level else 0.0


def cut_design(config: AttitudeMpcConfig, design: TerminalDesign) -> TerminalDesign:
    """Map a design without cones to the one for the identity as the target.

    Raises DesignError where the target violates a cone, or is so near to one that no set is left,
    with the angle that is missing.
    """
    kept = config.kept_cones
    margins, wide = target_margins_rad(config, kept), spread(config, design.P)
    level = cut_level(design.c, margins, wide)
    if level == 0.0:
        worst = min(margins, key=lambda name: margins[name])
        missing = (LEAST_PART * design.c * wide / SAFETY) ** 0.5 - margins[worst]
        raise DesignError(
            f'the target is in, or too near to, what the cone {worst!r} forbids: '
            f'{np.degrees(missing):.3g} degrees are missing')
    limits = design.report.limits | {
        f'cone {name}': margin ** 2 / wide for name, margin in margins.items()}
    limiting = min(limits, key=lambda name: limits[name])
    return replace(design, c=level, report=replace(
        design.report, level=level, limits=limits, limiting=limiting))
