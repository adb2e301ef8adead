# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Questions to a solver in a thread, and laws that are built in the background; no ROS needed."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np
import pytest
from scripted import CONFIG, OMEGA, R_NB, SAMPLE, STEP_NS, TIMEOUT_S, Script, gate

from manifold_mpc_ros.control.command import Law
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.input_gate import StateSample
from manifold_mpc_ros.control.modes import Mode
from manifold_mpc_ros.control.solver_thread import (
    SolveRequest,
    SolveResult,
    SolverThread,
    solve_with,
)
from manifold_mpc_ros.control.tick_time import ClockTime
from manifold_mpc_ros.errors import DesignError, ManifoldMpcError
from manifold_mpc_ros.nodes.controller.background_build import Rebuild

PATIENCE_S = 30.0
BUDGET_S = 0.02
REQUEST = SolveRequest(7, R_NB, OMEGA, np.eye(3), cold=True)


def until(result: Callable[[], object]) -> object:
    """Ask again and again until something comes."""
    end_s = time.monotonic() + PATIENCE_S
    while (found := result()) is None:
        assert time.monotonic() < end_s
        time.sleep(0.001)
    return found


class HeldSolver:
    """A solver that answers when it may."""

    def __init__(self) -> None:
        self.script, self.open = Script(20), threading.Event()

    def __call__(self, request: SolveRequest) -> object:
        self.open.wait(PATIENCE_S)
        return solve_with(self.script, 0.25)(request)


def test_an_answer_in_time_and_the_budget_is_passed_on() -> None:
    held, prepared = HeldSolver(), threading.Event()
    held.open.set()
    solver = SolverThread(held, PATIENCE_S, prepared.set)
    result = solver.solve(REQUEST)
    assert isinstance(result, SolveResult)
    assert result.request is REQUEST
    assert result.solution is not None
    assert (held.script.budget_s, held.script.resets, prepared.is_set()) == (0.25, 1, True)
    assert solver.late_result() is None
    solver.close()


def test_a_late_answer_delays_nobody_and_comes_once() -> None:
    held = HeldSolver()
    solver = SolverThread(held, BUDGET_S)
    begun_s = time.monotonic()
    assert solver.solve(REQUEST) is None
    assert time.monotonic() - begun_s >= BUDGET_S
    for _ in range(100):  # at once, while the old one is due
        assert solver.solve(REQUEST) is None
    assert solver.late_result() is None
    held.open.set()
    result = until(solver.late_result)
    assert isinstance(result, SolveResult)
    assert result.solution is not None
    assert solver.late_result() is None
    assert until(lambda: solver.solve(REQUEST)) is not None
    solver.close()


def test_an_error_of_the_solver_is_an_answer() -> None:
    def broken(_question: SolveRequest) -> object:
        raise ZeroDivisionError('no such torque')

    solver = SolverThread(broken, PATIENCE_S)
    for _ in range(3):  # and the thread goes on
        result = solver.solve(REQUEST)
        assert isinstance(result, SolveResult)
        assert (result.solution, result.error) == (None, 'ZeroDivisionError: no such torque')
    solver.close()


def test_a_loop_with_a_late_solver_holds_falls_back_and_takes_the_late_plan() -> None:
    held = HeldSolver()
    held.open.set()
    solver = SolverThread(held, PATIENCE_S)
    loop = ControlLoop(Law(CONFIG, solver, TIMEOUT_S), gate(), initial_setpoint='identity')

    def tick(number: int) -> Mode:
        now_ns = SAMPLE.stamp_ns + number * STEP_NS
        loop.admit(StateSample(now_ns, R_NB, OMEGA))
        return loop.tick(ClockTime(now_ns)).mode

    assert tick(0) is Mode.NOMINAL
    held.open.clear()
    solver._budget_s = BUDGET_S
    assert [tick(number) for number in range(1, 8)] == [*[Mode.HOLD] * 5, *[Mode.FALLBACK] * 2]
    held.open.set()
    until(lambda: None if solver._results.empty() else True)
    solver._budget_s = PATIENCE_S
    held.open.set()
    assert tick(8) is Mode.NOMINAL
    loop.reset()
    loop.close()


def test_an_answer_from_before_a_reset_is_forgotten() -> None:
    held = HeldSolver()
    solver = SolverThread(held, BUDGET_S)
    loop = ControlLoop(Law(CONFIG, solver, TIMEOUT_S), gate(), initial_setpoint='identity')
    loop.admit(SAMPLE)
    assert loop.tick(ClockTime(SAMPLE.stamp_ns)).mode is Mode.FALLBACK
    loop.reset()
    held.open.set()
    until(lambda: None if solver._results.empty() else True)
    held.open.clear()
    loop.admit(SAMPLE)
    assert loop.tick(ClockTime(SAMPLE.stamp_ns)).mode is Mode.FALLBACK  # and not its plan
    held.open.set()
    loop.close()


def test_what_is_built_comes_once_and_the_newest_of_those_that_wait() -> None:
    rebuild: Rebuild[int] = Rebuild()
    free = threading.Event()

    def slow(number: int) -> Callable[[], int]:
        def build() -> int:
            free.wait(PATIENCE_S)
            return number
        return build

    assert rebuild.poll() is None
    for number in (1, 2, 3):
        rebuild.request(slow(number))
        assert rebuild.building
        assert rebuild.poll() is None
    free.set()
    assert until(rebuild.poll) == 3
    assert not rebuild.building
    assert rebuild.poll() is None


@pytest.mark.parametrize(('error', 'said'), [
    (DesignError('no such set'), 'no such set'),
    (ZeroDivisionError('by zero'), 'ZeroDivisionError: by zero')])
def test_what_cannot_be_built_is_an_error_and_can_be_tried_again(
    error: Exception, said: str,
) -> None:
    def fails() -> int:
        raise error

    rebuild: Rebuild[int] = Rebuild()
    rebuild.request(fails)
    result = until(rebuild.poll)
    assert isinstance(result, ManifoldMpcError)
    assert str(result) == said
    rebuild.request(lambda: 5)
    assert until(rebuild.poll) == 5


def test_what_was_left_aside_does_not_come_back() -> None:
    rebuild: Rebuild[int] = Rebuild()
    free = threading.Event()
    rebuild.request(lambda: int(free.wait(PATIENCE_S)))
    rebuild.forget()
    free.set()
    rebuild.request(lambda: 5)
    assert until(rebuild.poll) == 5
