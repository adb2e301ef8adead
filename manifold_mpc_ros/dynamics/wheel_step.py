# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The symmetric LGVI step of a body with reaction wheels, which keeps the total momentum.

With b = W h_w the momentum of the wheels in body axes, Pi that of the body, tau an external and
W u the motor torque, all over a step h, the turn f = cay(c) solves (docs/theory.md (26))

    t + t x c + (c . t) c - (1 + |c|^2) b' = 2/h J c,   t = Pi + b + h/2 tau,   b' = b + h/2 W u

and then ``Pi+ + b+ = f^T (Pi + b + h/2 tau) + h/2 tau``, ``b+ = b + h W u``.
"""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.dynamics import scalar_form as form
from manifold_mpc_ros.dynamics.lgvi import NEWTON_ITERATIONS, NEWTON_TOLERANCE
from manifold_mpc_ros.dynamics.scalar_form import Matrix, Vector
from manifold_mpc_ros.errors import StepExistenceError
from manifold_mpc_ros.lie.arrays import Array


def wheel_step(
    R_NB: Array, omega_BN_B: Array, stored_B: Array, motor_B: Array,
    external_B: Array, *, inertia_kg_m2: Array, step_s: float,
) -> tuple[Array, Array]:
    """Advance attitude (3, 3) and body rate (3,) [rad/s] of a body whose wheels change momentum.

    ``stored_B`` is W h_w (3,) [N m s] at the begin, ``motor_B`` W u (3,) [N m] and ``external_B``
    tau (3,) [N m], both constant over the step; the wheels' momenta are the caller's to add up.
    Order 2, and the inertial momentum of body and wheels to rounding (test_wheel_step.py).

    Raises StepExistenceError where ``h (|Pi| + |b| + ...)`` reaches the smallest inertia.
    """
    J: Matrix = tuple(map(tuple, inertia_kg_m2.tolist()))  # type: ignore[assignment]
    omega, stored, motor, external = (
        tuple(each.tolist()) for each in (omega_BN_B, stored_B, motor_B, external_B))
    total = form.add(form.add(form.apply(J, omega), stored), external, step_s / 2)
    middle = form.add(stored, motor, step_s / 2)
    increment = form.rotation_increment(_turn(
        form.add((0.0, 0.0, 0.0), total, step_s), form.add((0.0, 0.0, 0.0), middle, step_s), J))
    change = form.add(form.add(
        form.apply_transposed(increment, total), external, step_s), motor, -step_s)
    rows: Matrix = tuple(map(tuple, R_NB.tolist()))  # type: ignore[assignment]
    turned = form.renormalised(form.add_increment(rows, increment))
    return np.array(turned), np.array(form.add(omega, form.solve(J, change)))


def _turn(t: Vector, b: Vector, J: Matrix) -> Vector:
    """Return the c of h t and h b' by Newton's method from 0.

    There the equation is that of a body alone of momentum ``t - b' - c x b'``, below
    ``|t - b'| + |b'|``, which has to be below the smallest inertia.
    """
    body = form.add(t, b, -1.0)
    size = form.dot(body, body) ** 0.5 + form.dot(b, b) ** 0.5
    if not form.within_guard((size, 0.0, 0.0), J):
        raise StepExistenceError(
            f'the step of a body with wheels is not guaranteed to exist: h times its momenta is '
            f'{size:.6g}, which has to be below the smallest principal inertia')
    c: Vector = (0.0, 0.0, 0.0)
    for _ in range(NEWTON_ITERATIONS):
        step = _newton_step(c, t, b, J)
        c = form.add(c, step)
        if sum(map(abs, step)) <= NEWTON_TOLERANCE:
            return c
    raise StepExistenceError(f'no turn of a body with wheels in {NEWTON_ITERATIONS} Newton steps')


def _newton_step(c: Vector, t: Vector, b: Vector, J: Matrix) -> Vector:
    """Return the Newton step of ``cayley_residual(c, t) - (1 + |c|^2) b``."""
    residual = form.add(form.cayley_residual(c, t, J), b, -1.0 - form.dot(c, c))
    body = form.minus_jacobian(c, t, J)
    return form.solve((form.add(body[0], c, 2.0 * b[0]), form.add(body[1], c, 2.0 * b[1]),
                       form.add(body[2], c, 2.0 * b[2])), residual)
