# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Jacobians of the exponential against their definition, and their coefficients to 50 digits."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal, localcontext

import numpy as np
import pytest
import scipy.linalg
import strategies
from hypothesis import given, settings
from strategies import Array

from manifold_mpc_ros.lie import coefficients, so3

STRATA = sorted(strategies.ROTATION_VECTORS)
EPS = float(np.finfo(np.float64).eps)


def largest(difference: Array) -> float:
    return float(np.max(np.abs(difference)))


def derivative_of_exp(phi: Array) -> Array:
    """Return d exp(phi + d)/d d_j (n, j, 3, 3) at 0, by the complex step: no subtraction."""
    step = 1e-30
    moved = so3.hat(phi)[:, None] + 1j * step * so3.hat(np.eye(3))
    return np.imag(scipy.linalg.expm(moved)) / step


@pytest.mark.parametrize('stratum', STRATA)
def test_jacobians_are_the_derivative_of_exp(stratum: str) -> None:
    """exp(phi + d) = exp(J_l d) exp(phi) = exp(phi) exp(J_r d) to first order in d."""
    phi = strategies.rotation_vectors(stratum)[::3]
    R_T = np.swapaxes(so3.exp(phi), -1, -2)[:, None]
    derivative = derivative_of_exp(phi)
    left = np.swapaxes(so3.vee(derivative @ R_T), -1, -2)
    right = np.swapaxes(so3.vee(R_T @ derivative), -1, -2)
    assert largest(so3.left_jacobian(phi) - left) < 1e-14
    assert largest(so3.right_jacobian(phi) - right) < 1e-14


@pytest.mark.parametrize('stratum', STRATA)
def test_inverse_jacobians_are_inverses(stratum: str) -> None:
    phi = strategies.rotation_vectors(stratum)
    left = so3.left_jacobian(phi) @ so3.left_jacobian_inverse(phi)
    right = so3.right_jacobian_inverse(phi) @ so3.right_jacobian(phi)
    assert largest(left - np.eye(3)) < 6e-15
    assert largest(right - np.eye(3)) < 6e-15


def test_inverse_jacobians_hold_beyond_a_half_turn() -> None:
    rng = strategies.generator('beyond')
    phi = rng.uniform(np.pi, 6.0, size=(500, 1)) * strategies.unit_vectors(rng, 500)
    product = so3.left_jacobian(phi) @ so3.left_jacobian_inverse(phi)
    assert largest(product - np.eye(3)) < 1e-13


@settings(derandomize=True, deadline=None, max_examples=200)
@given(strategies.drawn_rotation_vectors())
def test_left_and_right_jacobians_differ_by_the_rotation(phi: Array) -> None:
    left, right = so3.left_jacobian(phi), so3.right_jacobian(phi)
    assert largest(left - so3.exp(phi) @ right) < 6e-15
    assert np.array_equal(right, left.T)
    assert largest(left @ phi - phi) < 6e-15


def sine_and_cosine(x: Decimal) -> tuple[Decimal, Decimal]:
    """Return sin x and cos x from their power series, to the precision of the context."""
    terms = [Decimal(1)]
    while len(terms) < 100:
        terms.append(terms[-1] * x / len(terms))
    return (
        sum((-1) ** k * terms[2 * k + 1] for k in range(50)) + Decimal(0),
        sum((-1) ** k * terms[2 * k] for k in range(50)) + Decimal(0),
    )


def exact_sinc(t: Decimal) -> Decimal:
    return sine_and_cosine(t)[0] / t


def exact_sine_defect(t: Decimal) -> Decimal:
    return (t - sine_and_cosine(t)[0]) / t**3


def exact_cotangent_defect(t: Decimal) -> Decimal:
    sine, cosine = sine_and_cosine(t / 2)
    return (1 - t / 2 * cosine / sine) / t**2


@pytest.mark.parametrize(('function', 'exact', 'tolerance'), [
    (coefficients.sinc, exact_sinc, 4 * EPS),
    (coefficients.sine_defect, exact_sine_defect, 1e-14),
    (coefficients.cotangent_defect, exact_cotangent_defect, 2e-14),
])
def test_coefficients_agree_with_fifty_digits(
    function: Callable[[Array], Array], exact: Callable[[Decimal], Decimal], tolerance: float
) -> None:
    """Relative error, from 1e-12 rad to 1e-12 rad short of pi and on both sides of the switch."""
    switch = coefficients.SERIES_ANGLE
    theta = np.concatenate([
        strategies.OFFSETS_RAD,
        np.linspace(0.01, 3.1, 150),
        switch * (1.0 + np.array([-1e-9, -EPS, 0.0, EPS, 1e-9])),
        np.pi - strategies.OFFSETS_RAD,
    ])
    with localcontext() as context:
        context.prec = 80
        expected = np.array([float(exact(Decimal(float(t)))) for t in theta])
    assert np.max(np.abs(function(theta) / expected - 1.0)) < tolerance


def test_coefficients_at_zero_are_their_limits() -> None:
    zero = np.zeros(1)
    assert coefficients.sinc(zero) == 1.0
    assert coefficients.sine_defect(zero) == 1.0 / 6.0
    assert coefficients.cotangent_defect(zero) == 1.0 / 12.0
    with np.errstate(all='raise'):
        assert np.array_equal(so3.left_jacobian(np.zeros(3)), np.eye(3))
        assert np.array_equal(so3.left_jacobian_inverse(np.zeros(3)), np.eye(3))
