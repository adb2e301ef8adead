# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the compiled solver says of a state, of a solve under way and of a plan."""

from __future__ import annotations

from typing import NamedTuple

from manifold_mpc_ros.mpc.program import options


class Progress(NamedTuple):
    """How far a solve is; the cost contains the penalties on violations."""

    cost: float
    residual: float
    flag: int
    passes: int

    @property
    def converged(self) -> bool:
        """Whether it ended where the optimality conditions hold."""
        return self.flag == options.CONVERGED or (
            self.flag == options.STALLED and self.residual < options.ACCEPTABLE_RESIDUAL)


class Report(NamedTuple):
    """Of a plan, dimensionless.

    Cost of its first stage; ``xi^T P xi / c`` of its first and last node; what violations add to
    its cost; the largest relative violation of a node's limits; by how much it misses the terminal
    set, relatively.
    """

    first_cost: float
    first_level: float
    last_level: float
    penalties: float
    violation: float
    terminal_violation: float


class StateReport(NamedTuple):
    """Of a state: whether it can be used, and how hard the turn is.

    Distance of its rotations from SO(3); |J omega|^2; angle left to turn [rad]; angle that it
    takes to stop the body [rad]; for a slew about the axis of the turn, how much the second torque
    component does beside the first (0 to 1), and how many times faster the quickest axis turns; by
    how much the commanded attitude moved otherwise than foreseen [rad].
    """

    defect: float
    momentum_squared: float
    angle_rad: float
    braking_rad: float
    second_torque: float
    weakness: float
    moved_rad: float
