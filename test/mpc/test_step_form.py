# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The step's momenta and their derivatives against automatic differentiation of what they are."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from strategies import INERTIAS, generator, half_turns, unit_vectors

from manifold_mpc_ros.dynamics.lgvi import step_rotation
from manifold_mpc_ros.dynamics.symbolic import solve_3x3
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.lie.symbolic import (
    cayley_quaternion,
    hat,
    quaternion_from_rotation,
    quaternion_product,
    rotation_from_quaternion,
    vee_of_skew_part,
)
from manifold_mpc_ros.mpc.stages import step_derivatives as form

in_inertias = pytest.mark.parametrize('inertia', sorted(INERTIAS))


def steps() -> Array:
    """Return unit quaternions of steps by 1e-9 to 1.2 rad."""
    rng = generator('steps')
    angles = 10.0 ** rng.uniform(-9, 0.08, 12)
    return so3.quaternion_from_rotation(so3.exp(angles[:, None] * unit_vectors(rng, 12)))


def turned(step: Array, beta: ca.SX) -> ca.SX:
    """Return ``cay(beta / 2) step``, exp(beta) step to second order."""
    return quaternion_product(cayley_quaternion(beta / 2), ca.SX(step))


def derivatives(value: ca.SX, beta: ca.SX) -> list[Array]:
    """Return value, first and (for a scalar) second derivative at beta = 0."""
    outputs = [value, ca.jacobian(value, beta)]
    if value.is_scalar():
        outputs.append(ca.hessian(value, beta)[0])
    return [np.array(out) for out in ca.Function('f', [beta], outputs)(np.zeros(3))]


@in_inertias
def test_momenta_solve_the_discrete_equations(inertia: str) -> None:
    """``m+`` is what the step's defining equation says, and ``m- = f^T m+``."""
    J = INERTIAS[inertia]
    J_d = np.trace(J) / 2 * np.eye(3) - J
    for q in steps():
        f = so3.rotation_from_quaternion(q)
        after, before = (np.array(ca.DM(m)).ravel() for m in form.momenta(ca.SX(q), ca.SX(J)))
        size = np.linalg.norm(after)
        bound = 1e-15 * np.abs(J).max() + 1e-13 * size
        assert np.abs(so3.hat(after) - (f @ J_d - J_d @ f.T)).max() <= bound
        assert np.abs(so3.hat(before) - (J_d @ f - f.T @ J_d)).max() <= bound
        rate = np.linalg.solve(J, after)
        if size < 0.5 * np.linalg.eigvalsh(J)[0]:
            assert np.abs(step_rotation(rate, J, 1.0) - f).max() < 1e-12


@in_inertias
def test_momentum_derivatives(inertia: str) -> None:
    J, beta = INERTIAS[inertia], ca.SX.sym('beta', 3)
    for q in steps():
        after, before = form.momenta(turned(q, beta), ca.SX(J))
        f = ca.SX(so3.rotation_from_quaternion(q))
        d_after = form.momentum_derivative(f, ca.SX(J))
        d_before = form.derivative_before(f, d_after, form.momenta(ca.SX(q), ca.SX(J))[0])
        for wanted, got in ((after, d_after), (before, d_before)):
            error = derivatives(wanted, beta)[1] - np.array(ca.DM(got))
            assert np.abs(error).max() < 1e-13 * np.abs(J).max()


@in_inertias
def test_lagrangian_of_a_step(inertia: str) -> None:
    """Gradient and Hessian of ``tr(Q (I - f)) + s+ . m+ - s- . m-`` from one matrix product."""
    rng, beta = generator('lagrangian'), ca.SX.sym('beta', 3)
    J = ca.SX(INERTIAS[inertia])
    for q in steps():
        root, after, before = rng.normal(size=(3, 3)), rng.normal(size=3), rng.normal(size=3)
        weight = root @ root.T
        step = turned(q, beta)
        m_after, m_before = form.momenta(step, J)
        value = (ca.trace(weight @ (ca.SX.eye(3) - rotation_from_quaternion(step)))
                 + ca.dot(after, m_after) - ca.dot(before, m_before))
        s = ca.SX(so3.rotation_from_quaternion(q)) @ (
            weight + form.multiplier_matrix(ca.SX(after), ca.SX(before), J))
        _, gradient, hessian = derivatives(value, beta)
        bound = 1e-12 * max(1.0, np.abs(INERTIAS[inertia]).max())
        assert np.abs(gradient - np.array(ca.DM(vee_of_skew_part(s))).T).max() < bound
        assert np.abs(hessian - np.array(ca.DM(form.left_hessian(s)))).max() < bound


def test_small_algebra() -> None:
    rng = generator('algebra')
    a, b = rng.normal(size=(3, 3)), rng.normal(size=(3, 3))
    spd = b @ b.T
    v = rng.normal(size=3)
    for got, wanted in (
            (form.congruence(ca.SX(a), ca.SX(spd @ a)), a.T @ spd @ a),
            (solve_3x3(ca.SX(a), ca.SX.eye(3)) @ a, np.eye(3)),
            (vee_of_skew_part(hat(ca.SX(v))), 2 * v[:, None])):
        assert np.abs(np.array(ca.DM(got)) - wanted).max() < 1e-12


def test_quaternion_of_a_rotation_is_the_one_of_so3() -> None:
    """Random ones, near the identity, and half turns, whose sign is a rule."""
    rng = generator('quaternions')
    axes = np.vstack([np.eye(3), -np.eye(3), unit_vectors(rng, 20)])
    rotations = [*so3.random_rotations(rng, 50), *so3.exp(1e-9 * axes), *half_turns(axes),
                 *so3.exp((np.pi - 1e-7) * axes), np.eye(3)]
    matrix = ca.SX.sym('R', 3, 3)
    function = ca.Function('q', [matrix], [quaternion_from_rotation(matrix)])
    for R in rotations:
        got = np.array(function(R)).ravel()
        assert np.abs(got - so3.quaternion_from_rotation(R)).max() < 1e-15
