# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is commanded when the solver, time or the loop itself fails; no ROS needed."""

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
    TIMEOUT_S,
    Script,
    failed,
    loop_with,
    not_finite,
    raising,
)

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.command import Law
from manifold_mpc_ros.control.input_gate import StateSample
from manifold_mpc_ros.control.modes import Mode
from manifold_mpc_ros.control.solver_thread import DirectSolver, solve_with
from manifold_mpc_ros.control.target import FixedTarget
from manifold_mpc_ros.control.tick_time import LOCKSTEP, ClockTime
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.solution import SolveStatus


@pytest.mark.parametrize('spoil', [failed, not_finite, raising])
@pytest.mark.parametrize('config', [CONFIG, FREE])
def test_without_a_plan_the_fallback_law_turns_the_body_to_its_goal(
    spoil: object, config: AttitudeMpcConfig,
) -> None:
    solver = Script()
    spoil(solver)
    loop = loop_with(solver, config)
    R, omega = R_NB, 3.0 * OMEGA
    for _ in range(220):
        loop.admit(StateSample(SAMPLE.stamp_ns, R, omega))
        command = loop.tick(LOCKSTEP)
        assert (command.mode, command.source) == (Mode.FALLBACK, 'fallback')
        assert np.isfinite(command.torque_B_n_m).all()
        if config.max_torque_n_m is not None:
            assert (np.abs(command.torque_B_n_m) <= config.max_torque_n_m).all()
        for _ in range(20):
            R, omega = lgvi_step(R, omega, command.torque_B_n_m,
                                 inertia_kg_m2=config.inertia_kg_m2, step_s=config.step_s / 20)
    assert so3.angle(R) < 1e-3
    assert np.linalg.norm(omega) < 1e-3
    assert solver.resets > 0


@pytest.mark.parametrize('spoil', [failed, not_finite, raising])
def test_one_failure_is_bridged_by_the_stored_plan(spoil: object) -> None:
    solver = Script(20)
    loop = loop_with(solver, LONG)
    modes = []
    for tick in range(10):
        loop.admit(StateSample(SAMPLE.stamp_ns + tick * STEP_NS, R_NB, OMEGA))
        command = loop.tick(LOCKSTEP)
        modes.append(command.mode)
        spoil(solver)
        if command.mode is Mode.HOLD:
            assert command.source == 'plan'
            np.testing.assert_array_equal(
                command.torque_B_n_m, (1.0 - 0.01 * tick) * np.array([0.1, -0.1, 0.05]))
    assert modes == [Mode.NOMINAL, *[Mode.HOLD] * 5, *[Mode.FALLBACK] * 4]


def test_a_plan_whose_time_ran_out_is_used_where_it_is_no_worse_than_the_stored_one() -> None:
    solver = Script()
    loop = loop_with(solver)
    loop.admit(SAMPLE)
    loop.tick(LOCKSTEP)
    solver.status, solver.cost = SolveStatus.FEASIBLE, 0.95  # the plan promised 0.9
    loop.admit(StateSample(SAMPLE.stamp_ns + STEP_NS, R_NB, OMEGA))
    command = loop.tick(LOCKSTEP)
    assert (command.mode, command.reason) == (
        Mode.HOLD, 'solver: feasible, worse than the stored plan')
    loop.aim(FixedTarget(so3.exp([0.0, 0.0, 0.1])))  # the old value is about another
    assert loop.tick(LOCKSTEP).mode is Mode.NOMINAL
    solver.cost = 0.9
    assert loop.tick(LOCKSTEP).mode is Mode.NOMINAL


def test_beyond_the_existence_guard_the_torque_brakes_with_all_it_has() -> None:
    loop = loop_with(Script())
    omega = np.array([3.0, -2.0, 1.0])
    loop.admit(StateSample(SAMPLE.stamp_ns, R_NB, omega))
    command = loop.tick(LOCKSTEP)
    assert command.mode is Mode.FALLBACK
    braking = CONFIG.inertia_kg_m2 @ omega
    part = command.torque_B_n_m / braking
    np.testing.assert_allclose(part, part[0])
    assert part[0] < 0.0
    assert np.max(np.abs(command.torque_B_n_m) / CONFIG.max_torque_n_m) == pytest.approx(1.0)
    # No step to move it on with, either.
    later = loop.tick(ClockTime(SAMPLE.stamp_ns + STEP_NS // 2))
    assert later.mode is Mode.FALLBACK
    assert np.isfinite(later.torque_B_n_m).all()


def test_a_new_start_of_time_is_one_tick_of_zero_and_forgets_the_warm_start() -> None:
    solver = Script()
    loop = loop_with(solver)
    loop.admit(SAMPLE)
    loop.tick(LOCKSTEP)
    loop.tick(LOCKSTEP)
    assert solver.resets == 1
    loop.admit(SAMPLE, restarted=True)
    command = loop.tick(LOCKSTEP)
    assert (command.mode, command.reason) == (Mode.WAIT, 'time started again')
    assert not command.torque_B_n_m.any()
    assert loop.tick(LOCKSTEP).mode is Mode.NOMINAL
    assert solver.resets == 2


def test_a_clock_that_goes_back_waits_for_a_state_of_the_new_time() -> None:
    loop = loop_with(Script())
    loop.admit(SAMPLE)
    loop.tick(ClockTime(SAMPLE.stamp_ns))
    loop.go_back()
    assert loop.tick(ClockTime(5)).mode is Mode.WAIT
    loop.admit(StateSample(6, R_NB, OMEGA))
    assert loop.tick(ClockTime(7)).mode is Mode.NOMINAL


def test_errors_of_our_own_are_zero_and_latch_when_they_go_on() -> None:
    loop = loop_with(Script())
    loop.admit(SAMPLE)
    for tick in range(1, 6):
        command = loop.failed(LOCKSTEP, 'no such thing')
        assert command.mode is (Mode.WAIT if tick < 3 else Mode.FAULT)
        assert not command.torque_B_n_m.any()
        assert command.stamp_ns == SAMPLE.stamp_ns
        assert 'no such thing' in command.reason
    assert loop.tick(LOCKSTEP).mode is Mode.FAULT
    loop.reset()
    loop.admit(SAMPLE)
    for _ in range(5):
        assert loop.failed(LOCKSTEP, 'now and then').mode is Mode.WAIT
        assert loop.tick(LOCKSTEP).mode is Mode.NOMINAL


def test_the_last_commands_are_zero() -> None:
    loop = loop_with(Script())
    loop.admit(SAMPLE)
    command = loop.stopped(5)
    assert (command.mode, command.source, command.stamp_ns) == (Mode.STOPPING, 'zero', 5)
    assert not command.torque_B_n_m.any()
    assert loop.tick(LOCKSTEP).mode is Mode.STOPPING


def test_another_law_takes_over_and_the_stored_plan_stays() -> None:
    first, second = Script(20), Script(20)
    loop = loop_with(first, LONG)
    loop.admit(SAMPLE)
    loop.tick(LOCKSTEP)
    failed(second)
    smaller = dataclasses.replace(LONG, max_torque_n_m=np.full(3, 0.05))
    loop.exchange(Law(smaller, DirectSolver(solve_with(second)), TIMEOUT_S))
    loop.admit(StateSample(SAMPLE.stamp_ns + STEP_NS, R_NB, OMEGA))
    command = loop.tick(LOCKSTEP)
    assert command.mode is Mode.HOLD
    assert np.abs(command.torque_B_n_m).max() == pytest.approx(0.05)
    assert second.resets == 1
