# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plant with reaction wheels: momentum, motors, bearings, failures."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from wheel_cases import INERTIA, wheels

from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.config.wheel_parameters import WheelMotors
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.sim.wheel_plant import WheelPlant

J_W = 2e-5
FRICTION = {'viscous_friction_n_m_s': 1e-6, 'coulomb_friction_n_m': 1e-5,
            'static_friction_n_m': 3e-5, 'stribeck_speed_rad_s': 2.0}


def plant(step_s: float = 0.05, **motors: Any) -> WheelPlant:
    """Return a turning 6U with four wheels."""
    config = SimulatorConfig(
        inertia_kg_m2=INERTIA, step_s=step_s, initial_rate_rad_s=np.array([0.05, -0.03, 0.08]),
        state_period_s=step_s, control_period_s=step_s,
        wheel_motors=WheelMotors(wheels(), **motors))
    assert config.wheel_motors is not None
    return WheelPlant(config, config.wheel_motors)


def total(body: WheelPlant) -> np.ndarray:
    """Return the inertial momentum of body and wheels (3,)."""
    return body.R_NB @ (INERTIA @ body.omega_BN_B + wheels().matrix @ body.momentum_n_m_s)


def test_total_momentum_is_kept_whatever_motors_bearings_and_failures_do() -> None:
    body = plant(initial_speed_rad_s=[500, -200, 5, 300], dead_from_s=[20, np.inf, np.inf, 60],
                 stuck_from_s=[np.inf, 40, np.inf, np.inf], **FRICTION)
    begin, rng = total(body), np.random.default_rng(1)
    for _ in range(2000):
        body.step(4e-3 * rng.normal(size=4))
    assert np.linalg.norm(total(body) - begin) < 1e-12 * np.linalg.norm(begin)
    assert body.counters.saturated > 100
    assert abs(body.speed_rad_s[1]) < 5e-3  # stuck: it turns with the body, one step later


def test_motors_keep_torque_and_momentum() -> None:
    body, before = plant(), np.zeros(4)
    for _ in range(400):
        before = body.momentum_n_m_s
        body.step(np.array([9.0, -9.0, 0.0, 1e-3]))
        assert (np.abs(body.momentum_n_m_s - before) <= 0.05 * 2e-3 * (1 + 1e-12)).all()
    np.testing.assert_allclose(body.momentum_n_m_s[:2], [2e-2, -2e-2], rtol=1e-12)


def test_friction_slows_stops_and_holds_a_wheel() -> None:
    body = plant(initial_speed_rad_s=[200.0, 200.0, 0.0, 0.0], **FRICTION)
    body.step(np.zeros(4))
    middle = 200.0 - 0.05 * 2.1e-4 / J_W / 2
    expected = (1e-6 * middle + 1e-5) * 0.05
    assert 200.0 * J_W - body.momentum_n_m_s[0] == pytest.approx(expected - J_W * (
        wheels().axes_B @ np.array([0.05, -0.03, 0.08]))[0], rel=1e-2)
    for _ in range(4000):
        body.step(np.zeros(4))
    np.testing.assert_allclose(body.speed_rad_s, 0.0, atol=1e-3)
    held = body.speed_rad_s
    body.step(np.full(4, 2.9e-5))  # below static friction
    np.testing.assert_allclose(body.speed_rad_s, held, atol=1e-3)
    for _ in range(20):
        body.step(np.full(4, 4e-5))  # above
    assert (body.speed_rad_s > 0.1).all()


def test_friction_converges_in_the_second_order() -> None:
    """But for the body's own change of rate in a step, 1e-9 of the momenta here."""
    ends = []
    for steps in (200, 400, 800, 1600):
        body = plant(20.0 / steps, initial_speed_rad_s=[300.0, 250.0, -280.0, 200.0],
                     viscous_friction_n_m_s=2e-7, coulomb_friction_n_m=5e-6)
        for _ in range(steps):
            body.step(np.array([1e-4, -1e-4, 5e-5, 0.0]))
        ends.append(np.append(body.momentum_n_m_s / 2e-2, body.omega_BN_B))
    errors = [np.abs(a - b).max() for a, b in itertools.pairwise(ends)]
    assert (np.log2(np.array(errors[:-1]) / errors[1:]) > 1.8).all()


def test_failures_begin_when_they_should() -> None:
    body = plant(dead_from_s=[1.0, np.inf, np.inf, np.inf])
    for _ in range(20):
        body.step(np.full(4, 1e-3))
    np.testing.assert_allclose(body.momentum_n_m_s - J_W * (
        wheels().axes_B @ np.array([0.05, -0.03, 0.08])), 1e-3, rtol=0.06)
    last = body.momentum_n_m_s
    body.step(np.full(4, 1e-3))
    body.step(np.full(4, 1e-3))
    moved = body.momentum_n_m_s - last
    assert moved[0] <= 5.1e-5
    assert moved[1] == pytest.approx(1e-4)


@pytest.mark.parametrize(('changes', 'key'), [
    ({'coulomb_friction_n_m': -1.0}, 'wheel_motors.coulomb_friction_n_m'),
    ({'dead_from_s': [1.0, 2.0]}, 'wheel_motors.dead_from_s'),
    ({'initial_speed_rad_s': np.inf}, 'wheel_motors.initial_speed_rad_s'),
    ({'wheels': wheels(inertia_kg_m2=None)}, 'wheels.inertia_kg_m2'),
])
def test_what_is_no_motor_is_named(changes: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigurationError, match=f'^{key}: '):
        WheelMotors(**{'wheels': wheels(), **changes})


def test_reported_speeds_have_noise_of_their_own() -> None:
    quiet, noisy = plant(), plant(speed_noise_std_rad_s=[0.0, 0.1, 0.2, 0.4])
    assert quiet.measure_speed().tolist() == quiet.speed_rad_s.tolist()
    errors = np.array([noisy.measure_speed() - noisy.speed_rad_s for _ in range(4000)])
    np.testing.assert_allclose(errors.std(axis=0), [0.0, 0.1, 0.2, 0.4], rtol=0.05)
    assert np.abs(errors.mean(axis=0)).max() < 0.02
    noisy.reset()
    assert (noisy.measure_speed() - noisy.speed_rad_s).tolist() == errors[0].tolist()
