# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The Riccati equation with cross term against scipy, its residual, and value iteration."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from linear_cases import linear_problem, linearisation, random_cases
from scipy.linalg import solve_discrete_are

from manifold_mpc_ros.terminal.linearisation import linearise
from manifold_mpc_ros.terminal.manifold import RotationGroup
from manifold_mpc_ros.terminal.riccati import solve_riccati

CASES = random_cases(25)
in_cases = pytest.mark.parametrize('index', range(len(CASES)))


@in_cases
def test_the_matrices_of_a_linear_problem_come_back(index: int) -> None:
    """A and B as they are, and the Hessian of L / lambda: lambda = 0.5 doubles it."""
    A, B, H = CASES[index]
    linear = linearise(linear_problem(A, B, H))
    assert np.abs(linear.A - A).max() < 1e-15 * 10
    assert np.abs(linear.B - B).max() < 1e-15 * 10
    assert np.abs(linear.hessian() - 2 * H).max() < 1e-14 * np.abs(H).max()
    assert np.abs(linear.N).max() > 0.01


@in_cases
def test_the_solution_with_a_cross_term(index: int) -> None:
    """The equation as the paper means it, scipy's solution, and the fixed point of Bellman."""
    A, B, H = CASES[index]
    n = len(A)
    Q, R, N = H[:n, :n], H[n:, n:], H[:n, n:]
    found = solve_riccati(linearisation(A, B, H))
    P, K, size = found.P, found.K, np.abs(found.P).max()
    cross = A.T @ P @ B + N
    right = A.T @ P @ A + Q - cross @ np.linalg.inv(B.T @ P @ B + R) @ cross.T
    assert np.abs(right - P).max() < 1e-9 * size
    assert found.residual < 1e-9
    assert np.abs(P - solve_discrete_are(A, B, Q, R, s=N)).max() < 1e-9 * size
    assert np.abs(K + np.linalg.inv(B.T @ P @ B + R) @ cross.T).max() < 1e-9 * np.abs(K).max()
    iterated, gain = np.zeros_like(P), np.zeros_like(K)
    for _ in range(20000):
        before = iterated
        inner, across = B.T @ iterated @ B + R, A.T @ iterated @ B + N
        gain = -np.linalg.solve(inner, across.T)
        iterated = A.T @ iterated @ A + Q + across @ gain
        iterated = (iterated + iterated.T) / 2  # what is not symmetric would grow
        if np.abs(iterated - before).max() < 1e-14 * size:
            break
    assert np.abs(P - iterated).max() < 1e-8 * size
    assert np.abs(K - gain).max() < 1e-8 * np.abs(gain).max()


@in_cases
def test_the_local_law_pays_what_the_cost_says(index: int) -> None:
    """x^T P x / 2 is the sum of the stage costs under eta = K x, and A + B K is stable."""
    A, B, H = CASES[index]
    found = solve_riccati(linearisation(A, B, H))
    closed = A + B @ found.K
    assert found.closed_loop_radius == pytest.approx(np.abs(np.linalg.eigvals(closed)).max())
    assert found.closed_loop_radius < 1
    law = np.vstack([np.eye(len(A)), found.K])
    total, power = np.zeros_like(found.P), np.eye(len(A))
    for _ in range(4000):
        total += power.T @ law.T @ H @ law @ power
        power = closed @ power
        if np.abs(power).max() < 1e-10:
            break
    assert np.abs(total - found.P).max() < 1e-8 * np.abs(found.P).max()


def test_the_cross_term_matters() -> None:
    """Dropping N changes P, K and the loop: the agreement above is not by chance."""
    A, B, H = CASES[3]
    n = len(A)
    without = H.copy()
    without[:n, n:] = without[n:, :n] = 0.0
    full, bare = solve_riccati(linearisation(A, B, H)), solve_riccati(linearisation(A, B, without))
    assert np.abs(full.P - bare.P).max() > 0.01 * np.abs(full.P).max()
    assert np.abs(full.K - bare.K).max() > 0.01 * np.abs(full.K).max()


def test_units_balance_the_numerics_and_change_nothing() -> None:
    """The same system in units of 1e-6 and 1e5: the same P, K, condition figures."""
    A, B, H = CASES[5]
    n, m = B.shape
    x, u = np.geomspace(1e-6, 1e5, n), np.full(m, 1e4)
    scaled = np.diag(np.concatenate([1 / x, 1 / u]))
    other = linear_problem(A * x[:, None] / x, B * x[:, None] / u, scaled @ H @ scaled,
                           state_units=x, control_units=u)
    plain = solve_riccati(linearise(linear_problem(A, B, H)))
    found = solve_riccati(linearise(other))
    assert np.abs(found.P * np.outer(x, x) - plain.P).max() < 1e-9 * np.abs(plain.P).max()
    assert np.abs(found.K * x / u[:, None] - plain.K).max() < 1e-9 * np.abs(plain.K).max()
    for name in ('reachability', 'pencil_distance', 'hessian_definiteness', 'P_definiteness'):
        assert getattr(found.existence, name) == pytest.approx(
            getattr(plain.existence, name), rel=1e-6)


def test_a_cross_term_on_a_manifold() -> None:
    """A kinematic body whose cost couples turn and rate: Q, N, R by hand, on SO(3).

    g+ = g exp(hat(h u)) with L = |Log g + s u|^2 / 2 + r |u|^2 / 2: A = I, B = h I, Q = I,
    N = s I, R = (s^2 + r) I, and one scalar Riccati equation for every axis.
    """
    h, s, r = 0.5, -0.4, 0.3
    manifold = RotationGroup()
    problem = replace(
        linear_problem(np.eye(3), np.eye(3), np.eye(6)), states=manifold,
        step=lambda x, u: manifold.retract(x, h * u),
        stage_cost=lambda x, u: ca.sumsqr(manifold.coordinates(x) + s * u) / 2
        + r * ca.sumsqr(u) / 2, terminal_scale=0.8)
    linear = linearise(problem)
    eye = np.eye(3)
    assert np.abs(linear.A - eye).max() < 1e-14
    assert np.abs(linear.B - h * eye).max() < 1e-14
    assert np.abs(linear.Q - eye / 0.8).max() < 1e-14
    assert np.abs(linear.N - s * eye / 0.8).max() < 1e-14
    assert np.abs(linear.R - (s * s + r) * eye / 0.8).max() < 1e-14
    # p = p + q - (h p + n)^2 / (h^2 p + R)
    q, n, big = 1 / 0.8, s / 0.8, (s * s + r) / 0.8
    p = max(np.roots([h * h, 2 * h * n - q * h * h, n * n - q * big]).real)
    found = solve_riccati(linear)
    assert np.abs(found.P - p * eye).max() < 1e-12
    assert np.abs(found.K + (h * p + n) / (h * h * p + big) * eye).max() < 1e-12
