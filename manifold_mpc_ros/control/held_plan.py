# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plan that is kept for ticks without a new one, and which new ones are better."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from manifold_mpc_ros.control.modes import LONGEST_HOLD_TICKS
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus

Array = NDArray[np.float64]

#: A value within this of the bound, relative, is no worse: the rounding of the solver.
VALUE_ROUNDING = 1e-6


class Torques(Protocol):
    """What is kept of a plan."""

    @property
    def torques_B_n_m(self) -> Array:
        """The body torques (N, 3), one a step [N m]."""

    @property
    def promised_cost(self) -> float:
        """The bound on the value one step later, V - L."""


@dataclass(frozen=True)
class _Kept:
    """A plan, the time that its first torque was meant for, and where it goes."""

    plan: Torques
    time_ns: int
    R_ND: Array


class HeldPlan:
    """The latest usable plan, by the time that it was made for.

    It may be followed for min(N // 2, 5) steps of ``step_ns``, N the number of its torques.
    """

    def __init__(self, step_ns: int) -> None:
        """Keep nothing yet."""
        self._step_ns = step_ns
        self.drop()

    def drop(self) -> None:
        """Forget the plan."""
        self._kept: _Kept | None = None

    def keep(self, plan: Torques, time_ns: int, R_ND: Array) -> None:
        """Store a plan whose first torque is meant for ``time_ns``."""
        self._kept = _Kept(plan, time_ns, R_ND)

    def torque(self, now_ns: int) -> Array | None:
        """Return the plan's torque for this time (3,) [N m], None when it does not reach."""
        if self._kept is None:
            return None
        torques = self._kept.plan.torques_B_n_m
        steps = round((now_ns - self._kept.time_ns) / self._step_ns)
        if not 0 <= steps <= min(len(torques) // 2, LONGEST_HOLD_TICKS):
            return None
        return np.array(torques[steps])

    def accepts(self, solution: AttitudeMpcSolution, now_ns: int, R_ND: Array) -> bool:
        """Return whether a valid plan made for ``now_ns`` is better than the stored one, shifted.

        A converged one is, and the relaxed one outside the domain of attraction, which is the best
        that there is. One whose budget ran out is unless its value is above the bound that the
        stored plan, of the same setpoint and still in its life, puts on it.
        """
        if not is_valid(solution):
            return False
        kept = self._kept
        if (solution.status is not SolveStatus.FEASIBLE or kept is None
                or self.torque(now_ns) is None or not np.array_equal(kept.R_ND, R_ND)):
            return True
        bound = kept.plan.promised_cost
        return not solution.cost > bound + VALUE_ROUNDING * abs(bound)


def is_valid(solution: AttitudeMpcSolution) -> bool:
    """Return whether every torque of a plan may be used."""
    return (solution.status is not SolveStatus.FAILED
            and bool(np.isfinite(solution.torque_B_n_m).all())
            and bool(np.isfinite(solution.torques_B_n_m).all()))
