# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The quaternion form is the same problem as ours, up to the integrator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from manifold_mpc_ros import AttitudeMpc
from manifold_mpc_ros.lab.benchmark.peers import instances, problem
from manifold_mpc_ros.lie import so3

STATES = [each.state for each in instances.draw(6)]


@pytest.fixture(scope='module')
def model() -> problem.Model:
    return problem.quaternion_model()


@pytest.mark.parametrize('state', STATES)
def test_one_step_is_the_rigid_body(model: problem.Model, state: np.ndarray) -> None:
    J, torque = problem.INERTIA_KG_M2, np.array([0.1, -0.2, 0.3])

    def rate(_: float, x: np.ndarray) -> np.ndarray:
        omega = x[9:]
        turning = x[:9].reshape(3, 3) @ so3.hat(omega)
        return np.concatenate([turning.ravel(), np.linalg.solve(
            J, torque - np.cross(omega, J @ omega))])
    start = np.concatenate([so3.rotation_from_quaternion(state[:4]).ravel(), state[4:]])
    true = solve_ivp(rate, (0, problem.STEP_S), start, rtol=1e-12, atol=1e-12).y[:, -1]
    found = np.array(model.step(state, torque)).ravel()
    assert np.allclose(so3.rotation_from_quaternion(found[:4]).ravel(), true[:9], atol=1e-4)
    assert np.allclose(found[4:], true[9:], atol=1e-5)


@pytest.fixture(scope='module')
def mpc() -> AttitudeMpc:
    return AttitudeMpc(problem.comparison_config(10))


@pytest.mark.parametrize('state', STATES)
def test_both_costs_of_our_plan_agree(
    model: problem.Model, mpc: AttitudeMpc, state: np.ndarray,
) -> None:
    plan = mpc.solve_local(so3.rotation_from_quaternion(state[:4]), state[4:])
    torques = plan.torques_B_n_m
    ours = problem.cost_on_the_group(mpc.config, model.terminal_weight, state, torques)
    assert ours == pytest.approx(plan.cost, rel=1e-10)
    theirs = model.cost(model.roll_out(state, torques), torques)
    assert theirs == pytest.approx(ours, rel=0.05)
    assert theirs != ours


@pytest.mark.parametrize('state', STATES)
def test_the_slew_keeps_the_limits_and_arrives(model: problem.Model, state: np.ndarray) -> None:
    states, torques = problem.slew(model, state, 40)
    assert np.abs(torques).max() <= problem.MAX_TORQUE_N_M
    assert np.abs(states[1:, 4:]).max() <= problem.MAX_RATE_RAD_S
    assert np.array_equal(states, model.roll_out(state, torques))
    assert so3.angle(so3.rotation_from_quaternion(states[-1, :4])) < 1e-2
