# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Order of both forcings against a tight Runge-Kutta solution of Euler's equations."""

from __future__ import annotations

import functools

import numpy as np
import pytest
import strategies
from scipy.integrate import solve_ivp
from strategies import INERTIAS, Array

from manifold_mpc_ros.dynamics import lgvi
from manifold_mpc_ros.lie import so3

DURATION_S = 1.6
STEP_COUNTS = (16, 32, 64, 128)


def torque(time_s: float, J: Array) -> Array:
    """Return a smooth torque in body components, up to 0.5 rad/s^2 for any inertia."""
    phase = np.array([0.3, 1.4, 2.2]) + np.array([1.1, 1.7, 0.6]) * time_s
    return 0.5 * np.linalg.eigvalsh(J)[0] * np.sin(phase)


def initial_state(name: str) -> tuple[Array, Array]:
    rng = strategies.generator('convergence', name)
    return so3.random_rotations(rng, 1)[0], 0.8 * strategies.unit_vectors(rng, 1)[0]


def reference_step(R: Array, omega: Array, tau: Array, J: Array, h: float) -> tuple[Array, Array]:
    """Return R and omega after h seconds of the same constant torque, to 1e-12."""

    def derivative(_: float, x: Array) -> Array:
        rate = x[9:]
        momentum_rate = tau - np.cross(rate, J @ rate)
        R_rate = x[:9].reshape(3, 3) @ so3.hat(rate)
        return np.concatenate([R_rate.ravel(), np.linalg.solve(J, momentum_rate)])

    start = np.concatenate([R.ravel(), omega])
    end = solve_ivp(derivative, (0.0, h), start, method='DOP853', rtol=1e-12, atol=1e-13).y[:, -1]
    return end[:9].reshape(3, 3), end[9:]


@functools.cache
def reference(name: str, steps: int) -> tuple[Array, Array]:
    J, h = INERTIAS[name], DURATION_S / steps
    R, omega = initial_state(name)
    for k in range(steps):
        R, omega = reference_step(R, omega, torque(k * h, J), J, h)
    return R, omega


def errors(name: str, steps: int, forcing: str) -> Array:
    """Return the errors of attitude [rad] and rate [rad/s] at the end, h = DURATION_S / steps."""
    J, h = INERTIAS[name], DURATION_S / steps
    R, omega = initial_state(name)
    for k in range(steps):
        R, omega = lgvi.lgvi_step(
            R, omega, torque(k * h, J), inertia_kg_m2=J, step_s=h, forcing=forcing
        )
    R_reference, omega_reference = reference(name, steps)
    attitude = so3.angle(so3.attitude_error_B(R_reference, so3.project(R)))
    return np.array([attitude, np.linalg.norm(omega - omega_reference)])


@pytest.mark.parametrize('name', ['symmetric', 'oblate', 'asymmetric', 'off_diagonal', 'cubesat'])
@pytest.mark.parametrize(('forcing', 'order'), [('paper', 1), ('symmetric', 2)])
def test_forcing_has_its_order_of_convergence(name: str, forcing: str, order: int) -> None:
    by_steps = np.array([errors(name, steps, forcing) for steps in STEP_COUNTS])
    attitude_order, rate_order = np.log2(by_steps[:-1] / by_steps[1:])[-1]
    assert abs(attitude_order - order) < 0.1
    if name == 'symmetric':
        # No gyroscopic torque: J omega changes by h tau a step, whatever the attitude does.
        assert np.max(by_steps[:, 1]) < 1e-12
    else:
        assert abs(rate_order - order) < 0.1


def test_reference_conserves_momentum_of_a_free_body_to_its_tolerance() -> None:
    J = INERTIAS['off_diagonal']
    R, omega = initial_state('off_diagonal')
    R1, omega1 = reference_step(R, omega, np.zeros(3), J, 1.0)
    before, after = lgvi.inertial_momentum(R, omega, J), lgvi.inertial_momentum(R1, omega1, J)
    assert np.max(np.abs(after - before)) < 1e-11
