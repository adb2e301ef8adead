# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the loop tells the monitor: whatever comes between two plans ends the promise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scripted import (
    CONFIG,
    OMEGA,
    R_NB,
    SAMPLE,
    Script,
    failed,
    gate,
    loop_with,
    not_finite,
    raising,
)

from manifold_mpc_ros.control.command import Command, Law
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.decrease_monitor import DecreaseMonitor
from manifold_mpc_ros.control.decrease_record import Decrease, DecreaseRecord, Tolerance
from manifold_mpc_ros.control.input_gate import StateSample
from manifold_mpc_ros.control.solver_thread import DirectSolver, solve_with
from manifold_mpc_ros.control.target import FixedTarget
from manifold_mpc_ros.control.tick_time import LOCKSTEP, ClockTime
from manifold_mpc_ros.lie import so3

STEP_NS = round(CONFIG.step_s * 1e9)


class Bench:
    """A loop with a monitor whose solver always promises a fall and never delivers it."""

    def __init__(self) -> None:
        self.solver = Script()
        monitor = DecreaseMonitor(Tolerance(0.1, 1e-9), step_s=CONFIG.step_s)
        law = Law(CONFIG, DirectSolver(solve_with(self.solver)), 2.5, monitor)
        self.loop = ControlLoop(law, gate(), initial_setpoint='identity')
        self.stamp_ns = SAMPLE.stamp_ns

    def tick(self, *, restarted: bool = False, steps: float = 1.0) -> DecreaseRecord:
        """Take the next state in lockstep; return what the monitor says."""
        self.stamp_ns += round(steps * STEP_NS)
        self.loop.admit(StateSample(self.stamp_ns, R_NB, OMEGA), restarted=restarted)
        return self.judged(self.loop.tick(LOCKSTEP))

    @staticmethod
    def judged(command: Command) -> DecreaseRecord:
        assert command.decrease is not None
        return command.decrease


@pytest.fixture
def bench() -> Bench:
    """Give a bench after one tick: a promise is in force, and would be broken."""
    made = Bench()
    assert made.tick().verdict is Decrease.NONE
    return made


def test_two_plans_in_a_row_are_compared(bench: Bench) -> None:
    record = bench.tick()
    assert record.verdict is Decrease.BROKEN
    assert record.counters.broken == 1


def test_in_real_time_the_clock_says_how_far_two_ticks_are_apart(bench: Bench) -> None:
    """The same state twice, a step apart by the clock."""
    now_ns = bench.stamp_ns + STEP_NS
    assert bench.judged(bench.loop.tick(ClockTime(now_ns))).verdict is Decrease.BROKEN
    assert bench.judged(bench.loop.tick(ClockTime(now_ns + 2 * STEP_NS))).verdict is Decrease.NONE


def test_a_missed_tick(bench: Bench) -> None:
    record = bench.tick(steps=2.0)
    assert (record.verdict, record.reason) == (Decrease.NONE, 'a tick is missing or out of time')


def test_a_new_setpoint_ends_the_promise_and_the_same_again_does_not(bench: Bench) -> None:
    bench.loop.aim(FixedTarget(np.eye(3)))
    assert bench.tick().verdict is Decrease.BROKEN
    bench.loop.aim(FixedTarget(so3.exp([0.0, 0.0, 1e-6])))
    record = bench.tick()
    assert (record.verdict, record.reason) == (Decrease.NONE, 'the setpoint changed')
    assert bench.tick().verdict is Decrease.BROKEN


def test_a_reset(bench: Bench) -> None:
    bench.loop.reset()
    record = bench.tick()
    assert (record.verdict, record.reason) == (Decrease.NONE, 'reset')


def test_a_new_start_of_time(bench: Bench) -> None:
    record = bench.tick(restarted=True)
    assert (record.verdict, record.reason) == (Decrease.NONE, 'time started again')


def test_a_pause(bench: Bench) -> None:
    bench.loop.logic.paused = True
    record = bench.tick()
    assert (record.verdict, record.reason) == (Decrease.NONE, 'paused by the operator')
    bench.loop.logic.paused = False
    record = bench.tick()
    assert (record.verdict, record.reason) == (Decrease.NONE, 'paused by the operator')
    assert bench.tick().verdict is Decrease.BROKEN


def test_a_state_that_is_too_old(bench: Bench) -> None:
    record = bench.judged(bench.loop.tick(ClockTime(bench.stamp_ns + 10 * STEP_NS)))
    assert record.verdict is Decrease.NONE
    assert record.reason == 'the state is 5.000 s old'


@pytest.mark.parametrize('spoil', [failed, not_finite, raising])
def test_the_fallback_makes_no_promise(bench: Bench, spoil: Callable[[Script], None]) -> None:
    spoil(bench.solver)
    bench.tick()
    made = bench.tick().counters.made
    assert made == 1
    bench.solver.repair()
    assert bench.tick().verdict is Decrease.NONE
    assert bench.tick().verdict is Decrease.BROKEN


def test_a_torque_that_was_cut_makes_no_promise(bench: Bench) -> None:
    bench.solver.torque = np.array([1.0, 0.0, 0.0])
    bench.tick()
    record = bench.tick()
    assert (record.verdict, record.reason) == (
        Decrease.NONE, 'not the torque of the plan was commanded')


def test_a_loop_without_a_monitor_says_nothing() -> None:
    loop = loop_with(Script())
    loop.admit(SAMPLE)
    assert loop.tick(LOCKSTEP).decrease is None
