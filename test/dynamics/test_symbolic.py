# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The CasADi form of the LGVI step against the numpy one."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
import strategies
from strategies import INERTIAS, Array

from manifold_mpc_ros.dynamics import lgvi, symbolic
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.symbolic import rotation_from_quaternion

in_inertias = pytest.mark.parametrize('name', sorted(INERTIAS))
in_forcings = pytest.mark.parametrize('forcing', ['paper', 'symmetric'])
H = 0.2


def dimensionless(name: str) -> Array:
    """Return an inertia in units of its mean moment, as prediction uses it."""
    J = INERTIAS[name]
    return J * 3 / np.trace(J)


def cayley_function(J: Array) -> ca.Function:
    """Return m -> (c, residual)."""
    m, inertia = ca.SX.sym('m', 3), ca.SX(J)
    c = symbolic.cayley_step(m, inertia, ca.SX(np.linalg.inv(J)))
    return ca.Function('cayley', [m], [c, symbolic.cayley_residual(c, m, inertia)])


def momenta(J: Array, fraction: float) -> Array:
    """Return momenta at a fraction of the guard, the principal axes of the body among them."""
    drawn = strategies.momenta(strategies.generator('momenta', fraction), J, fraction, 60)
    moments, principal = np.linalg.eigh(J)
    return np.vstack([drawn, fraction * moments[0] * principal.T])


@in_inertias
@pytest.mark.parametrize('fraction', [0.0, 1e-9, 0.1, 0.5, 0.9, 0.95])
def test_newton_steps_are_enough_below_a_step_of_70_degrees(name: str, fraction: float) -> None:
    J = dimensionless(name)
    function, drawn = cayley_function(J), momenta(J, fraction)
    for m, c in zip(drawn, lgvi.cayley_step(drawn, J), strict=True):
        found, residual = function(m)
        assert np.abs(np.array(found)[:, 0] - c).max() < 3e-15
        assert float(residual) < 1e-14


@in_inertias
def test_the_residual_tells_where_newton_steps_are_not_enough(name: str) -> None:
    """Up to the guard, every error above 1e-6 leaves a residual above 1e-9."""
    J, seen = dimensionless(name), []
    for fraction in (0.98, 0.99, 0.997, 0.999, 0.9999):
        function, drawn = cayley_function(J), momenta(J, fraction)
        for m, c in zip(drawn, lgvi.cayley_step(drawn, J), strict=True):
            found, residual = function(m)
            wrong = np.abs(np.array(found)[:, 0] - c).max() > 1e-6
            assert not wrong or float(residual) > 1e-9
            seen.append(wrong)
    assert any(seen)
    assert not all(seen)


def states(name: str, J: Array, n: int) -> tuple[Array, Array, Array]:
    """Return attitudes, rates and torques (n, ...) that use up to 0.8 of the guard."""
    rng = strategies.generator('states', name)
    bound = np.linalg.eigvalsh(J)[0]
    omega = strategies.rates(rng, n, 0.5 * bound / H) @ np.linalg.inv(J)
    return so3.random_rotations(rng, n), omega, strategies.rates(rng, n, 0.3 * bound / H**2)


def step_function(J: Array, forcing: str) -> tuple[ca.Function, ca.SX, ca.SX]:
    """Return (q, omega, tau) -> (R+, omega+)."""
    q, omega, tau = ca.SX.sym('q', 4), ca.SX.sym('omega', 3), ca.SX.sym('tau', 3)
    inertia, inverse = ca.SX(J), ca.SX(np.linalg.inv(J))
    symmetric = forcing == 'symmetric'
    step = symbolic.lgvi_step(q, omega, tau, inertia, inverse, ca.SX(H), symmetric)
    R = rotation_from_quaternion(step.quaternion)
    return ca.Function('step', [q, omega, tau], [R, step.omega])


@in_inertias
@in_forcings
def test_step_is_the_step_of_the_plant(name: str, forcing: str) -> None:
    J = dimensionless(name)
    attitudes, rates, torques = states(name, J, 40)
    function = step_function(J, forcing)
    R1, omega1 = lgvi.lgvi_step(
        attitudes, rates, torques, inertia_kg_m2=J, step_s=H, forcing=forcing)
    for i, q in enumerate(so3.quaternion_from_rotation(attitudes)):
        R, omega = (np.array(part) for part in function(q, rates[i], torques[i]))
        assert np.abs(R - R1[i]).max() < 4e-15
        assert np.abs(omega[:, 0] - omega1[i]).max() < 1e-14 / H


def test_3x3_solve() -> None:
    rng = strategies.generator('solve')
    a, b = ca.SX.sym('a', 3, 3), ca.SX.sym('b', 3, 2)
    function = ca.Function('solve', [a, b], [symbolic.solve_3x3(a, b)])
    for matrix, right in zip(rng.standard_normal((50, 3, 3)), rng.standard_normal((50, 3, 2))):
        assert np.abs(matrix @ np.array(function(matrix, right)) - right).max() < 1e-11
