# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A disturbance in the optimisation: planned in the net torque, limits on what is commanded."""

from __future__ import annotations

import numpy as np
import pytest
from cases import CERTIFIED, configuration, random_states

from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.closed_loop import ModelPlant
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import SolveStatus

D = np.array([0.1, -0.05, 0.02])
LIMIT = 0.3
STATES = random_states('disturbance', 12, 0.2)


@pytest.fixture(scope='module')
def mpc() -> AttitudeMpc:
    return AttitudeMpc(configuration(**CERTIFIED), disturbed=True)


@pytest.fixture(scope='module')
def plain() -> AttitudeMpc:
    return AttitudeMpc(configuration(**CERTIFIED))


def test_without_one_the_answer_is_that_of_the_other_solver(
    mpc: AttitudeMpc, plain: AttitudeMpc,
) -> None:
    for R_NB, omega in STATES:
        mpc.reset()
        plain.reset()
        one, other = mpc.solve(R_NB, omega), plain.solve(R_NB, omega)
        np.testing.assert_allclose(one.torques_B_n_m, other.torques_B_n_m, atol=1e-5)


def test_the_command_keeps_the_limits_and_uses_all_of_them(mpc: AttitudeMpc) -> None:
    used = []
    for R_NB, omega in STATES:
        mpc.reset()
        solution = mpc.solve(R_NB, omega, disturbance_B_n_m=D)
        assert (np.abs(solution.torques_B_n_m) <= LIMIT * (1.0 + 1e-9)).all()
        used.append(solution.torques_B_n_m)
    for side in (np.max(used, axis=(0, 1)), -np.min(used, axis=(0, 1))):
        assert (side > 0.99 * LIMIT).all()


def test_where_no_limit_is_met_the_net_torque_is_what_it_was(
    mpc: AttitudeMpc, plain: AttitudeMpc,
) -> None:
    R_NB, omega = so3.exp([0.01, -0.02, 0.01]), np.zeros(3)
    mpc.reset()
    plain.reset()
    disturbed, free = mpc.solve(R_NB, omega, disturbance_B_n_m=D), plain.solve(R_NB, omega)
    np.testing.assert_allclose(
        disturbed.torques_B_n_m + D, free.torques_B_n_m, atol=1e-6)


def test_the_closed_loop_ends_without_offset_and_the_value_falls(mpc: AttitudeMpc) -> None:
    mpc.reset()
    body = ModelPlant(mpc.config, so3.exp([0.0, 0.0, 3.0]))
    bound = np.inf
    for _ in range(60):
        solution = mpc.solve(*body.measure(), disturbance_B_n_m=D)
        assert solution.status is SolveStatus.CONVERGED
        assert solution.cost <= bound + 1e-6
        bound = solution.promised_cost
        body.step(solution.torque_B_n_m + D)
    assert so3.angle(body.R_NB) < 1e-7


def test_one_that_ends_leaves_the_limits_as_they_were(
    mpc: AttitudeMpc, plain: AttitudeMpc,
) -> None:
    R_NB, omega = STATES[0]
    mpc.solve(R_NB, omega, disturbance_B_n_m=D)
    mpc.reset()
    plain.reset()
    np.testing.assert_allclose(mpc.solve(R_NB, omega).torques_B_n_m,
                               plain.solve(R_NB, omega).torques_B_n_m, atol=1e-5)


@pytest.mark.parametrize('wrong', [[0.3, 0.0, 0.0], [0.0, np.nan, 0.0], [0.1, 0.1]])
def test_one_that_the_torque_cannot_hold_is_refused(mpc: AttitudeMpc, wrong: list[float]) -> None:
    with pytest.raises(ConfigurationError, match='below the torque limit'):
        mpc.solve(np.eye(3), np.zeros(3), disturbance_B_n_m=wrong)


def test_without_torque_limits_it_is_subtracted() -> None:
    mpc = AttitudeMpc(configuration(terminal_constraint=False))
    R_NB, omega = STATES[0]
    free = mpc.solve(R_NB, omega).torques_B_n_m
    mpc.reset()
    np.testing.assert_allclose(
        mpc.solve(R_NB, omega, disturbance_B_n_m=D).torques_B_n_m, free - D, atol=1e-12)
