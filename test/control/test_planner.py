# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Questions to a solver in a thread, and laws that are built in the background; no ROS needed."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np
import pytest
from scripted import CONFIG, OMEGA, R_NB, SAMPLE, STEP_NS, TIMEOUT_S, Script

from manifold_mpc_ros.control.control_loop import ControlLoop, Law
from manifold_mpc_ros.control.input_gate import StateSample
from manifold_mpc_ros.control.modes import Mode
from manifold_mpc_ros.control.solver_thread import Answer, Question, ThreadPlanner, solve_with
from manifold_mpc_ros.errors import DesignError, ManifoldMpcError
from manifold_mpc_ros.nodes.controller.background_build import Rebuild

PATIENCE_S = 30.0
BUDGET_S = 0.02
QUESTION = Question(7, R_NB, OMEGA, np.eye(3), cold=True)


def until(result: Callable[[], object]) -> object:
    """Ask again and again until something comes."""
    end_s = time.monotonic() + PATIENCE_S
    while (found := result()) is None:
        assert time.monotonic() < end_s
        time.sleep(0.001)
    return found


class Gate:
    """A solver that answers when it may."""

    def __init__(self) -> None:
        self.script, self.open = Script(20), threading.Event()

    def __call__(self, question: Question) -> object:
        self.open.wait(PATIENCE_S)
        return solve_with(self.script, 0.25)(question)


def test_an_answer_in_time_and_the_budget_is_passed_on() -> None:
    gate, prepared = Gate(), threading.Event()
    gate.open.set()
    planner = ThreadPlanner(gate, PATIENCE_S, prepared.set)
    answer = planner.ask(QUESTION)
    assert isinstance(answer, Answer)
    assert answer.question is QUESTION
    assert answer.solution is not None
    assert (gate.script.budget_s, gate.script.resets, prepared.is_set()) == (0.25, 1, True)
    assert planner.late() is None
    assert planner.late_answers == 0
    planner.close()


def test_a_late_answer_delays_nobody_and_comes_once() -> None:
    gate = Gate()
    planner = ThreadPlanner(gate, BUDGET_S)
    begun_s = time.monotonic()
    assert planner.ask(QUESTION) is None
    assert time.monotonic() - begun_s >= BUDGET_S
    for _ in range(100):  # at once, while the old one is due
        assert planner.ask(QUESTION) is None
    assert planner.late() is None
    assert planner.late_answers == 1
    gate.open.set()
    answer = until(planner.late)
    assert isinstance(answer, Answer)
    assert answer.solution is not None
    assert planner.late() is None
    assert until(lambda: planner.ask(QUESTION)) is not None
    planner.close()


def test_an_error_of_the_solver_is_an_answer() -> None:
    def broken(_question: Question) -> object:
        raise ZeroDivisionError('no such torque')

    planner = ThreadPlanner(broken, PATIENCE_S)
    for _ in range(3):  # and the thread goes on
        answer = planner.ask(QUESTION)
        assert isinstance(answer, Answer)
        assert (answer.solution, answer.error) == (None, 'ZeroDivisionError: no such torque')
    planner.close()


def test_a_loop_with_a_late_solver_holds_falls_back_and_takes_the_late_plan() -> None:
    gate = Gate()
    gate.open.set()
    planner = ThreadPlanner(gate, PATIENCE_S)
    loop = ControlLoop(Law(CONFIG, planner, TIMEOUT_S), initial_setpoint='identity')

    def tick(number: int) -> Mode:
        now_ns = SAMPLE.stamp_ns + number * STEP_NS
        loop.admit(StateSample(now_ns, R_NB, OMEGA))
        return loop.tick(now_ns).mode

    assert tick(0) is Mode.NOMINAL
    gate.open.clear()
    planner._budget_s = BUDGET_S
    assert [tick(number) for number in range(1, 8)] == [*[Mode.HOLD] * 5, *[Mode.FALLBACK] * 2]
    gate.open.set()
    until(lambda: None if planner._answers.empty() else True)
    planner._budget_s = PATIENCE_S
    gate.open.set()
    assert tick(8) is Mode.NOMINAL
    loop.reset()
    loop.close()


def test_an_answer_from_before_a_reset_is_forgotten() -> None:
    gate = Gate()
    planner = ThreadPlanner(gate, BUDGET_S)
    loop = ControlLoop(Law(CONFIG, planner, TIMEOUT_S), initial_setpoint='identity')
    loop.admit(SAMPLE)
    assert loop.tick(SAMPLE.stamp_ns).mode is Mode.FALLBACK
    loop.reset()
    gate.open.set()
    until(lambda: None if planner._answers.empty() else True)
    gate.open.clear()
    loop.admit(SAMPLE)
    assert loop.tick(SAMPLE.stamp_ns).mode is Mode.FALLBACK  # and not its plan
    gate.open.set()
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
