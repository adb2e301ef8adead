# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CasADi form of the LGVI step, for prediction inside the optimiser.

The implicit equation is the copy in :mod:`.scalar_form`; here it is used on the unit quaternion.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from manifold_mpc_ros.dynamics import scalar_form
from manifold_mpc_ros.dynamics.scalar_form import Matrix, Vector
from manifold_mpc_ros.lie.symbolic import (
    cayley_quaternion,
    quaternion_product,
    rotation_from_quaternion,
)

# From the start c = J^-1 m / 2 this many Newton steps reach rounding up to 0.99 of the existence
# guard; closer to it the residual tells (test_symbolic.py measures both).
NEWTON_STEPS = 6


class Step(NamedTuple):
    """Where one step leads."""

    quaternion: ca.SX
    omega: ca.SX


def solve_3x3(a: ca.SX, b: ca.SX) -> ca.SX:
    """Return ``a^-1 b`` for a (3, 3) and b (3, n) by cross products."""
    c0, c1, c2 = ca.cross(a[:, 1], a[:, 2]), ca.cross(a[:, 2], a[:, 0]), ca.cross(a[:, 0], a[:, 1])
    return ca.horzcat(c0, c1, c2).T @ b / ca.dot(a[:, 0], c0)


def _vector(v: ca.SX) -> Vector:
    """Split a vector for :mod:`.scalar_form`, which the numpy step uses too."""
    return v[0], v[1], v[2]


def _matrix(a: ca.SX) -> Matrix:
    """Split a matrix into its rows, likewise."""
    return _vector(a[0, :]), _vector(a[1, :]), _vector(a[2, :])


def cayley_step(m: ca.SX, inertia: ca.SX, inertia_inverse: ca.SX | None = None, *,
                guess: ca.SX | None = None, steps: int = NEWTON_STEPS) -> ca.SX:
    """Map m = h Pi (3,) to the Cayley parameter c of the step rotation.

    Newton on ``m + m x c + (c.m) c - 2 J c = 0`` from ``guess``, else from ``c = J^-1 m / 2``.
    """
    c = _vector(inertia_inverse @ m / 2 if guess is None else guess)
    for _ in range(steps):
        c = scalar_form.add(c, scalar_form.newton_step(c, _vector(m), _matrix(inertia)))
    return ca.vertcat(*c)


def cayley_residual(c: ca.SX, m: ca.SX, inertia: ca.SX) -> ca.SX:
    """Return the infinity norm of the implicit equation's residual at (c, m)."""
    return ca.norm_inf(ca.vertcat(
        *scalar_form.cayley_residual(_vector(c), _vector(m), _matrix(inertia))))


def lgvi_step(q: ca.SX, omega: ca.SX, torque: ca.SX, inertia: ca.SX, inertia_inverse: ca.SX,
              h: ca.SX, symmetric: bool) -> Step:
    """Map (q of R_NB, omega_BN_B, tau_B) over one step h, with either forcing."""
    impulse = h * h * torque
    half = impulse / 2 if symmetric else ca.SX.zeros(3)
    m = h * inertia @ omega + half
    step = cayley_quaternion(cayley_step(m, inertia, inertia_inverse))
    turned = rotation_from_quaternion(step).T @ m
    omega_next = inertia_inverse @ (turned + impulse - half) / h
    return Step(quaternion_product(q, step), omega_next)
