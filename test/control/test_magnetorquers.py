# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dipoles within limits: torque across the field, momentum dumped, a tumble that only loses."""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.config.orbit import CircularOrbit
from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.control.wheels.magnetorquers import desaturating, detumbling, dipole_for
from manifold_mpc_ros.dynamics.lgvi import kinetic_energy
from manifold_mpc_ros.sim.plant import Plant

LIMITS = np.array([0.2, 0.1, 0.3])
J = np.diag([0.05, 0.06, 0.02])


def test_the_least_dipole_gives_the_torque_across_the_field_within_limits() -> None:
    rng = np.random.default_rng(3)
    scaled = 0
    for _ in range(200):
        field, torque = 3e-5 * rng.normal(size=3), 8e-6 * rng.normal(size=3)
        dipole = dipole_for(torque, field, LIMITS)
        across = torque - (torque @ field) * field / (field @ field)
        given = np.cross(dipole, field)
        assert (np.abs(dipole) <= LIMITS * (1 + 1e-12)).all()
        assert abs(dipole @ field) < 1e-18
        part = given @ across / (across @ across)
        np.testing.assert_allclose(given, part * across, atol=1e-18)
        scaled += part < 0.999
        assert part <= 1.0 + 1e-12
    assert 20 < scaled < 180
    assert not dipole_for(np.ones(3), np.zeros(3), LIMITS).any()


def test_desaturation_never_adds_momentum_and_detumbling_never_energy() -> None:
    rng = np.random.default_rng(4)
    for _ in range(200):
        field, vector = 3e-5 * rng.normal(size=3), rng.normal(size=3)
        stored = 1e-2 * vector
        assert np.cross(desaturating(stored, 60.0, field, LIMITS), field) @ stored < 0.0
        assert np.cross(detumbling(vector, 1e-3, field, LIMITS), field) @ vector < 0.0


def test_a_dipole_turns_the_simulated_body_where_there_is_a_field() -> None:
    orbit = CircularOrbit(500e3, 1.7, 0.3, 0.2)
    config = SimulatorConfig(inertia_kg_m2=J, step_s=0.5, state_period_s=0.5, orbit=orbit,
                             initial_rate_rad_s=np.array([0.05, -0.04, 0.06]))
    plant = Plant(config)
    assert 2e-5 < np.linalg.norm(plant.field_B_t) < 6e-5
    energies = [float(kinetic_energy(plant.omega_BN_B, J))]
    for _ in range(600):
        plant.dipole_B_a_m2 = detumbling(plant.omega_BN_B, 1e-3, plant.field_B_t, LIMITS)
        plant.step(np.zeros(3))
        energies.append(float(kinetic_energy(plant.omega_BN_B, J)))
    assert energies[-1] < 0.5 * energies[0]
    assert np.diff(energies).max() < 1e-4 * energies[0]  # gravity gradient alone
    still = Plant(SimulatorConfig(inertia_kg_m2=J))
    still.dipole_B_a_m2 = np.ones(3)
    still.step(np.zeros(3))
    assert not still.omega_BN_B.any()
