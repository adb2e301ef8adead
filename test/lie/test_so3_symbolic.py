# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The CasADi forms of the SO(3) maps against the numpy ones, and their derivatives."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
import strategies
from strategies import ROTATION_VECTORS, Array

from manifold_mpc_ros.lie import so3, symbolic

in_strata = pytest.mark.parametrize('stratum', sorted(ROTATION_VECTORS))


def evaluate(expression: ca.SX, symbol: ca.SX, values: Array) -> Array:
    """Return an expression (r, c) of a vector at values (n, ...): (n, r, c)."""
    function = ca.Function('f', [symbol], [ca.densify(expression)])
    return np.array([np.array(function(value)) for value in values])


def quaternions(stratum: str) -> tuple[Array, Array]:
    """Return every third rotation vector of a stratum, and its quaternion with w >= 0."""
    phi = strategies.rotation_vectors(stratum)[::3]
    half = np.linalg.norm(phi, axis=1, keepdims=True) / 2
    return phi, np.hstack([np.cos(half), np.sinc(half / np.pi) * phi / 2])


@in_strata
def test_log_of_a_quaternion(stratum: str) -> None:
    """Relative accuracy near zero; length up to pi; q and -q alike."""
    phi, q = quaternions(stratum)
    symbol = ca.SX.sym('q', 4)
    for sign in (1.0, -1.0):
        found = evaluate(symbolic.quaternion_log(symbol), symbol, sign * q)[:, :, 0]
        length = np.linalg.norm(phi, axis=1)
        assert (np.linalg.norm(found - phi, axis=1) <= 2e-15 * np.maximum(length, 1e-3)).all()


def test_log_at_half_a_turn_has_length_pi_on_the_side_of_the_vector_part() -> None:
    axes = strategies.axes(strategies.generator('half turns'), 20)
    symbol = ca.SX.sym('q', 4)
    q = np.hstack([np.zeros((len(axes), 1)), axes])
    found = evaluate(symbolic.quaternion_log(symbol), symbol, q)[:, :, 0]
    assert np.abs(found - np.pi * axes).max() < 1e-15
    identity = evaluate(symbolic.quaternion_log(symbol), symbol, np.array([[1.0, 0, 0, 0]]))
    assert not identity.any()


@in_strata
def test_derivative_of_the_log_is_the_inverse_right_jacobian(stratum: str) -> None:
    """D Log(q exp(d)) / dd at 0, by automatic differentiation, finite in every stratum."""
    phi, q = quaternions(stratum)
    symbol, d = ca.SX.sym('q', 4), ca.SX.sym('d', 3)
    moved = symbolic.quaternion_product(symbol, ca.vertcat(1, d / 2))
    derivative = ca.jacobian(symbolic.quaternion_log(moved), d)
    at_zero = ca.substitute(derivative, d, ca.SX.zeros(3))
    found = evaluate(at_zero, symbol, q)
    assert np.abs(found - so3.right_jacobian_inverse(phi)).max() < 1e-10


@in_strata
def test_inverse_right_jacobian(stratum: str) -> None:
    phi = strategies.rotation_vectors(stratum)[::3]
    symbol = ca.SX.sym('phi', 3)
    found = evaluate(symbolic.right_jacobian_inverse(symbol), symbol, phi)
    assert np.abs(found - so3.right_jacobian_inverse(phi)).max() < 1e-14


def test_inverse_right_jacobian_at_its_switch_and_its_ends() -> None:
    """The series takes over at 1e-2 rad; 0 and pi are inside its domain."""
    axes = strategies.unit_vectors(strategies.generator('switch'), 7)
    phi = np.array([0.0, 1e-200, 1e-2 * (1 - 1e-9), 1e-2, 1e-2 * (1 + 1e-9), 2.0, np.pi])
    symbol = ca.SX.sym('phi', 3)
    found = evaluate(
        symbolic.right_jacobian_inverse(symbol), symbol, phi[:, None] * axes)
    assert np.abs(found - so3.right_jacobian_inverse(phi[:, None] * axes)).max() < 1e-14


def test_rotations_and_products_of_quaternions() -> None:
    rng = strategies.generator('products')
    p, q = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in rng.standard_normal((2, 50, 4)))
    both = ca.SX.sym('both', 8)
    product = symbolic.quaternion_product(both[0:4], both[4:8])
    R_p, R_q = so3.rotation_from_quaternion(p), so3.rotation_from_quaternion(q)
    values = np.hstack([p, q])
    R = evaluate(symbolic.rotation_from_quaternion(product), both, values)
    assert np.abs(R - R_p @ R_q).max() < 4e-15
    twice = evaluate(symbolic.rotation_from_quaternion(-product), both, values)
    assert np.array_equal(R, twice)


def test_cayley_parameters() -> None:
    c = strategies.rates(strategies.generator('cayley'), 50, 1.0)
    symbol = ca.SX.sym('c', 3)
    q = symbolic.cayley_quaternion(symbol)
    R = evaluate(symbolic.rotation_from_quaternion(q), symbol, c)
    assert np.abs(R - so3.cayley(c)).max() < 2e-15


def test_derivatives_of_the_trace_cost() -> None:
    """-tr(Z exp(d^x)) has the gradient vee(Z - Z^T) and the Hessian tr(S) I - S, Z = S + skew."""
    rng = strategies.generator('trace')
    Z, d = rng.standard_normal((3, 3)), ca.SX.sym('d', 3)
    second_order = ca.SX.eye(3) + symbolic.hat(d) + symbolic.hat(d) @ symbolic.hat(d) / 2
    hessian, gradient = ca.hessian(-ca.trace(ca.DM(Z) @ second_order), d)
    at_zero = ca.Function('at_zero', [d], [gradient, hessian])(0)
    assert np.abs(np.array(at_zero[0] - symbolic.vee_of_skew_part(ca.DM(Z)))).max() < 1e-15
    expected = np.array(ca.DM(ca.evalf(symbolic.trace_hessian(ca.SX((Z + Z.T) / 2)))))
    assert np.abs(np.array(at_zero[1]) - expected).max() < 1e-15
