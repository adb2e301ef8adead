# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Attitude and pointing as problems, against the numpy integrator and the paper's formulas."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pytest
from cases import LIMITS, configuration
from scipy.linalg import solve_discrete_are
from strategies import INERTIAS, generator, unit_vectors

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.lgvi import legendre, lgvi_step, step_rotation
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.linearisation import linearise
from manifold_mpc_ros.terminal.manifold import tangent_basis
from manifold_mpc_ros.terminal.problem import ManifoldProblem
from manifold_mpc_ros.terminal.problem_of import (
    attitude_problem,
    pointing_problem,
    problem_of,
    terminal_design,
)
from manifold_mpc_ros.terminal.riccati import solve_riccati

AXIS = np.array([0.48, -0.6, 0.64])
POINTING: dict[str, Any] = {'pointing_axis_B': AXIS, 'pointing_weight': 1.7}
CASES: dict[str, dict[str, Any]] = {
    'paper': {**LIMITS, **POINTING},
    'symmetric': {**LIMITS, **POINTING, 'forcing': 'symmetric'},
    'off_diagonal': {
        **LIMITS, 'forcing': 'symmetric', 'inertia_kg_m2': INERTIAS['off_diagonal'],
        'attitude_weight': np.diag([1.0, 2.0, 3.0]) + 0.2, 'rate_weight': np.eye(3) + 0.1,
        'torque_weight': np.diag([2.0, 1.0, 3.0]) + 0.1, 'pointing_axis_B': [1.0, 2.0, 0.5]},
    'cubesat': {'forcing': 'symmetric', 'inertia_kg_m2': INERTIAS['cubesat'], 'step_s': 0.1,
                'torque_weight': 1e4 * np.eye(3)},
}
in_cases = pytest.mark.parametrize('case', sorted(CASES))
COUNT = 60


class States(NamedTuple):
    """Attitudes, rates and torques, and the same as points of the two problems."""

    R: Array
    omega: Array
    torque: Array
    attitude: Array
    pointing: Array


def states(config: AttitudeMpcConfig, load: float = 0.4) -> States:
    """Return states of any attitude whose rate and torque use up to ``load`` of the guard each."""
    rng, h, J = generator('states', load), config.step_s, config.inertia_kg_m2
    R = so3.random_rotations(rng, COUNT)
    guard = np.linalg.eigvalsh(J)[0]
    momentum = load * guard / h * rng.uniform(size=(COUNT, 1)) * unit_vectors(rng, COUNT)
    torque = 2 * load * guard / h**2 * rng.uniform(size=(COUNT, 1)) * unit_vectors(rng, COUNT)
    omega = momentum @ np.linalg.inv(J)
    return States(R, omega, torque, *points(config, R, omega))


def points(config: AttitudeMpcConfig, R: Array, omega: Array) -> tuple[Array, Array]:
    """Return the points of the attitude problem (n, 8) and of the pointing problem (n, 7)."""
    step = so3.quaternion_from_rotation(step_rotation(omega, config.inertia_kg_m2, config.step_s))
    seen = np.einsum('nji,j->ni', R, config.pointing_axis_B)
    return np.hstack([so3.quaternion_from_rotation(R), step]), np.hstack([seen, step])


def numeric(problem: ManifoldProblem, f: Callable[[ca.SX, ca.SX], ca.SX]) -> ca.Function:
    """Return f of (x, u) for many of them."""
    x, u = ca.SX.sym('x', problem.states.ambient), ca.SX.sym('u', problem.controls.ambient)
    function = ca.Function('f', [x, u], [f(x, u)])
    return lambda a, b: np.array(function.map(len(a))(a.T, b.T)).T


def advanced(config: AttitudeMpcConfig, s: States) -> tuple[Array, Array]:
    """Return attitude and rate after the integrator's step."""
    return lgvi_step(s.R, s.omega, s.torque, inertia_kg_m2=config.inertia_kg_m2,
                     step_s=config.step_s,
                     forcing='paper' if config.forcing == 'paper' else 'symmetric')


@in_cases
def test_the_step_is_the_integrators(case: str) -> None:
    """On SO(3) x SO(3) up to the sign of the quaternions, and what the body sees of it on S^2."""
    config = configuration(**CASES[case])
    s = states(config)
    attitude, pointing = points(config, *advanced(config, s))
    found = numeric(problem := attitude_problem(config), problem.step)(s.attitude, s.torque)
    sign = np.sign(np.sum(found[:, :4] * attitude[:, :4], axis=1, keepdims=True))
    assert np.abs(sign * found[:, :4] - attitude[:, :4]).max() < 1e-13
    assert np.abs(found[:, 4:] - attitude[:, 4:]).max() < 1e-12
    found = numeric(problem := pointing_problem(config), problem.step)(s.pointing, s.torque)
    assert np.abs(found - pointing).max() < 1e-12


@in_cases
def test_the_stage_costs_are_the_papers(case: str) -> None:
    """``tr(Q (I - g)) + tr(Qf (I - f)) / h^2 + tr(u^T R u) / 2``; 1 - b . Gamma on S^2."""
    config = configuration(**CASES[case])
    s, h = states(config), config.step_s
    f, u = step_rotation(s.omega, config.inertia_kg_m2, h), so3.hat(s.torque)

    def traces(weight: Array, rotation: Array) -> Array:
        return np.trace(weight @ (np.eye(3) - rotation), axis1=1, axis2=2)
    motion = (traces(config.rate_weight, f) / h**2 + np.trace(
        np.swapaxes(u, 1, 2) @ config.torque_weight @ u, axis1=1, axis2=2) / 2)
    expected = traces(config.attitude_weight, s.R) + motion
    found = numeric(problem := attitude_problem(config), problem.stage_cost)
    assert np.allclose(found(s.attitude, s.torque)[:, 0], expected, rtol=1e-12)
    axis = config.pointing_axis_B
    expected = config.pointing_weight * (1 - s.pointing[:, :3] @ axis) + motion
    found = numeric(problem := pointing_problem(config), problem.stage_cost)
    assert np.allclose(found(s.pointing, s.torque)[:, 0], expected, rtol=1e-12)


@in_cases
def test_small_costs_keep_their_digits(case: str) -> None:
    """1e-9 rad from the target the cost is its quadratic form: nothing is subtracted from 1."""
    config = configuration(**CASES[case])
    for problem in (attitude_problem(config), pointing_problem(config)):
        linear = linearise(problem)
        n = problem.states.dimension
        xi = ca.SX.sym('xi', n)
        cost = ca.Function('cost', [xi], [problem.stage_cost(problem.states.point(xi),
                                                             ca.SX.zeros(3))])
        direction = np.ones(n) * problem.state_units
        form = config.terminal_scale * direction @ linear.Q @ direction / 2
        assert float(cost(1e-9 * direction)) == pytest.approx(1e-18 * form, rel=1e-6)


@in_cases
def test_rate_limits_are_those_of_the_rate(case: str) -> None:
    config = configuration(**CASES[case])
    s = states(config)
    for problem, x in ((attitude_problem(config), s.attitude),
                       (pointing_problem(config), s.pointing)):
        if config.max_rate_rad_s is None:
            assert problem.state_limits == {}
            continue
        limit = problem.state_limits['rate']
        found = numeric(problem, lambda x, _u, limit=limit: limit(x))(x, s.torque)
        part = s.omega / config.max_rate_rad_s
        assert found.shape == (COUNT, 6)
        assert np.allclose(np.sort(found), np.sort(np.hstack([part, -part]) - 1), atol=1e-13)


def test_free_axes_have_no_rate_limit() -> None:
    problem = attitude_problem(configuration(max_rate_rad_s=(0.5, np.inf, 0.6)))
    assert problem.state_limits['rate'](ca.SX.sym('x', 8)).shape == (4, 1)


@in_cases
@pytest.mark.parametrize('load', [0.4, 0.55])
def test_the_existence_load_is_that_of_the_implicit_steps(case: str, load: float) -> None:
    """The largest of three momenta over the guard; below 1 the integrator takes the step."""
    config = configuration(**CASES[case])
    s, h, J = states(config, load), config.step_s, config.inertia_kg_m2
    guard = np.linalg.eigvalsh(J)[0]
    momentum = h * s.omega @ J
    pushed = momentum + (h**2 / 2 * s.torque if config.forcing == 'symmetric' else 0.0)
    inside = np.linalg.norm(pushed, axis=1) < 0.999 * guard
    expected = np.maximum(np.linalg.norm(momentum, axis=1), np.linalg.norm(pushed, axis=1)) / guard
    s = States(*(value[inside] for value in s))
    _, omega = advanced(config, s)
    following = np.linalg.norm(h * omega @ J, axis=1) / guard
    expected[inside] = np.maximum(expected[inside], following)
    s = states(config, load)
    for problem, x in ((attitude_problem(config), s.attitude),
                       (pointing_problem(config), s.pointing)):
        assert problem.existence is not None
        found = numeric(problem, problem.existence)(x, s.torque)[:, 0]
        assert np.allclose(found, expected, rtol=1e-9)
    assert (expected > 1).any() == (load > 0.5)


@in_cases
def test_the_rate_in_the_chart(case: str) -> None:
    """The coordinates (.., Log f / h) belong to omega = J^-1 m(f) / h, m the Legendre map."""
    config = configuration(**CASES[case])
    problem, h = attitude_problem(config), config.step_s
    rng = generator('chart rates')
    moments = np.linalg.eigvalsh(config.inertia_kg_m2)
    largest = 0.5 * moments[0] / moments[-1] / h
    rates = largest * rng.uniform(size=(COUNT, 1)) * unit_vectors(rng, COUNT)
    c = so3.cayley_inverse(so3.exp(h * rates))
    omega = legendre(c, config.inertia_kg_m2) / h @ np.linalg.inv(config.inertia_kg_m2)
    again = so3.log(step_rotation(omega, config.inertia_kg_m2, h)) / h
    assert np.abs(again - rates).max() < 1e-12 / h
    x = ca.SX.sym('x', 8)
    coordinates = ca.Function('f', [x], [problem.states.coordinates(x)]).map(COUNT)
    R = so3.random_rotations(rng, COUNT)
    found = np.array(coordinates(points(config, R, omega)[0].T)).T
    assert np.abs(found - np.hstack([so3.log(R), rates])).max() < 1e-12 / h


@in_cases
def test_the_pointing_design_by_hand(case: str) -> None:
    """A, B, Q, R of the docstring's formulas, and P, K from them."""
    config = configuration(**CASES[case])
    h, E = config.step_s, tangent_basis(config.pointing_axis_B)
    inverse = np.linalg.inv(config.inertia_kg_m2)
    top = h * h / 2 * E.T @ inverse if config.forcing == 'symmetric' else np.zeros((2, 3))
    A = np.block([[np.eye(2), h * E.T], [np.zeros((3, 2)), np.eye(3)]])
    B = np.vstack([top, h * inverse])

    def hessian(weight: Array) -> Array:
        return np.trace(weight) * np.eye(3) - weight
    Q = np.block([[config.pointing_weight * np.eye(2), np.zeros((2, 3))],
                  [np.zeros((3, 2)), hessian(config.rate_weight)]]) / config.terminal_scale
    R = hessian(config.torque_weight) / config.terminal_scale
    linear = linearise(pointing_problem(config))
    for found, expected in ((linear.A, A), (linear.B, B), (linear.Q, Q), (linear.R, R)):
        assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()
    assert np.abs(linear.N).max() < 1e-12 * np.sqrt(np.abs(Q).max() * np.abs(R).max())
    balance, unit = np.array([1.0, 1.0, 1 / h, 1 / h, 1 / h]), np.trace(
        config.inertia_kg_m2) / 3 / h**2
    P = solve_discrete_are(A * balance / balance[:, None], B * unit / balance[:, None],
                           Q * np.outer(balance, balance), R * unit**2)
    P = P / np.outer(balance, balance)
    K = -np.linalg.solve(B.T @ P @ B + R, B.T @ P @ A)
    solution = solve_riccati(linear)
    assert np.abs(solution.P - P).max() < 1e-9 * np.abs(P).max()
    assert np.abs(solution.K - K).max() < 1e-9 * np.abs(K).max()


@pytest.mark.parametrize('forcing', ['paper', 'symmetric'])
def test_pointing_of_a_ball_is_attitude_control_across_its_axis(forcing: str) -> None:
    """J = I, b = z: each axis by itself, so the blocks across b agree; about b only a rate."""
    shared = {'inertia_kg_m2': np.eye(3), 'forcing': forcing, 'pointing_weight': 2.0}
    config = configuration(**shared)  # tr(Qg) I - Qg = 2 I as well
    full, reduced = (solve_riccati(linearise(make(config)))
                     for make in (attitude_problem, pointing_problem))
    E = tangent_basis([0.0, 0.0, 1.0])
    lift = np.block([[E, np.zeros((3, 3))], [np.zeros((3, 2)), np.eye(3)]])
    across = np.diag([1.0, 1.0, 1.0, 1.0, 0.0])
    lifted = lift.T @ full.P @ lift
    assert np.abs(across @ (reduced.P - lifted) @ across).max() < 1e-10 * np.abs(full.P).max()
    assert np.abs((reduced.K - full.K @ lift)[:2]).max() < 1e-10
    # About b: p = p + q - h^2 p^2 / (h^2 p + r), q and r over lambda.
    h, q, r = 0.5, 1.0 / 0.1, 4.0 / 0.1
    p = (q + np.sqrt(q * q + 4 * q * r / h**2)) / 2
    assert reduced.P[4, 4] == pytest.approx(p)
    assert reduced.K[2] == pytest.approx([0, 0, 0, 0, -h * p / (h * h * p + r)], abs=1e-10)


def test_rolling_the_body_frame_rolls_the_design() -> None:
    """Turn the body's axes about b: inertia and weights turn, c and the costs stay."""
    roll = so3.exp(0.8 * AXIS)

    def design(turn: Array) -> Any:
        J = turn @ INERTIAS['off_diagonal'] @ turn.T
        return terminal_design(configuration(
            inertia_kg_m2=(J + J.T) / 2, target='pointing', rate_weight=np.eye(3), **POINTING))
    plain, rolled = design(np.eye(3)), design(roll)
    E = tangent_basis(AXIS)
    turn = np.block([[E.T @ roll @ E, np.zeros((2, 3))], [np.zeros((3, 2)), roll]])
    assert np.abs(rolled.P - turn @ plain.P @ turn.T).max() < 1e-9 * np.abs(plain.P).max()
    assert np.abs(rolled.K - roll @ plain.K @ turn.T).max() < 1e-9 * np.abs(plain.K).max()
    assert rolled.report.limiting == plain.report.limiting
    assert rolled.c == pytest.approx(plain.c, rel=1e-3)


def test_the_target_chooses_the_problem() -> None:
    for target, shape, euler in (('attitude', (3, 6), 0), ('pointing', (3, 5), 0)):
        config = configuration(target=target, **LIMITS)
        problem, design = problem_of(config), terminal_design(config)
        assert problem.name == target
        assert design.K.shape == shape
        assert problem.states.euler_characteristic == euler
        assert not problem.states.contractible
        assert set(design.report.limits) == {'chart', 'torque', 'step', 'rate', 'decrease'}
        assert design.c > 0
        assert design.report.worst_decrease < 0
