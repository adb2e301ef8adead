# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The solver behind a question and an answer: at once, or in a thread that may be late.

The thread exists so that a solver that hangs, or takes longer than its budget, delays no tick. It
needs a solver that lets other threads run while it works.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from manifold_mpc_ros.config.checks import FloatArray
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution


@dataclass(frozen=True, eq=False)
class Question:
    """A state to plan from: the time it is for [ns], and whether to forget the warm start.

    ``epoch`` tells answers apart that were asked for before everything was forgotten.
    """

    time_ns: int
    R_NB: FloatArray
    omega_BN_B: FloatArray
    R_ND: FloatArray
    cold: bool
    epoch: int = 0


@dataclass(frozen=True, eq=False)
class Answer:
    """What became of a question: a solution, or the error that the solver raised."""

    question: Question
    solution: AttitudeMpcSolution | None
    error: str = ''


Solve = Callable[[Question], AttitudeMpcSolution]


class Planner(Protocol):
    """What the control loop needs of a solver."""

    def ask(self, question: Question) -> Answer | None:
        """Return the answer, None when it does not come in time."""

    def late(self) -> Answer | None:
        """Return an answer that came after its time, once."""

    def close(self) -> None:
        """Ask no more."""


class Solver(Protocol):
    """What is needed of `AttitudeMpc`."""

    def solve(
        self, R_NB: FloatArray, omega_BN_B: FloatArray, R_ND: FloatArray | None = None, *,
        max_solve_time_s: float | None = None,
    ) -> AttitudeMpcSolution:
        """Return the optimal torques from a measured state to the commanded attitude."""

    def reset(self) -> None:
        """Forget the warm start."""


def solve_with(solver: Solver, max_solve_time_s: float | None = None) -> Solve:
    """Return the function that answers questions with a solver, in its own time or in this."""
    def solve(question: Question) -> AttitudeMpcSolution:
        if question.cold:
            solver.reset()
        return solver.solve(question.R_NB, question.omega_BN_B, question.R_ND,
                            max_solve_time_s=max_solve_time_s)

    return solve


class DirectPlanner:
    """Answers in the caller's thread, whatever it takes: for lockstep."""

    def __init__(self, solve: Solve) -> None:
        """Wait for the first question."""
        self._solve = solve

    def ask(self, question: Question) -> Answer:
        """Return the answer."""
        return _answered(self._solve, question)

    def late(self) -> None:
        """Return nothing: no answer is late."""

    def close(self) -> None:
        """Do nothing: there is no thread."""


class ThreadPlanner:
    """Answers within a budget, or later.

    Arguments
    ---------
    solve
        Called in the thread, one question at a time.
    budget_s
        Wall clock that `ask` waits [s].
    prepare
        Called once in the thread before anything else.

    """

    def __init__(
        self, solve: Solve, budget_s: float, prepare: Callable[[], None] = lambda: None,
    ) -> None:
        """Start the thread, which does not keep the process from ending."""
        self._budget_s = budget_s
        self._questions: queue.SimpleQueue[Question | None] = queue.SimpleQueue()
        self._answers: queue.SimpleQueue[Answer] = queue.SimpleQueue()
        self._busy = False
        self.late_answers = 0
        threading.Thread(
            target=self._work, args=(solve, prepare), name='solver', daemon=True).start()

    def ask(self, question: Question) -> Answer | None:
        """Return the answer if it comes within the budget; at once None while an old one is due.

        Call `late` first: its answer would be taken for that of this question.
        """
        if self._busy:
            return None
        self._busy = True
        self._questions.put(question)
        try:
            answer = self._answers.get(timeout=self._budget_s)
        except queue.Empty:
            self.late_answers += 1
            return None
        self._busy = False
        return answer

    def late(self) -> Answer | None:
        """Return the answer that the last `ask` did not wait for, if it has come."""
        if not self._busy:
            return None
        try:
            answer = self._answers.get_nowait()
        except queue.Empty:
            return None
        self._busy = False
        return answer

    def close(self) -> None:
        """Let the thread end when it has answered."""
        self._questions.put(None)

    def _work(self, solve: Solve, prepare: Callable[[], None]) -> None:
        """Answer questions until there are no more."""
        prepare()
        while (question := self._questions.get()) is not None:
            self._answers.put(_answered(solve, question))


def _answered(solve: Solve, question: Question) -> Answer:
    """Return the answer to a question; whatever the solver raises is one too."""
    try:
        return Answer(question, solve(question))
    except Exception as error:  # noqa: BLE001  (said on /diagnostics by the one who asked)
        return Answer(question, None, f'{type(error).__name__}: {error}')
