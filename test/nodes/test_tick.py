# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is commanded at a tick; no ROS needed, and a solver that says what it is told to."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from manifold_mpc_ros.config import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.errors import StepExistenceError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus
from manifold_mpc_ros.nodes.gate import StateSample
from manifold_mpc_ros.nodes.tick import ControlLoop, Mode

CONFIG = AttitudeMpcConfig(
    inertia_kg_m2=np.diag([1.0, 0.9, 0.6]), step_s=0.5, horizon=2, attitude_weight=np.eye(3),
    rate_weight=np.diag([0.25, 0.35, 0.65]), torque_weight=2.0 * np.eye(3),
    max_torque_n_m=np.array([0.3, 0.2, 0.1]))
FREE = dataclasses.replace(CONFIG, max_torque_n_m=None)
TIMEOUT_S = 2.5
R_NB = so3.exp([0.3, -0.2, 0.1])
OMEGA = np.array([0.1, 0.2, -0.3])
SAMPLE = StateSample(10 * 10**9, R_NB, OMEGA)


class Script:
    """A solver whose answer the test writes."""

    def __init__(self) -> None:
        self.repair()
        self.resets = 0
        self.setpoints: list[np.ndarray | None] = []
        self.states: list[tuple[np.ndarray, np.ndarray]] = []

    def repair(self) -> None:
        self.torque = np.array([0.1, -0.1, 0.05])
        self.status = SolveStatus.CONVERGED
        self.error: Exception | None = None

    def reset(self) -> None:
        self.resets += 1

    def solve(
        self, R_NB: np.ndarray, omega_BN_B: np.ndarray, R_ND: np.ndarray | None = None,
    ) -> AttitudeMpcSolution:
        if self.error is not None:
            raise self.error
        self.setpoints.append(R_ND)
        self.states.append((R_NB, omega_BN_B))
        plan = np.tile(self.torque, (2, 1))
        return AttitudeMpcSolution(
            self.torque, plan, np.tile(R_NB, (3, 1, 1)), np.tile(omega_BN_B, (3, 1)), 1.0, 3,
            1e-4, self.status, 0.0, 0.0, False, 0.9, 0.5)


def loop_with(
    solver: Script, config: AttitudeMpcConfig = CONFIG, setpoint: str = 'identity',
) -> ControlLoop:
    return ControlLoop(solver, config, timeout_s=TIMEOUT_S, initial_setpoint=setpoint)


def test_zero_until_a_state_has_come_then_the_optimum() -> None:
    solver = Script()
    loop = loop_with(solver)
    command = loop.tick(5)
    assert (command.mode, command.source, command.stamp_ns) == (Mode.WAIT, 'zero', 5)
    assert not command.torque_B_n_m.any()
    assert solver.setpoints == []  # nothing was assumed about the state
    loop.admit(SAMPLE)
    command = loop.tick(SAMPLE.stamp_ns)
    assert (command.mode, command.source) == (Mode.NOMINAL, 'mpc')
    assert command.stamp_ns == SAMPLE.stamp_ns
    np.testing.assert_array_equal(command.torque_B_n_m, solver.torque)


@pytest.mark.parametrize(('age_ns', 'mode'), [
    (round(TIMEOUT_S * 1e9), Mode.NOMINAL), (round(TIMEOUT_S * 1e9) + 1, Mode.COAST)])
def test_zero_when_the_state_is_older_than_the_timeout(age_ns: int, mode: Mode) -> None:
    loop = loop_with(Script())
    loop.admit(SAMPLE)
    command = loop.tick(SAMPLE.stamp_ns + age_ns)
    assert command.mode is mode
    assert command.torque_B_n_m.any() == (mode is Mode.NOMINAL)
    assert loop.tick(None).mode is Mode.NOMINAL  # lockstep: a state is as old as it says


def test_the_state_is_moved_on_to_the_tick_under_the_last_command() -> None:
    solver = Script()
    loop = loop_with(solver, FREE)
    loop.admit(SAMPLE)
    first = loop.tick(SAMPLE.stamp_ns).torque_B_n_m
    np.testing.assert_array_equal(solver.states[0][0], R_NB)
    np.testing.assert_array_equal(solver.states[0][1], OMEGA)
    for age_s, steps in ((0.04, 1), (0.7, 2)):
        loop.tick(SAMPLE.stamp_ns + round(age_s * 1e9))
        expected = R_NB, OMEGA
        for _ in range(steps):
            expected = lgvi_step(*expected, first, inertia_kg_m2=FREE.inertia_kg_m2,
                                 step_s=age_s / steps)
        np.testing.assert_allclose(solver.states[-1][0], expected[0], rtol=0, atol=1e-14)
        np.testing.assert_allclose(solver.states[-1][1], expected[1], rtol=0, atol=1e-14)
    loop.tick(None)
    np.testing.assert_array_equal(solver.states[-1][0], R_NB)


def test_commands_stay_within_the_limits() -> None:
    solver = Script()
    solver.torque = np.array([1.0, -1.0, 0.05])
    loop = loop_with(solver)
    loop.admit(SAMPLE)
    np.testing.assert_array_equal(loop.tick(None).torque_B_n_m, [0.3, -0.2, 0.05])


@pytest.mark.parametrize('status', [SolveStatus.FEASIBLE, SolveStatus.INFEASIBLE])
def test_a_plan_that_is_not_optimal_is_used(status: SolveStatus) -> None:
    solver = Script()
    solver.status = status
    loop = loop_with(solver)
    loop.admit(SAMPLE)
    command = loop.tick(None)
    assert command.mode is Mode.NOMINAL
    assert status.value in command.reason


def failed(solver: Script) -> None:
    solver.status = SolveStatus.FAILED


def not_finite(solver: Script) -> None:
    solver.torque = np.array([0.1, np.nan, 0.0])


def raising(solver: Script) -> None:
    solver.error = StepExistenceError('too fast')


@pytest.mark.parametrize('spoil', [failed, not_finite, raising])
@pytest.mark.parametrize('config', [CONFIG, FREE])
def test_without_a_plan_the_torque_slows_the_body_down(
    spoil: object, config: AttitudeMpcConfig,
) -> None:
    solver = Script()
    spoil(solver)
    loop = loop_with(solver, config)
    R, omega, energies = R_NB, 3.0 * OMEGA, []
    for _ in range(60):
        loop.admit(StateSample(SAMPLE.stamp_ns, R, omega))
        command = loop.tick(None)
        assert (command.mode, command.source) == (Mode.FALLBACK, 'damping')
        assert np.isfinite(command.torque_B_n_m).all()
        if config.max_torque_n_m is not None:
            assert (np.abs(command.torque_B_n_m) <= config.max_torque_n_m).all()
        energies.append(omega @ config.inertia_kg_m2 @ omega)
        for _ in range(20):
            R, omega = lgvi_step(R, omega, command.torque_B_n_m,
                                 inertia_kg_m2=config.inertia_kg_m2, step_s=config.step_s / 20)
    assert (np.diff(energies) < 0.0).all()
    assert energies[-1] < 1e-6 * energies[0]
    assert solver.resets > 0


def test_at_rest_the_fallback_is_zero_and_finite() -> None:
    solver = Script()
    failed(solver)
    loop = loop_with(solver)
    loop.admit(StateSample(SAMPLE.stamp_ns, R_NB, np.zeros(3)))
    assert not loop.tick(None).torque_B_n_m.any()


def test_setpoints() -> None:
    solver = Script()
    loop = loop_with(solver)
    loop.admit(SAMPLE)
    loop.tick(None)
    np.testing.assert_array_equal(solver.setpoints[-1], np.eye(3))
    assert not loop.commanded
    goal = so3.exp([0.0, 1.0, 0.0])
    loop.aim(goal)
    loop.tick(None)
    np.testing.assert_array_equal(solver.setpoints[-1], goal)
    assert loop.commanded


def test_hold_keeps_the_first_attitude_until_a_reset() -> None:
    solver = Script()
    loop = loop_with(solver, setpoint='hold')
    loop.admit(SAMPLE)
    later = StateSample(SAMPLE.stamp_ns + 1, np.eye(3), OMEGA)
    loop.admit(later)
    loop.tick(None)
    np.testing.assert_array_equal(solver.setpoints[-1], R_NB)
    loop.reset()
    assert loop.tick(7).mode is Mode.WAIT
    loop.admit(later)
    loop.tick(None)
    np.testing.assert_array_equal(solver.setpoints[-1], np.eye(3))


def test_pause_commands_zero_and_keeps_listening() -> None:
    loop = loop_with(Script())
    loop.paused = True
    loop.admit(SAMPLE)
    command = loop.tick(None)
    assert (command.mode, command.stamp_ns) == (Mode.PAUSED, SAMPLE.stamp_ns)
    assert not command.torque_B_n_m.any()
    loop.paused = False
    assert loop.tick(None).mode is Mode.NOMINAL


def test_a_new_start_of_time_forgets_the_warm_start() -> None:
    solver = Script()
    loop = loop_with(solver)
    before = solver.resets
    loop.admit(SAMPLE)
    assert solver.resets == before
    loop.admit(SAMPLE, restarted=True)
    assert solver.resets == before + 1
