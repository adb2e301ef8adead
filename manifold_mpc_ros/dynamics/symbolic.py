# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CasADi form of the LGVI step and its derivative, for prediction inside the optimiser.

The implicit equation is the copy in :mod:`.scalar_form`; here it is used on the unit quaternion
and differentiated by the implicit function theorem, never through the Newton iterations.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from manifold_mpc_ros.dynamics import scalar_form
from manifold_mpc_ros.dynamics.scalar_form import Matrix, Vector
from manifold_mpc_ros.lie.symbolic import (
    cayley_quaternion,
    hat,
    quaternion_product,
    rotation_from_quaternion,
)

# From the start c = J^-1 m / 2 this many Newton steps reach rounding up to 0.99 of the existence
# guard; closer to it the residual tells (test_symbolic.py measures both).
NEWTON_STEPS = 6


class Step(NamedTuple):
    """One predicted step and, for its derivative, what the linearisation needs."""

    quaternion: ca.SX
    omega: ca.SX
    cayley: ca.SX
    momentum: ca.SX


def solve_3x3(a: ca.SX, b: ca.SX) -> ca.SX:
    """Return ``a^-1 b`` for a (3, 3) and b (3, n) by cross products."""
    c0, c1, c2 = ca.cross(a[:, 1], a[:, 2]), ca.cross(a[:, 2], a[:, 0]), ca.cross(a[:, 0], a[:, 1])
    return ca.horzcat(c0, c1, c2).T @ b / ca.dot(a[:, 0], c0)


def _newton_matrix(c: ca.SX, m: ca.SX, inertia: ca.SX) -> ca.SX:
    """Return E = ``-d residual / d c`` of the implicit equation at (c, m)."""
    return 2 * inertia - hat(m) - ca.dot(c, m) * ca.SX.eye(3) - c @ m.T


def _vector(v: ca.SX) -> Vector:
    """Split a vector for :mod:`.scalar_form`, which the numpy step uses too."""
    return v[0], v[1], v[2]


def _matrix(a: ca.SX) -> Matrix:
    """Split a matrix into its rows, likewise."""
    return _vector(a[0, :]), _vector(a[1, :]), _vector(a[2, :])


def cayley_step(m: ca.SX, inertia: ca.SX, inertia_inverse: ca.SX) -> ca.SX:
    """Map m = h Pi (3,) to the Cayley parameter c of the step rotation.

    Newton on ``m + m x c + (c.m) c - 2 J c = 0`` from ``c = J^-1 m / 2``.
    """
    c = _vector(inertia_inverse @ m / 2)
    for _ in range(NEWTON_STEPS):
        c = scalar_form.add(c, scalar_form.newton_step(c, _vector(m), _matrix(inertia)))
    return ca.vertcat(*c)


def cayley_residual(c: ca.SX, m: ca.SX, inertia: ca.SX) -> ca.SX:
    """Return the infinity norm of the implicit equation's residual at (c, m)."""
    return ca.norm_inf(ca.vertcat(
        *scalar_form.cayley_residual(_vector(c), _vector(m), _matrix(inertia))))


class StepDerivative(NamedTuple):
    """First derivatives of one implicit step by its momentum m = h Pi.

    ``cayley``: dc/dm; ``angle``: the body-frame angle increment of ``f = cay(c)``; ``turned``:
    ``d(f^T m)/dm``; ``rotation``: f itself. All (3, 3).
    """

    rotation: ca.SX
    cayley: ca.SX
    angle: ca.SX
    turned: ca.SX


def step_derivative(c: ca.SX, m: ca.SX, inertia: ca.SX) -> StepDerivative:
    """Return the derivatives at (c, m), by the implicit function theorem.

    ``dc/dm = E^-1 (I - hat c + c c^T)`` and ``angle = 2/(1+|c|^2) (I - hat c) dc/dm``.
    """
    eye = ca.SX.eye(3)
    f = rotation_from_quaternion(cayley_quaternion(c))
    dc_dm = solve_3x3(_newton_matrix(c, m, inertia), eye - hat(c) + c @ c.T)
    angle = 2 / (1 + ca.dot(c, c)) * (eye - hat(c)) @ dc_dm
    return StepDerivative(f, dc_dm, angle, f.T + hat(f.T @ m) @ angle)


def legendre_hessian(c: ca.SX, multiplier: ca.SX, inertia: ca.SX, sign: int) -> ca.SX:
    """Return the Hessian in c of ``multiplier . 2 (J c + sign c x J c) / (1 + |c|^2)``.

    ``sign = 1`` is the momentum m of a step, ``sign = -1`` the momentum ``f^T m`` after it.
    """
    skew = hat(multiplier)
    quadratic = sign * (inertia @ skew - skew @ inertia)
    linear = inertia @ multiplier
    value = ca.dot(linear, c) + ca.dot(c, quadratic @ c) / 2
    return rational_hessian(c, value, linear + quadratic @ c, quadratic)


def rational_hessian(c: ca.SX, value: ca.SX, gradient: ca.SX, hessian: ca.SX) -> ca.SX:
    """Return the Hessian in c of ``2 v(c) / (1 + |c|^2)`` from v, v' and v''."""
    w = 1 / (1 + ca.dot(c, c))
    outer = gradient @ c.T
    curved = -2 * w * w * value * ca.SX.eye(3) + 8 * w ** 3 * value * (c @ c.T)
    return 2 * (w * hessian - 2 * w * w * (outer + outer.T) + curved)


def lgvi_step(q: ca.SX, omega: ca.SX, torque: ca.SX, inertia: ca.SX, inertia_inverse: ca.SX,
              h: ca.SX, symmetric: bool, cayley: ca.SX | None = None) -> Step:
    """Map (q of R_NB, omega_BN_B, tau_B) over one step h, with either forcing.

    ``cayley`` is the solution of the implicit equation where the caller already has it.
    """
    impulse = h * h * torque
    half = impulse / 2 if symmetric else ca.SX.zeros(3)
    m = h * inertia @ omega + half
    c = cayley_step(m, inertia, inertia_inverse) if cayley is None else cayley
    step = cayley_quaternion(c)
    turned = rotation_from_quaternion(step).T @ m
    omega_next = inertia_inverse @ (turned + impulse - half) / h
    return Step(quaternion_product(q, step), omega_next, c, m)


def lgvi_step_jacobian(d: StepDerivative, inertia: ca.SX, inertia_inverse: ca.SX, h: ca.SX,
                       symmetric: bool) -> tuple[ca.SX, ca.SX]:
    """Return A (6, 6) and B (6, 3) of the step in tangent coordinates (d theta_B, d omega_B)."""
    a = ca.vertcat(
        ca.horzcat(d.rotation.T, h * d.angle @ inertia),
        ca.horzcat(ca.SX.zeros(3, 3), inertia_inverse @ d.turned @ inertia))
    if not symmetric:
        return a, ca.vertcat(ca.SX.zeros(3, 3), h * inertia_inverse)
    b = ca.vertcat(h * h / 2 * d.angle, h / 2 * inertia_inverse @ (d.turned + ca.SX.eye(3)))
    return a, b
