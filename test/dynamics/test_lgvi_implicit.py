# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The implicit equation of the step: both solvers, the principal branch, the existence guard."""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from strategies import INERTIAS, Array

from manifold_mpc_ros.dynamics import inertia, lgvi
from manifold_mpc_ros.errors import StepExistenceError
from manifold_mpc_ros.lab.reference.riccati_route import riccati_step
from manifold_mpc_ros.lie import so3

FRACTIONS = (1e-12, 1e-6, 1e-3, 0.1, 0.5, 0.9, 0.99)
in_inertias = pytest.mark.parametrize('name', sorted(INERTIAS))


def transpose(a: Array) -> Array:
    return np.swapaxes(a, -1, -2)


def largest(difference: Array) -> float:
    return float(np.max(np.abs(difference)))


def implicit_residual(f: Array, m: Array, J: Array) -> float:
    """Return max|f J_d - J_d f^T - m^x| relative to J."""
    J_d = inertia.nonstandard_inertia(J)
    return largest(f @ J_d - J_d @ transpose(f) - so3.hat(m)) / largest(J)


def test_nonstandard_inertia_holds_the_second_moments() -> None:
    """J_d is the integral of x x^T over the mass: for point masses, the sum of m x x^T."""
    rng = strategies.generator('points')
    mass, x = rng.uniform(1.0, 2.0, size=20), rng.standard_normal((20, 3))
    second = np.einsum('i,ij,ik->jk', mass, x, x)
    J = np.einsum('i,ijk->jk', mass, so3.hat(x) @ transpose(so3.hat(x)))
    assert largest(inertia.nonstandard_inertia(J) - second) < 1e-13


@in_inertias
@pytest.mark.parametrize('fraction', FRACTIONS)
def test_cayley_step_solves_the_implicit_equation_on_the_principal_branch(
    name: str, fraction: float
) -> None:
    J = INERTIAS[name]
    m = strategies.momenta(strategies.generator(name, fraction), J, fraction, 300)
    c = lgvi.cayley_step(m, J)
    f = so3.cayley(c)
    assert implicit_residual(f, m, J) < 2e-15
    assert np.all(so3.angle(f) <= np.arcsin(fraction) * (1.0 + 1e-12))
    eigenvalues = np.linalg.eigvals(f @ inertia.nonstandard_inertia(J))
    assert np.all(eigenvalues.real > 0.0)


def test_principal_branch_is_not_where_f_J_d_has_a_positive_symmetric_part() -> None:
    """For a body close to flat, sym(f J_d) is indefinite well below 90 degrees; weighted, not."""
    J = np.diag([0.5, 0.55, 1.0])
    J_d = inertia.nonstandard_inertia(J)
    f = so3.exp(0.6 * strategies.axes(strategies.generator('branch'), 300))
    root = np.sqrt(J_d)
    plain, weighted = f @ J_d, root @ f @ root
    assert np.linalg.eigvalsh(plain + transpose(plain)).min() < -1e-3
    assert np.linalg.eigvalsh(weighted + transpose(weighted)).min() > 0.01
    m = so3.vee(plain - transpose(plain))
    inside = np.linalg.norm(m, axis=-1) < 0.99 * np.linalg.eigvalsh(J)[0]
    assert np.count_nonzero(inside) > 100
    assert largest(so3.cayley(lgvi.cayley_step(m[inside], J)) - f[inside]) < 1e-14


@in_inertias
@pytest.mark.parametrize('fraction', FRACTIONS)
def test_legendre_and_cayley_step_are_inverses(name: str, fraction: float) -> None:
    J = INERTIAS[name]
    m = strategies.momenta(strategies.generator(name, fraction), J, fraction, 300)
    c = lgvi.cayley_step(m, J)
    size = fraction * np.linalg.eigvalsh(J)[0]
    assert largest(lgvi.legendre(c, J) - m) < 4e-15 * size * largest(J) / np.linalg.eigvalsh(J)[0]
    again = lgvi.cayley_step(lgvi.legendre(c, J), J)
    assert largest(again - c) < 4e-14 * np.max(np.linalg.norm(c, axis=-1))


@in_inertias
@pytest.mark.parametrize('fraction', FRACTIONS)
def test_both_solvers_of_the_implicit_step_agree(name: str, fraction: float) -> None:
    J = INERTIAS[name]
    m = strategies.momenta(strategies.generator(name, fraction), J, fraction, 100)
    f = riccati_step(m, J)
    assert largest(f - so3.cayley(lgvi.cayley_step(m, J))) < 1e-12
    assert implicit_residual(f, m, J) < 1e-13


def test_both_solvers_agree_for_random_bodies() -> None:
    rng = strategies.generator('agree')
    J = strategies.random_inertias(rng, 1000)
    fraction = rng.uniform(0.0, 0.99, size=(1000, 1))
    m = fraction * np.linalg.eigvalsh(J)[:, :1] * strategies.unit_vectors(rng, 1000)
    assert largest(riccati_step(m, J) - so3.cayley(lgvi.cayley_step(m, J))) < 1e-12


@pytest.mark.parametrize('name', ['asymmetric', 'off_diagonal', 'cubesat'])
def test_riccati_route_goes_beyond_the_printed_condition(name: str) -> None:
    """J_d^2 + M^2/4 may be indefinite: it is sufficient for a solution, not necessary."""
    J = INERTIAS[name]
    J_d = inertia.nonstandard_inertia(J)
    m = strategies.momenta(strategies.generator('printed', name), J, 0.99, 300)
    condition = J_d @ J_d + so3.hat(m) @ so3.hat(m) / 4.0
    beyond = np.linalg.eigvalsh(condition)[..., 0] < 0.0
    assert np.count_nonzero(beyond) > 20
    assert implicit_residual(riccati_step(m[beyond], J), m[beyond], J) < 1e-13


def test_flat_body_has_a_cayley_step_and_no_riccati_step() -> None:
    J = np.diag([0.4, 0.6, 1.0])
    m = 0.9 * 0.4 * strategies.axes(strategies.generator('flat'), 100)
    assert implicit_residual(so3.cayley(lgvi.cayley_step(m, J)), m, J) < 2e-15
    with pytest.raises(StepExistenceError, match='flat body'):
        riccati_step(m[0], J)


@in_inertias
def test_every_momentum_inside_the_guard_has_a_step(name: str) -> None:
    J = INERTIAS[name]
    for fraction in (0.999, 1.0 - 1e-6, 1.0 - 1e-12):
        m = strategies.momenta(strategies.generator('inside', name), J, fraction, 2000)
        assert implicit_residual(so3.cayley(lgvi.cayley_step(m, J)), m, J) < 4e-15


@in_inertias
@pytest.mark.parametrize('solver', ['cayley', 'riccati'])
@pytest.mark.parametrize('fraction', [1.0 + 1e-12, 1.001, 1.58, 50.0, np.inf, np.nan])
def test_every_momentum_outside_the_guard_is_refused(
    name: str, solver: str, fraction: float
) -> None:
    J = INERTIAS[name]
    solve = {'cayley': lgvi.cayley_step, 'riccati': riccati_step}[solver]
    with np.errstate(invalid='ignore'):
        outside = strategies.momenta(strategies.generator('outside'), J, fraction, 5)
    for m in outside:
        with pytest.raises(StepExistenceError, match='1 of 1 steps'):
            solve(m, J)


def test_guard_says_how_many_of_a_batch_failed_and_what_the_bound_is() -> None:
    J = INERTIAS['asymmetric']
    m = np.array([[[0.1, 0.0, 0.0], [0.61, 0.0, 0.0]], [[0.0, 0.0, 0.599], [0.0, 0.7, 0.0]]])
    with pytest.raises(StepExistenceError, match=r'2 of 4 steps.* 0\.7\b.* 0\.6 kg m\^2'):
        lgvi.cayley_step(m, J)
