# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plan that is held for ticks without a new one, and which new ones replace it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import Protocol

import numpy as np

from manifold_mpc_ros.control.modes import LONGEST_HOLD_TICKS, Facts, SolveOutcome
from manifold_mpc_ros.control.solver_thread import SolveResult
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus

#: A value within this of the bound, relative, is no worse: the rounding of the solver.
VALUE_ROUNDING = 1e-6


class Offer(Enum):
    """What became of a solution that was offered to the held plan."""

    STORED = 'stored'
    WORSE = 'worse than the stored plan'
    INVALID = 'no plan from this state'


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
    """A plan, the time that its first torque was meant for, and the attitude that it goes to."""

    plan: Torques
    time_ns: int
    R_ND: Array


class HeldPlan:
    """The latest usable plan, by the time that it was made for.

    It may be followed for min(N // 2, 5) steps of ``step_ns``, N the number of its torques.
    """

    def __init__(self, step_ns: int) -> None:
        """Hold nothing yet."""
        self._step_ns = step_ns
        self.drop()

    def drop(self) -> None:
        """Forget the plan."""
        self._kept: _Kept | None = None

    def unbind(self) -> None:
        """Let the stored plan, which is still followed, bound no value: its goal is another."""
        if self._kept is not None:
            self._kept = replace(self._kept, R_ND=np.full((3, 3), np.nan))

    def keep(self, plan: Torques, time_ns: int, R_ND: Array) -> None:
        """Store a plan whose first torque is meant for ``time_ns`` [ns]."""
        self._kept = _Kept(plan, time_ns, R_ND)

    def torque(self, now_ns: int) -> Array | None:
        """Return the plan's torque for this time (3,) [N m], None when it does not reach."""
        steps = self._steps_to(now_ns)
        if self._kept is None or steps is None:
            return None
        return np.array(self._kept.plan.torques_B_n_m[steps])

    def offer(self, solution: AttitudeMpcSolution, time_ns: int, R_ND: Array) -> Offer:
        """Store a solution made for ``time_ns`` and R_ND, unless it is invalid or worse.

        A converged plan replaces the stored one, and so does the relaxed one outside the domain
        of attraction, which is the best that there is. A plan whose budget ran out does not
        when its value is above the bound V - L that the stored plan, of the same setpoint and
        still in its life, puts on it.
        """
        if not is_valid(solution):
            return Offer.INVALID
        if solution.status is SolveStatus.FEASIBLE and self._bounds(solution, time_ns, R_ND):
            return Offer.WORSE
        self.keep(solution, time_ns, R_ND)
        return Offer.STORED

    def _bounds(self, solution: AttitudeMpcSolution, time_ns: int, R_ND: Array) -> bool:
        """Return whether the stored plan is a rival of a solution, and bounds its value."""
        kept = self._kept
        if kept is None or self._steps_to(time_ns) is None or not np.array_equal(kept.R_ND, R_ND):
            return False
        bound = kept.plan.promised_cost
        return solution.cost > bound + VALUE_ROUNDING * abs(bound)

    def _steps_to(self, now_ns: int) -> int | None:
        """Return how many steps into its life the plan is, None when it has none or is past it."""
        if self._kept is None:
            return None
        steps = round((now_ns - self._kept.time_ns) / self._step_ns)
        horizon = len(self._kept.plan.torques_B_n_m)
        return steps if 0 <= steps <= min(horizon // 2, LONGEST_HOLD_TICKS) else None


def is_valid(solution: AttitudeMpcSolution) -> bool:
    """Return whether every torque of a plan may be used."""
    return (solution.status is not SolveStatus.FAILED
            and bool(np.isfinite(solution.torque_B_n_m).all())
            and bool(np.isfinite(solution.torques_B_n_m).all()))


def facts_of(age_ns: int, result: SolveResult | None, offer: Offer) -> Facts:
    """Return what a request to the solver came to; no result when the solver is late."""
    if result is None or result.solution is None:
        detail = 'the solver is late' if result is None else f'the solver failed: {result.error}'
        return Facts(age_ns, SolveOutcome.NONE, detail=detail)
    status = f'solver: {SolveStatus(result.solution.status).value}'
    if offer is Offer.STORED:
        return Facts(age_ns, SolveOutcome.USABLE, detail=status)
    return Facts(age_ns, SolveOutcome.NONE, detail=f'{status}, {offer.value}')
