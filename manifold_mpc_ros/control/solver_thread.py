# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Requests to the solver: answered at once, or by a thread within a budget of wall clock.

A solve that does not come within its budget delays no tick. Its result is handed over once, by
`late_result`, when it has come. The solver has to let other threads run while it works.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.reference import Reference
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus


@dataclass(frozen=True, eq=False)
class SolveRequest:
    """A state to plan from: R_NB, omega_BN_B [rad/s] at ``time_ns`` [ns], to reach R_ND.

    ``cold`` asks to forget the warm start. ``epoch`` tells requests apart that were made before
    everything was forgotten. ``disturbance_B_n_m`` (3,) is the torque that acts unasked [N m],
    None where nobody looks for one. ``directions_N`` stand in for those of cones, by name.
    ``wheel_momentum_n_m_s`` (n,) is what reaction wheels report, None without wheels.
    ``reference`` is how a target that moves does so, None for one that is fixed.
    """

    time_ns: int
    R_NB: Array
    omega_BN_B: Array
    R_ND: Array
    cold: bool
    epoch: int = 0
    disturbance_B_n_m: Array | None = None
    directions_N: Mapping[str, Array] = field(default_factory=dict)
    wheel_momentum_n_m_s: Array | None = None
    reference: Reference | None = None


@dataclass(frozen=True, eq=False)
class SolveResult:
    """What became of a request: a solution, or the error that the solver raised."""

    request: SolveRequest
    solution: AttitudeMpcSolution | None
    error: str = ''


Solve = Callable[[SolveRequest], AttitudeMpcSolution]


class SolverRunner(Protocol):
    """What the control loop needs of a solver."""

    def solve(self, request: SolveRequest) -> SolveResult | None:
        """Return the result, None when it does not come in time."""

    def late_result(self) -> SolveResult | None:
        """Return a result that came after its time, once."""

    def close(self) -> None:
        """Solve no more."""


class Solver(Protocol):
    """What is needed of `AttitudeMpc`."""

    def solve(
        self, R_NB: Array, omega_BN_B: Array, R_ND: Array | None = None, *,
        disturbance_B_n_m: Array | None = None, max_solve_time_s: float | None = None,
    ) -> AttitudeMpcSolution:
        """Return the optimal torques from a measured state to the commanded attitude."""

    def reset(self) -> None:
        """Forget the warm start."""


def solve_with(solver: Solver, max_solve_time_s: float | None = None) -> Solve:
    """Return the function that answers requests with a solver, in its own time or in this [s].

    Where a target runs away from every plan, faster than the limits, the plan goes to where it is;
    it keeps the margins to rate limits of plans about targets that move.
    """
    def solve(request: SolveRequest) -> AttitudeMpcSolution:
        if request.cold:
            solver.reset()
        more: dict[str, Any] = (
            {'directions_N': request.directions_N} if request.directions_N else {})
        if request.wheel_momentum_n_m_s is not None:
            more['wheel_momentum_n_m_s'] = request.wheel_momentum_n_m_s

        def answer(**how: Any) -> AttitudeMpcSolution:
            return solver.solve(request.R_NB, request.omega_BN_B, request.R_ND,
                                disturbance_B_n_m=request.disturbance_B_n_m,
                                max_solve_time_s=max_solve_time_s, **how)

        if request.reference is None:
            return answer(**more)
        solution = answer(**more, reference=request.reference)
        if solution.status is not SolveStatus.FAILED or not solution.limits_used > 1.0:
            return solution
        still = Reference.fixed(request.R_ND, len(request.reference.R_ND) - 1)
        return answer(**more, reference=still)._replace(
            status=SolveStatus.INFEASIBLE, limits_used=solution.limits_used)

    return solve


class DirectSolver:
    """Solves in the caller's thread, whatever time it takes: for lockstep."""

    def __init__(self, solve: Solve) -> None:
        """Wait for the first request."""
        self._solve = solve

    def solve(self, request: SolveRequest) -> SolveResult:
        """Return the result."""
        return _result_of(self._solve, request)

    def late_result(self) -> None:
        """Return nothing: no result is late."""

    def close(self) -> None:
        """Do nothing: there is no thread."""


class SolverThread:
    """Solves in a thread: results come within a budget, or later.

    Arguments
    ---------
    solve
        Called in the thread, one request at a time.
    budget_s
        Wall clock that a call of `solve` waits [s].
    prepare
        Called once in the thread before anything else.

    """

    def __init__(
        self, solve: Solve, budget_s: float, prepare: Callable[[], None] = lambda: None,
    ) -> None:
        """Start the thread, a daemon: the process ends without joining it."""
        self._budget_s = budget_s
        self._requests: queue.SimpleQueue[SolveRequest | None] = queue.SimpleQueue()
        self._results: queue.SimpleQueue[SolveResult] = queue.SimpleQueue()
        self._busy = False
        threading.Thread(
            target=self._work, args=(solve, prepare), name='solver', daemon=True).start()

    def solve(self, request: SolveRequest) -> SolveResult | None:
        """Return the result if it comes within the budget; at once None while an old one is due.

        Call `late_result` first: its result would be taken for that of this request.
        """
        if self._busy:
            return None
        self._busy = True
        self._requests.put(request)
        try:
            result = self._results.get(timeout=self._budget_s)
        except queue.Empty:
            return None
        self._busy = False
        return result

    def late_result(self) -> SolveResult | None:
        """Return the result that the last `solve` did not wait for, if it has come."""
        if not self._busy:
            return None
        try:
            result = self._results.get_nowait()
        except queue.Empty:
            return None
        self._busy = False
        return result

    def close(self) -> None:
        """Let the thread end when it has solved what was requested."""
        self._requests.put(None)

    def _work(self, solve: Solve, prepare: Callable[[], None]) -> None:
        """Solve requests until there are no more."""
        prepare()
        while (request := self._requests.get()) is not None:
            self._results.put(_result_of(solve, request))


def _result_of(solve: Solve, request: SolveRequest) -> SolveResult:
    """Return the result of a request; whatever the solver raises is one too."""
    try:
        return SolveResult(request, solve(request))
    except Exception as error:  # noqa: BLE001  (said on /diagnostics by the one who asked)
        return SolveResult(request, None, f'{type(error).__name__}: {error}')
