# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is commanded at a tick; no ROS needed, and a solver that says what it is told to."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scripted import (
    CONFIG,
    FREE,
    LONG,
    OMEGA,
    R_NB,
    SAMPLE,
    STEP_NS,
    Script,
    loop_with,
)

from manifold_mpc_ros.control.input_gate import StateSample
from manifold_mpc_ros.control.modes import Mode
from manifold_mpc_ros.control.target import FixedTarget
from manifold_mpc_ros.control.tick_time import LOCKSTEP, ClockTime
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.solution import SolveStatus


def test_zero_until_a_state_has_come_then_the_optimum() -> None:
    solver = Script()
    loop = loop_with(solver)
    command = loop.tick(ClockTime(5))
    assert (command.mode, command.source, command.stamp_ns) == (Mode.WAIT, 'zero', 5)
    assert not command.torque_B_n_m.any()
    assert solver.setpoints == []  # nothing was assumed about the state
    loop.admit(SAMPLE)
    command = loop.tick(ClockTime(SAMPLE.stamp_ns))
    assert (command.mode, command.source) == (Mode.NOMINAL, 'mpc')
    assert command.stamp_ns == SAMPLE.stamp_ns
    np.testing.assert_array_equal(command.torque_B_n_m, solver.torque)


def test_a_state_that_ages_is_moved_on_then_the_plan_is_followed_then_zero() -> None:
    """Two steps of propagation, the stored plan up to five, and nothing after the timeout."""
    solver = Script(20)
    loop = loop_with(solver, LONG)
    loop.admit(SAMPLE)
    modes = [loop.tick(ClockTime(SAMPLE.stamp_ns + ticks * STEP_NS)).mode for ticks in range(8)]
    assert modes == [*[Mode.NOMINAL] * 3, *[Mode.HOLD] * 3, *[Mode.COAST] * 2]
    assert len(solver.states) == 3
    assert loop_with(solver).tick(LOCKSTEP).mode is Mode.WAIT


@pytest.mark.parametrize(('age_ns', 'mode'), [
    (2 * STEP_NS, Mode.NOMINAL), (2 * STEP_NS + 1, Mode.COAST), (10 * STEP_NS, Mode.COAST)])
def test_without_a_stored_plan_an_old_state_is_none(age_ns: int, mode: Mode) -> None:
    loop = loop_with(Script())
    loop.admit(SAMPLE)
    command = loop.tick(ClockTime(SAMPLE.stamp_ns + age_ns))
    assert command.mode is mode
    assert command.torque_B_n_m.any() == (mode is Mode.NOMINAL)


def test_after_coasting_five_valid_states_bring_the_torque_back_step_by_step() -> None:
    solver = Script()
    solver.torque = CONFIG.max_torque_n_m
    loop = loop_with(solver)
    loop.admit(SAMPLE)
    assert loop.tick(ClockTime(SAMPLE.stamp_ns)).torque_B_n_m.any()
    stamp_ns = SAMPLE.stamp_ns + 6 * STEP_NS
    assert loop.tick(ClockTime(stamp_ns)).mode is Mode.COAST
    for count in range(1, 5):
        loop.admit(StateSample(stamp_ns + count, R_NB, OMEGA))
        command = loop.tick(ClockTime(stamp_ns + count))
        assert (command.mode, command.torque_B_n_m.any()) == (Mode.COAST, False)
        assert command.reason.startswith(f'{count} of 5 valid states')
    loop.admit(StateSample(stamp_ns + 5, R_NB, OMEGA))
    torques = [loop.tick(ClockTime(stamp_ns + 5)).torque_B_n_m for _ in range(3)]
    np.testing.assert_allclose(torques, [[0.15, 0.1, 0.05], [0.3, 0.2, 0.1], [0.3, 0.2, 0.1]])


def test_the_receipt_of_a_state_ages_too() -> None:
    """A source whose clock follows ours, but whose messages stopped coming."""
    loop = loop_with(Script())
    loop.admit(dataclasses.replace(SAMPLE, received_ns=7))
    assert loop.tick(ClockTime(SAMPLE.stamp_ns, 7 + STEP_NS)).mode is Mode.NOMINAL
    command = loop.tick(ClockTime(SAMPLE.stamp_ns, 7 + 6 * STEP_NS))
    assert (command.mode, command.reason) == (Mode.COAST, 'the state is 3.000 s old')
    command = loop.tick(ClockTime(SAMPLE.stamp_ns))
    assert command.mode is Mode.COAST  # it takes valid states to come back


def test_the_state_is_moved_on_to_the_tick_under_the_commands_since() -> None:
    solver, expected = Script(), (R_NB, OMEGA)
    loop = loop_with(solver, FREE)
    loop.admit(SAMPLE)
    torque = loop.tick(ClockTime(SAMPLE.stamp_ns)).torque_B_n_m
    np.testing.assert_array_equal(solver.states[0][0], R_NB)
    np.testing.assert_array_equal(solver.states[0][1], OMEGA)
    for age_s, last_s, steps in ((0.04, 0.0, 1), (0.7, 0.04, 2)):
        solver.torque = solver.torque + 0.1
        for _ in range(steps):
            expected = lgvi_step(*expected, torque, inertia_kg_m2=FREE.inertia_kg_m2,
                                 step_s=(age_s - last_s) / steps)
        torque = loop.tick(ClockTime(SAMPLE.stamp_ns + round(age_s * 1e9))).torque_B_n_m
        np.testing.assert_allclose(solver.states[-1][0], expected[0], rtol=0, atol=1e-14)
        np.testing.assert_allclose(solver.states[-1][1], expected[1], rtol=0, atol=1e-14)
    loop.tick(LOCKSTEP)
    np.testing.assert_array_equal(solver.states[-1][0], R_NB)


def test_commands_are_scaled_into_the_limits_with_their_direction_kept() -> None:
    solver = Script()
    solver.torque = np.array([1.0, -1.0, 0.05])
    loop = loop_with(solver)
    loop.admit(SAMPLE)
    np.testing.assert_allclose(loop.tick(LOCKSTEP).torque_B_n_m, [0.2, -0.2, 0.01])
    assert loop.output.saturated == 1


@pytest.mark.parametrize('status', [SolveStatus.FEASIBLE, SolveStatus.INFEASIBLE])
def test_a_plan_that_is_not_optimal_is_used(status: SolveStatus) -> None:
    solver = Script()
    solver.status = status
    loop = loop_with(solver)
    loop.admit(SAMPLE)
    command = loop.tick(LOCKSTEP)
    assert command.mode is Mode.NOMINAL
    assert status.value in command.reason


def test_setpoints() -> None:
    solver = Script()
    loop = loop_with(solver)
    loop.admit(SAMPLE)
    loop.tick(LOCKSTEP)
    np.testing.assert_array_equal(solver.setpoints[-1], np.eye(3))
    assert not loop.commanded
    goal = so3.exp([0.0, 1.0, 0.0])
    loop.aim(FixedTarget(goal))
    loop.tick(LOCKSTEP)
    np.testing.assert_array_equal(solver.setpoints[-1], goal)
    assert loop.commanded


def test_hold_keeps_the_first_attitude_until_a_reset() -> None:
    solver = Script()
    loop = loop_with(solver, setpoint='hold')
    loop.admit(SAMPLE)
    later = StateSample(SAMPLE.stamp_ns + 1, np.eye(3), OMEGA)
    loop.admit(later)
    loop.tick(LOCKSTEP)
    np.testing.assert_array_equal(solver.setpoints[-1], R_NB)
    loop.reset()
    assert loop.tick(ClockTime(7)).mode is Mode.WAIT
    loop.admit(later)
    loop.tick(LOCKSTEP)
    np.testing.assert_array_equal(solver.setpoints[-1], np.eye(3))


def test_pause_commands_zero_and_keeps_listening() -> None:
    loop = loop_with(Script())
    loop.logic.paused = True
    loop.admit(SAMPLE)
    command = loop.tick(LOCKSTEP)
    assert (command.mode, command.stamp_ns) == (Mode.PAUSED, SAMPLE.stamp_ns)
    assert not command.torque_B_n_m.any()
    loop.logic.paused = False
    assert loop.tick(LOCKSTEP).mode is Mode.NOMINAL
