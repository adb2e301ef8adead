# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The step of a body with wheels: momentum, order, and the torque that motors make."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from wheel_cases import INERTIA, wheels

from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.dynamics.wheel_allocation import WheelAllocation
from manifold_mpc_ros.dynamics.wheel_step import wheel_step
from manifold_mpc_ros.errors import StepExistenceError
from manifold_mpc_ros.lie import so3

ARRAY = wheels()
W = ARRAY.matrix
ZERO = np.zeros(3)


class State(NamedTuple):
    R_NB: np.ndarray
    omega_BN_B: np.ndarray
    momentum: np.ndarray


BEGIN = State(so3.exp([0.4, -1.1, 0.6]), np.array([0.05, -0.03, 0.08]),
              np.array([12e-3, -6e-3, 9e-3, 3e-3]))


def advanced(state: State, motor: np.ndarray, step_s: float,
             external_B: np.ndarray = ZERO) -> State:
    """Return the state after a step of motor torques (n,)."""
    R, omega = wheel_step(state.R_NB, state.omega_BN_B, W @ state.momentum, W @ motor, external_B,
                          inertia_kg_m2=INERTIA, step_s=step_s)
    return State(R, omega, state.momentum + step_s * motor)


def total(state: State) -> np.ndarray:
    """Return the inertial momentum of body and wheels (3,)."""
    return state.R_NB @ (INERTIA @ state.omega_BN_B + W @ state.momentum)


def motors(time_s: float) -> np.ndarray:
    """Return smooth motor torques (4,) [N m]."""
    return 2e-3 * np.sin(0.3 * time_s + np.arange(4.0))


@pytest.mark.parametrize('driven', [False, True])
def test_total_momentum_is_kept_to_rounding(driven: bool) -> None:
    """20,000 steps here; a million by ``python benchmarks/wheel_drift.py``."""
    state, size = BEGIN, np.linalg.norm(total(BEGIN))
    for k in range(20_000):
        state = advanced(state, motors(0.1 * k) if driven else np.zeros(4), 0.1)
    assert np.linalg.norm(total(state) - total(BEGIN)) < 1e-12 * size
    assert np.linalg.norm(INERTIA @ (state.omega_BN_B - BEGIN.omega_BN_B)) > 0.01 * size


def test_without_wheels_it_is_the_step_of_the_body() -> None:
    torque = np.array([1e-3, 2e-3, -1e-3])
    mine = wheel_step(*BEGIN[:2], ZERO, ZERO, torque, inertia_kg_m2=INERTIA, step_s=0.5)
    other = lgvi_step(*BEGIN[:2], torque, inertia_kg_m2=INERTIA, step_s=0.5)
    for a, b in zip(mine, other):
        np.testing.assert_allclose(a, b, atol=1e-15)


def runge_kutta(begin: State, until_s: float, external_B: np.ndarray) -> State:
    """Integrate Euler's equation with wheels by an independent method to 1e-12."""
    def slope(t: float, y: np.ndarray) -> np.ndarray:
        R, omega, h = y[:9].reshape(3, 3), y[9:12], y[12:]
        inner = INERTIA @ omega + W @ h
        rate = np.linalg.solve(
            INERTIA, external_B - np.cross(omega, inner) - W @ motors(t))
        return np.concatenate([(R @ so3.hat(omega)).ravel(), rate, motors(t)])

    found = solve_ivp(slope, (0.0, until_s), np.concatenate([np.ravel(part) for part in begin]),
                      method='DOP853', rtol=1e-12, atol=1e-14)
    y = found.y[:, -1]
    return State(y[:9].reshape(3, 3), y[9:12], y[12:])


def test_order_two_against_an_independent_runge_kutta_plant() -> None:
    external, until_s = np.array([2e-4, -1e-4, 3e-4]), 20.0
    exact, errors = runge_kutta(BEGIN, until_s, external), []
    for steps in (80, 160, 320):
        h, state = until_s / steps, BEGIN
        for k in range(steps):
            state = advanced(state, motors((k + 0.5) * h), h, external)
        errors.append(max(np.abs(state.omega_BN_B - exact.omega_BN_B).max(),
                          so3.angle(exact.R_NB.T @ state.R_NB)))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.1)


def test_motor_torques_of_a_body_torque_are_of_second_order_too() -> None:
    """The body with wheels follows the body under the torque that was asked for."""
    errors = []
    for steps in (20, 40, 80):
        h, state, alone = 10.0 / steps, BEGIN, BEGIN[:2]
        for k in range(steps):
            torque = 5e-4 * np.array([np.sin(0.2 * k * h), np.cos(0.1 * k * h), 0.3])
            allocation = WheelAllocation(ARRAY, INERTIA, h, state.omega_BN_B, state.momentum,
                                         torque)
            assert allocation.part() == 1.0
            state = advanced(state, allocation.motor_torques(), h)
            alone = lgvi_step(*alone, torque, inertia_kg_m2=INERTIA, step_s=h)
        errors.append(np.abs(state.omega_BN_B - alone[1]).max())
    assert errors[0] < 1e-3
    assert (np.log2(np.array(errors[:-1]) / errors[1:]) > 1.8).all()


def test_a_step_that_need_not_exist_is_refused() -> None:
    with pytest.raises(StepExistenceError):
        advanced(BEGIN._replace(momentum=np.full(4, 2.0)), np.zeros(4), 1.0)
