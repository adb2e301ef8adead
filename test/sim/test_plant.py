# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plant keeps the balances of mechanics, its limits, its seed, and a finite state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from manifold_mpc_ros.config.control_law import SimulatorConfig
from manifold_mpc_ros.config.orbit import CircularOrbit
from manifold_mpc_ros.dynamics.lgvi import inertial_momentum, kinetic_energy, lgvi_step
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.sim.plant import GUARD_FRACTION, MAX_SUBSTEPS, Plant

J = np.array([[1.0, 0.05, -0.02], [0.05, 0.9, 0.03], [-0.02, 0.03, 0.6]])
TUMBLING = SimulatorConfig(
    inertia_kg_m2=J, step_s=0.02, initial_attitude_xyzw=(0.3, -0.5, 0.7, 0.4),
    initial_rate_rad_s=(0.4, -0.3, 0.5), state_period_s=0.1)


def momentum(plant: Plant) -> np.ndarray:
    return inertial_momentum(plant.R_NB, plant.omega_BN_B, plant.config.inertia_kg_m2)


def test_starts_at_the_configured_state_and_returns_to_it() -> None:
    plant = Plant(TUMBLING)
    x, y, z, w = TUMBLING.initial_attitude_xyzw
    start = so3.rotation_from_quaternion([w, x, y, z])
    for _ in range(3):
        assert np.array_equal(plant.R_NB, start)
        assert np.array_equal(plant.omega_BN_B, TUMBLING.initial_rate_rad_s)
        assert plant.time_s == 0.0
        assert plant.counters.refused == 0
        plant.step([0.1, 0.2, np.nan])
        assert plant.time_s == TUMBLING.step_s
        assert plant.counters.refused == 1
        plant.reset()


def test_one_step_is_the_symmetric_lgvi_step() -> None:
    plant = Plant(TUMBLING)
    tau_B = np.array([0.2, -0.1, 0.05])
    expected = lgvi_step(plant.R_NB, plant.omega_BN_B, tau_B, inertia_kg_m2=J,
                         step_s=TUMBLING.step_s, forcing='symmetric')
    plant.step(tau_B)
    assert np.array_equal(plant.R_NB, expected[0])
    assert np.array_equal(plant.omega_BN_B, expected[1])
    assert np.array_equal(plant.torque_B_n_m, tau_B)


def test_free_motion_keeps_momentum_and_energy() -> None:
    plant = Plant(TUMBLING)
    before, energy = momentum(plant), kinetic_energy(plant.omega_BN_B, J)
    for _ in range(2000):
        plant.step(np.zeros(3))
    assert np.allclose(momentum(plant), before, rtol=0.0, atol=1e-12)
    assert abs(kinetic_energy(plant.omega_BN_B, J) - energy) < 1e-4 * energy
    assert so3.is_rotation(plant.R_NB, 1e-12)


def test_momentum_balance_under_torque() -> None:
    """Inertial momentum gains the trapezoid of R tau over each step, exactly."""
    plant = Plant(TUMBLING)
    rng = np.random.default_rng(3)
    for _ in range(200):
        tau_B = rng.uniform(-0.5, 0.5, 3)
        before, R_before = momentum(plant), plant.R_NB
        plant.step(tau_B)
        gain = 0.5 * TUMBLING.step_s * (R_before @ tau_B + plant.R_NB @ tau_B)
        assert np.allclose(momentum(plant) - before, gain, rtol=0.0, atol=1e-14)


def test_inertial_disturbance_gains_exactly_its_impulse() -> None:
    d = np.array([0.01, -0.02, 0.03])
    plant = Plant(replace(TUMBLING, disturbance_torque_n_m=d), disturbance_frame='inertial')
    before = momentum(plant)
    for _ in range(500):
        plant.step(np.zeros(3))
    assert np.allclose(momentum(plant) - before, d * plant.time_s, rtol=0.0, atol=1e-12)


def test_body_disturbance_is_a_torque_beyond_the_limits() -> None:
    config = replace(TUMBLING, max_torque_n_m=0.2)
    d = np.array([0.1, 0.0, -0.3])
    disturbed = Plant(replace(config, disturbance_torque_n_m=d))
    pushed = Plant(replace(config, max_torque_n_m=None))
    for _ in range(100):
        disturbed.step([0.5, 0.1, -0.2])
        pushed.step(np.array([0.2, 0.1, -0.2]) + d)
    assert np.array_equal(disturbed.R_NB, pushed.R_NB)
    assert np.array_equal(disturbed.omega_BN_B, pushed.omega_BN_B)
    assert np.array_equal(disturbed.torque_B_n_m, [0.2, 0.1, -0.2])


def test_disturbance_frames_differ_only_once_the_body_has_turned() -> None:
    config = replace(TUMBLING, disturbance_torque_n_m=(0.05, 0.0, 0.0),
                     initial_attitude_xyzw=(0.0, 0.0, 0.0, 1.0))
    body, inertial = Plant(config), Plant(config, disturbance_frame='inertial')
    body.step(np.zeros(3))
    inertial.step(np.zeros(3))
    assert np.allclose(body.omega_BN_B, inertial.omega_BN_B, atol=1e-5)
    for _ in range(200):
        body.step(np.zeros(3))
        inertial.step(np.zeros(3))
    assert not np.allclose(body.omega_BN_B, inertial.omega_BN_B, atol=1e-2)
    with pytest.raises(ConfigurationError, match='disturbance_frame'):
        Plant(config, disturbance_frame='orbit')  # type: ignore[arg-type]


def test_limits_clip_axis_by_axis_and_only_when_exceeded() -> None:
    plant = Plant(replace(TUMBLING, max_torque_n_m=(0.3, 0.2, np.inf)))
    plant.step([0.3, -0.2, 50.0])
    assert plant.counters.saturated == 0
    assert np.array_equal(plant.torque_B_n_m, [0.3, -0.2, 50.0])
    plant.step([1.0, -0.1, -3.0])
    assert plant.counters.saturated == 1
    assert np.array_equal(plant.torque_B_n_m, [0.3, -0.1, -3.0])
    free = Plant(TUMBLING)
    free.step([1.0, -0.4, 2.0])
    assert np.array_equal(free.torque_B_n_m, [1.0, -0.4, 2.0])


def test_noise_follows_the_seed_and_stays_out_of_the_state() -> None:
    noisy = replace(TUMBLING, attitude_noise_std_rad=0.01, rate_noise_std_rad_s=0.02, seed=5)

    def record(config: SimulatorConfig) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        plant = Plant(config)
        seen = []
        for _ in range(400):
            R_measured, omega_measured = plant.measure()
            seen.append(np.hstack([so3.log(plant.R_NB.T @ R_measured),
                                   omega_measured - plant.omega_BN_B]))
            plant.step([0.1, 0.0, 0.0])
        return np.array(seen), plant.R_NB, plant.omega_BN_B

    first, R_noisy, omega_noisy = record(noisy)
    again, _, _ = record(noisy)
    other, _, _ = record(replace(noisy, seed=6))
    silent, R_silent, omega_silent = record(TUMBLING)
    rate_only, _, _ = record(replace(noisy, attitude_noise_std_rad=0.0))
    assert np.array_equal(first, again)
    assert not np.allclose(first, other, atol=1e-3)
    assert np.array_equal(R_noisy, R_silent)
    assert np.array_equal(omega_noisy, omega_silent)
    assert np.allclose(silent[:, :3], 0.0, atol=1e-14)
    assert np.array_equal(silent[:, 3:], np.zeros((400, 3)))
    assert np.array_equal(rate_only[:, 3:], first[:, 3:])
    # The standard error of a standard deviation from 400 samples is 3.5 %.
    assert np.allclose(first.std(axis=0), [0.01] * 3 + [0.02] * 3, rtol=0.15)
    assert np.all(np.abs(first.mean(axis=0)) < 4.0 * np.array([0.01] * 3 + [0.02] * 3) / 20.0)


def test_noise_starts_again_at_a_reset() -> None:
    plant = Plant(replace(TUMBLING, rate_noise_std_rad_s=0.1))
    first = [plant.measure()[1] for _ in range(3)]
    plant.reset()
    assert all(np.array_equal(plant.measure()[1], one) for one in first)


@pytest.mark.parametrize(('part', 'substepped'), [(0.9, False), (1.1, True), (40, True)])
def test_substeps_begin_where_the_guard_would_pass(part: float, substepped: bool) -> None:
    """A fast spin still conserves momentum and energy to the order of the smaller step."""
    smallest = float(np.linalg.eigvalsh(J)[0])
    direction = np.array([0.5, 0.1, 1.0])
    direction /= np.linalg.norm(J @ direction)
    rate = direction * part * GUARD_FRACTION * smallest / TUMBLING.step_s
    plant = Plant(replace(TUMBLING, initial_rate_rad_s=rate))
    before, energy = momentum(plant), kinetic_energy(rate, J)
    for _ in range(20):
        plant.step(np.zeros(3))
    assert (plant.counters.substepped == 20) is substepped
    assert plant.counters.frozen == 0
    assert np.allclose(momentum(plant), before, rtol=1e-12)
    assert abs(kinetic_energy(plant.omega_BN_B, J) / energy - 1.0) < 0.05
    assert so3.is_rotation(plant.R_NB, 1e-12)


def test_substeps_agree_with_a_plant_of_smaller_steps() -> None:
    config = replace(TUMBLING, step_s=0.1, initial_rate_rad_s=(9.0, -2.0, 4.0))
    coarse = Plant(config, disturbance_frame='inertial')
    fine = Plant(replace(config, step_s=0.0005))
    coarse.step([3.0, 2.0, 1.0])
    for _ in range(200):
        fine.step([3.0, 2.0, 1.0])
    assert coarse.counters.substepped == 1
    assert so3.angle(coarse.R_NB.T @ fine.R_NB) < 0.03
    assert np.allclose(coarse.omega_BN_B, fine.omega_BN_B, rtol=0.0, atol=0.1)


def test_beyond_every_substep_the_state_is_kept_and_counted() -> None:
    plant = Plant(replace(TUMBLING, max_torque_n_m=None))
    R_NB, omega = plant.R_NB, plant.omega_BN_B
    plant.step([1e300, 0.0, 0.0])
    assert plant.counters.frozen == 1
    assert np.array_equal(plant.R_NB, R_NB)
    assert np.array_equal(plant.omega_BN_B, omega)
    plant.step(np.zeros(3))
    assert plant.counters.frozen == 1
    assert not np.array_equal(plant.R_NB, R_NB)
    spun = Plant(replace(TUMBLING, initial_rate_rad_s=(0.0, 1e4 * MAX_SUBSTEPS, 0.0)))
    spun.step(np.zeros(3))
    assert spun.counters.frozen == 1


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(*[st.floats(width=64)] * 3), min_size=1, max_size=6),
       st.sampled_from([None, 0.3]), st.sampled_from(['body', 'inertial']))
def test_whatever_is_commanded_the_state_stays_finite(
    commands: list[tuple[float, float, float]], limit: float | None, frame: str,
) -> None:
    plant = Plant(replace(TUMBLING, max_torque_n_m=limit, rate_noise_std_rad_s=0.1,
                          disturbance_torque_n_m=(0.1, 0.0, 0.2)),
                  disturbance_frame=frame)  # type: ignore[arg-type]
    for command in commands:
        plant.step(command)
        seen = plant.measure()
        assert all(np.all(np.isfinite(value)) for value in (
            plant.R_NB, plant.omega_BN_B, plant.torque_B_n_m, *seen))
        assert so3.is_rotation(plant.R_NB, 1e-9)
        if limit is not None:
            assert np.all(np.abs(plant.torque_B_n_m) <= limit)
    refused = sum(not np.all(np.isfinite(command)) for command in commands)
    assert plant.counters.refused == refused


def test_gravity_gradient_keeps_the_jacobi_integral_in_the_second_order() -> None:
    """``T + 3/2 n^2 up . J up - n . H`` in the axes of the orbit, over half a revolution."""
    orbit = CircularOrbit(500e3, 0.8, 0.2, 0.1)
    up_0, up_1 = orbit.position_N_m(0.0), orbit.position_N_m(1000.0)
    n_N = orbit.rate_rad_s * np.cross(up_0, up_1) / np.linalg.norm(np.cross(up_0, up_1))

    def drift(step_s: float) -> float:
        plant = Plant(replace(
            TUMBLING, orbit=orbit, initial_rate_rad_s=1e-3 * np.array([1.0, -2.0, 1.5]),
            step_s=step_s, state_period_s=step_s, control_period_s=step_s))
        values, torques = [], []
        for _ in range(round(2800 / step_s)):
            up = plant.R_NB.T @ orbit.position_N_m(plant.time_s) / orbit.radius_m
            values.append(kinetic_energy(plant.omega_BN_B, J) - n_N @ momentum(plant)
                          + 1.5 * orbit.rate_rad_s ** 2 * up @ J @ up)
            torques.append(np.linalg.norm(momentum(plant)))
            plant.step(np.zeros(3))
        assert np.ptp(torques) > 0.05 * max(torques)
        return float(np.ptp(values)) / max(values)

    drifts = [drift(step_s) for step_s in (20.0, 10.0, 5.0)]
    assert drifts[0] < 1e-3
    assert (np.array(drifts[:-1]) / drifts[1:] > 3.5).all()
