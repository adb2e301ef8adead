# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's slips put in on purpose: what each of them breaks, one test a slip.

docs/theory.md lists them with their corrections. lambda = terminal_scale; ``decrease`` is the
matrix of paper (8c) to second order, ``(A + B K)^T P (A + B K) - P + lambda (Q + K^T R K)``, which
has to be negative definite for a terminal set to exist.
"""

from __future__ import annotations

from functools import partial

import casadi as ca
import numpy as np
import pytest
from cases import configuration
from flint import arb
from linear_cases import linear_problem, linearisation
from scipy.linalg import solve_discrete_are

from manifold_mpc_ros.dynamics.inertia import nonstandard_inertia
from manifold_mpc_ros.dynamics.lgvi import cayley_step
from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.lab.certification.certify import prove
from manifold_mpc_ros.lab.certification.enclosure import Loop, MeanValueForms, exact
from manifold_mpc_ros.lab.certification.jets import Jet
from manifold_mpc_ros.lab.reference.riccati_route import riccati_step
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.existence import check_existence
from manifold_mpc_ros.terminal.level import largest_level
from manifold_mpc_ros.terminal.linearisation import Linearisation, linearise
from manifold_mpc_ros.terminal.problem_of import attitude_problem
from manifold_mpc_ros.terminal.riccati import solve_riccati


def decrease(linear: Linearisation, scale: float, P: Array, K: Array) -> Array:
    """Return the eigenvalues of paper (8c) to second order, in ascending order."""
    closed = linear.A + linear.B @ K
    cost = linear.Q + linear.N @ K + (linear.N @ K).T + K.T @ linear.R @ K
    return np.linalg.eigvalsh(closed.T @ P @ closed - P + scale * cost)


def radius(linear: Linearisation, K: Array) -> float:
    """Return the spectral radius of A + B K."""
    return float(np.abs(np.linalg.eigvals(linear.A + linear.B @ K)).max())


class LinearLoop:
    """The enclosed loop ``xi+ = (A + B K) xi`` without limits; L is quadratic, lambda = 1/2."""

    control_limits = control_facets = None

    def __init__(self, linear: Linearisation, K: Array) -> None:
        self.dimension = len(linear.A)
        self.chart_radii = ((self.dimension, arb.pos_inf()),)
        self.cone_radii: dict[str, arb] = {}
        self._loop = exact(linear.A + linear.B @ K)
        self.weight = exact(0.5 * (linear.Q + K.T @ linear.R @ K))

    def check_cost(self) -> str | None:
        return None

    def advance(self, xi: list[Jet], forms: MeanValueForms) -> Loop:  # noqa: ARG002
        rows = range(self.dimension)
        return Loop([sum((self._loop[i, j] * xi[j] for j in rows[1:]), self._loop[i, 0] * xi[0])
                     for i in rows], {})


def printed_riccati(A: Array, B: Array, Q: Array, R: Array) -> tuple[Array, Array]:
    """Return the fixed point P of the printed equation, ``(B P B^T + R)^-1``, and its law."""
    P = Q
    for _ in range(2000):
        P = A.T @ P @ A + Q - (A.T @ P @ B) @ np.linalg.inv(B @ P @ B.T + R) @ (A.T @ P @ B).T
    return P, -np.linalg.inv(B @ P @ B.T + R) @ (A.T @ P @ B).T


def test_the_printed_riccati_equation() -> None:
    """``(B P B^T + R)^-1`` for ``(B^T P B + R)^-1``.

    On SO(3) it cannot be formed. Where it can, with as many inputs as states, it has a positive
    definite solution whose law destabilises a stable system.
    """
    linear = linearise(attitude_problem(configuration()))
    P = solve_riccati(linear).P
    with pytest.raises(ValueError, match='matmul'):
        linear.B @ P @ linear.B.T
    assert (linear.B.T @ P @ linear.B + linear.R).shape == (3, 3)

    problem = linear_problem(np.array([[0.4, -0.6], [0.2, 0.5]]),
                             np.array([[1.0, 2.0], [4.0, 1.0]]), np.eye(4))
    square = linearise(problem)
    P, K = printed_riccati(square.A, square.B, square.Q, square.R)
    cross = square.A.T @ P @ square.B
    printed = np.linalg.inv(square.B @ P @ square.B.T + square.R)
    residual = square.A.T @ P @ square.A - P + square.Q - cross @ printed @ cross.T
    assert np.abs(residual).max() < 1e-12
    assert np.linalg.eigvalsh(P)[0] > 0
    assert np.abs(np.linalg.eigvals(square.A)).max() < 0.6
    assert radius(square, K) > 1.5
    assert decrease(square, 0.5, P, K)[-1] > 1.0
    right = solve_riccati(square)
    assert radius(square, right.K) < 0.6
    assert decrease(square, 0.5, right.P, right.K)[-1] < 0.0
    with pytest.raises(DesignError, match="condition 'decrease' near the equilibrium"):
        largest_level(problem, P, K)
    assert largest_level(problem, right.P, right.K).level > 0
    proof = prove(partial(LinearLoop, square, K), (P + P.T) / 2, K, 1.0, smaller=False)
    assert not proof.complete
    assert proof.reason.startswith('decrease at the equilibrium')
    assert prove(partial(LinearLoop, square, right.K), (right.P + right.P.T) / 2, right.K,
                 1.0, smaller=False).complete


@pytest.mark.parametrize(('moments', 'outcome'), [
    ((3.0, 2.7, 2.0), 'no decrease'), ((0.3, 0.25, 0.2), 'unstable'), ((1.0, 0.9, 0.6), 'passes'),
])
@pytest.mark.parametrize('forcing', ['paper', 'symmetric'])
def test_the_printed_input_matrix(moments: tuple[float, ...], outcome: str, forcing: str) -> None:
    """``B = [0; h I]`` for ``[0; h J^-1]``: right for J = I only.

    A heavy body does not brake enough and (8c) fails, a light one is driven unstable. For
    moments near 1 the design happens to pass, as its feedback is robust enough, with another
    P, K and c than the right ones.
    """
    config = configuration(inertia_kg_m2=moments, forcing=forcing, max_torque_n_m=0.05)
    problem = attitude_problem(config)
    linear = linearise(problem)
    right = solve_riccati(linear)
    printed = np.vstack([np.zeros((3, 3)), config.step_s * np.eye(3)])
    P = solve_discrete_are(linear.A, printed, linear.Q, linear.R)
    K = -np.linalg.solve(printed.T @ P @ printed + linear.R, printed.T @ P @ linear.A)
    assert np.abs(P - right.P).max() > 0.05 * np.abs(P).max()
    worst = decrease(linear, config.terminal_scale, P, K)[-1]
    assert decrease(linear, config.terminal_scale, right.P, right.K)[-1] < 0.0
    assert (worst > 0) == (outcome != 'passes')
    assert (radius(linear, K) > 1.5) == (outcome == 'unstable')
    if outcome == 'passes':
        assert radius(linear, K) < 1
        return
    with pytest.raises(DesignError, match="condition 'decrease' near the equilibrium"):
        largest_level(problem, P, K)


def test_the_printed_input_matrix_is_right_for_the_unit_inertia() -> None:
    linear = linearise(attitude_problem(configuration(inertia_kg_m2=np.eye(3))))
    assert np.abs(linear.B - np.vstack([np.zeros((3, 3)), 0.5 * np.eye(3)])).max() < 1e-15


def test_the_missing_half_in_the_expansion_of_the_cost() -> None:
    """``L' = z^T Hess z`` for ``z^T Hess z / 2``: Hess is twice the matrix of the form.

    Either both L' and F have the half or neither, and then the proof's
    ``F'(xi+) - F'(xi) + L' = o(|xi|^2)`` holds. With the matrix of the form, Hess / 2, in the
    Riccati equation and ``F = xi^T P xi / 2`` the terminal cost is half of what is needed:
    (8c) fails as soon as lambda > 1/2. With Hess and the printed ``F' = xi^T P xi`` it is twice.
    """
    config = configuration(terminal_scale=0.8)
    problem = attitude_problem(config)
    linear = linearise(problem)
    hessian = np.block([[linear.Q, linear.N], [linear.N.T, linear.R]])
    z = ca.SX.sym('z', 9)
    cost = ca.Function('cost', [z], [problem.stage_cost(
        problem.states.point(z[:6]), z[6:]) / config.terminal_scale])
    direction = np.linspace(-1.0, 1.0, 9)
    form = direction @ hessian @ direction
    for size in (1e-2, 1e-3, 1e-4):
        assert float(cost(size * direction)) / size ** 2 == pytest.approx(form / 2, rel=size ** 2)

    right = solve_riccati(linear)
    law = np.vstack([np.eye(6), right.K])
    closed = linear.A + linear.B @ right.K
    change, paid = closed.T @ right.P @ closed - right.P, law.T @ hessian @ law
    assert np.abs(change / 2 + paid / 2).max() < 1e-12 * np.abs(paid).max()  # F = xi^T P xi / 2
    assert np.abs(change + paid / 2).max() > 0.1 * np.abs(paid).max()  # printed F', true L'

    halved = solve_riccati(linearisation(linear.A, linear.B, hessian / 2))
    assert np.abs(halved.K - right.K).max() < 1e-12
    assert np.abs(halved.P - right.P / 2).max() < 1e-12 * np.abs(right.P).max()
    assert decrease(linear, 0.8, right.P, right.K)[-1] < 0
    assert decrease(linear, 0.8, halved.P, halved.K)[0] > 0
    with pytest.raises(DesignError, match="condition 'decrease' near the equilibrium"):
        largest_level(problem, halved.P, halved.K)


def test_the_existence_condition_that_is_not_necessary() -> None:
    """"Solvable if and only if J_d^2 + M^2/4 >= 0": steps exist, by both routes, beyond it."""
    J = np.diag([1.0, 0.9, 0.6])
    J_d = nonstandard_inertia(J)
    beyond = 0
    for size in np.linspace(0.05, 0.59, 28):
        m = np.array([0.0, 0.0, size])
        M = so3.hat(m)
        beyond += bool(np.linalg.eigvalsh(J_d @ J_d + M @ M / 4)[0] < -1e-6)
        for f in (so3.cayley(cayley_step(m, J)), riccati_step(m, J)):
            assert np.abs(f @ J_d - J_d @ f.T - M).max() < 1e-13
            assert so3.angle(f) < np.pi / 2
    assert beyond >= 4


def test_the_weights_with_a_tilde() -> None:
    """The Hessian of ``tr(Q (I - g))`` is ``tr(Q) I - Q`` and not Q; with Qf = J_d it is J."""
    config = configuration(attitude_weight=np.diag([1.0, 2.0, 4.0]))
    linear = linearise(attitude_problem(config))
    scale = config.terminal_scale
    assert np.abs(scale * linear.Q[:3, :3] - np.diag([6.0, 5.0, 3.0])).max() < 1e-13
    assert np.array_equal(config.rate_weight, nonstandard_inertia(config.inertia_kg_m2))
    assert np.abs(scale * linear.Q[3:, 3:] - config.inertia_kg_m2).max() < 1e-14
    assert np.abs(scale * linear.R - 4 * np.eye(3)).max() < 1e-13


def test_the_cost_condition_leaves_no_cross_term() -> None:
    """Paper (3b) asks L(x, u) >= L(x, u_e) for all x: then N = 0, though (Hess) allows for it.

    With N not zero the Hessian being positive definite is what the proof needs, and (8c) still
    holds; but some states are cheaper with an input than without.
    """
    hessian = np.array([[1.0, 0.0, 0.4], [0.0, 1.0, 0.0], [0.4, 0.0, 1.0]])
    linear = linearisation(np.array([[1.0, 0.5], [0.0, 1.0]]), np.array([[0.125], [0.5]]), hessian)
    found = solve_riccati(linear)
    assert decrease(linear, 0.5, found.P, found.K)[-1] < 0
    x = np.array([1.0, 0.0])
    z, at_rest = np.append(x, -0.4), np.append(x, 0.0)
    assert z @ hessian @ z < at_rest @ hessian @ at_rest - 0.1


def test_a_stabilising_solution_that_is_not_positive_definite() -> None:
    """"Positive definite if and only if" stabilisable and no eigenvalue on the circle: P = 0.

    A stable system whose state costs nothing meets both conditions, and the solution is zero.
    """
    linear = linearisation(np.array([[0.5]]), np.array([[1.0]]), np.diag([0.0, 1.0]))
    moduli = np.abs(np.linalg.eigvals(linear.A))  # the pencil's are these and their inverses
    assert moduli.max() < 1
    P = solve_discrete_are(linear.A, linear.B, linear.Q, linear.R)
    assert np.abs(P).max() < 1e-15
    with pytest.raises(DesignError):
        check_existence(linear)
