# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""On R^n the general procedure is the textbook's: LQR without limits, a QP with them."""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from strategies import generator

from manifold_mpc_ros.lab.certification.double_integrator import double_integrator_problem
from manifold_mpc_ros.lab.reference.manifold_mpc import ManifoldMpc, PlanStatus, run_on_manifold
from manifold_mpc_ros.lie.arrays import Array

H, Q, R = 0.5, np.diag([1.0, 0.3]), np.array([[0.5]])
A, B = np.array([[1.0, H], [0.0, 1.0]]), np.array([[H * H / 2], [H]])
WEIGHTS = {'position_weight': 1.0, 'velocity_weight': 0.3, 'input_weight': 0.5}
LIMITS = {'max_input': 0.4, 'max_velocity': 0.8}
STATES = (np.array([3.0, 0.0]), np.array([-2.0, 0.7]), np.array([0.5, -0.6]))


def lqr(q: Array = Q, r: Array = R) -> SimpleNamespace:
    """Return P and K of the textbook's infinite-horizon regulator."""
    P = solve_discrete_are(A, B, q, r)
    return SimpleNamespace(P=P, K=-np.linalg.solve(B.T @ P @ B + r, B.T @ P @ A), c=np.inf)


def first_gain(P: Array, horizon: int) -> Array:
    """Return the first gain of the finite-horizon regulator, from P backwards."""
    for _ in range(horizon):
        K = -np.linalg.solve(B.T @ P @ B + R, B.T @ P @ A)
        P = Q + A.T @ P @ (A + B @ K)
    return np.asarray(K)


def condensed_qp(x0: Array, P: Array, horizon: int) -> tuple[Array, float]:
    """Return the inputs (N,) and the cost of the QP in the inputs alone, by an active set."""
    powers = [np.linalg.matrix_power(A, k) for k in range(horizon + 1)]
    free = np.concatenate([power @ x0 for power in powers[1:]])
    forced = np.zeros((2 * horizon, horizon))
    for k in range(horizon):
        for j in range(k + 1):
            forced[2 * k:2 * k + 2, j] = (powers[k - j] @ B)[:, 0]
    weight = np.kron(np.eye(horizon), Q)
    weight[-2:, -2:] = P
    hessian = forced.T @ weight @ forced + R[0, 0] * np.eye(horizon)
    gradient = forced.T @ weight @ free
    velocity = slice(1, None, 2)
    options = {'print_iter': False, 'print_header': False, 'print_info': False}
    solver = ca.conic('qp', 'qrqp', {
        'h': ca.DM(hessian).sparsity(), 'a': ca.DM(forced[velocity]).sparsity()}, options)
    limit = LIMITS['max_velocity']
    result = solver(h=hessian, g=gradient, a=ca.DM(forced[velocity]),
                    lbx=-LIMITS['max_input'], ubx=LIMITS['max_input'],
                    lba=-limit - free[velocity], uba=limit - free[velocity])
    constant = (x0 @ Q @ x0 + free @ weight @ free) / 2
    return np.array(result['x']).ravel(), float(result['cost']) + constant


def test_without_limits_and_with_the_lqr_cost_the_law_is_lqr_at_every_step() -> None:
    regulator = lqr()
    mpc = ManifoldMpc(double_integrator_problem(step_s=H, **WEIGHTS), 8, False,
                      terminal=regulator)
    log = run_on_manifold(mpc, STATES[0], 12)
    x = STATES[0]
    for state, control, value in zip(log.states, log.controls, log.values):
        assert np.allclose(state, x, rtol=0, atol=1e-8)
        assert np.allclose(control, regulator.K @ x, rtol=0, atol=1e-8)
        assert value == pytest.approx(x @ regulator.P @ x / 2, rel=1e-9)
        x = (A + B @ regulator.K) @ x


@pytest.mark.parametrize('horizon', [1, 5])
def test_with_its_own_terminal_cost_it_is_the_finite_horizon_regulator(horizon: int) -> None:
    mpc = ManifoldMpc(double_integrator_problem(step_s=H, terminal_scale=0.4, **WEIGHTS),
                      horizon, False)
    P = lqr(Q / 0.4, R / 0.4).P
    assert np.allclose(mpc.terminal.P, P, rtol=1e-9)
    gain = first_gain(P, horizon)
    assert np.abs(gain - lqr().K).max() > 1e-5  # not the infinite-horizon one
    for x in STATES:
        mpc.reset()
        assert np.allclose(mpc.solve(x).control, gain @ x, rtol=0, atol=1e-8)


def test_with_limits_it_is_the_condensed_qp() -> None:
    problem = double_integrator_problem(step_s=H, **WEIGHTS, **LIMITS)
    mpc, binding = ManifoldMpc(problem, 10, False, starts=2), set()
    states = [*STATES, *generator('double integrator').uniform(-1, 1, (5, 2)) * [2.5, 0.7]]
    for x in states:
        mpc.reset()
        solution = mpc.solve(x)
        inputs, cost = condensed_qp(x, mpc.terminal.P, 10)
        assert solution.status is PlanStatus.OPTIMAL
        assert solution.value == pytest.approx(cost, rel=1e-7)
        assert np.allclose(solution.plan.controls[:, 0], inputs, rtol=0, atol=1e-4)
        binding |= {name for name, size, limit in (
            ('input', np.abs(inputs).max(), LIMITS['max_input']),
            ('velocity', np.abs(solution.plan.states[1:, 1]).max(), LIMITS['max_velocity']))
            if size > limit * (1 - 1e-6)}
    assert binding == {'input', 'velocity'}


def test_with_the_terminal_set_the_loop_keeps_its_promises_and_its_limits() -> None:
    problem = double_integrator_problem(step_s=H, **WEIGHTS, **LIMITS)
    mpc = ManifoldMpc(problem, 14, starts=2)
    log = run_on_manifold(mpc, STATES[0], 25)
    assert set(log.statuses) == {PlanStatus.OPTIMAL}
    assert np.all(log.decrease_violations <= 1e-7 * log.values[0])
    assert np.abs(log.controls).max() <= LIMITS['max_input'] * (1 + 1e-6)
    assert np.abs(log.states[1:, 1]).max() <= LIMITS['max_velocity'] * (1 + 1e-6)
    assert np.abs(log.states[-1]).max() < 1e-3


def test_outside_the_domain_of_the_horizon_there_is_no_plan() -> None:
    problem = double_integrator_problem(step_s=H, **WEIGHTS, **LIMITS)
    mpc = ManifoldMpc(problem, 2, starts=2)
    solution = mpc.solve(STATES[0])
    assert solution.status is PlanStatus.INFEASIBLE
    assert solution.value == np.inf
    assert solution.plan.violation > 1e-3
