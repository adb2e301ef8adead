# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dipoles within limits: torque across the field, momentum dumped, a tumble that only loses."""

from __future__ import annotations

import numpy as np
import pytest
from wheel_cases import wheels

from manifold_mpc_ros.config.orbit import CircularOrbit
from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.config.wheel_parameters import Magnetorquers
from manifold_mpc_ros.control.actuator import TorqueActuator
from manifold_mpc_ros.control.devices.magnetorquers import (
    DipoleLaw,
    FieldReport,
    OnlyMagnetorquers,
    desaturating,
    detumbling,
    dipole_for,
)
from manifold_mpc_ros.control.input_gate import NANOSECONDS, StateSample
from manifold_mpc_ros.control.output_gate import OutputGate
from manifold_mpc_ros.dynamics.lgvi import kinetic_energy
from manifold_mpc_ros.errors import ConfigurationError
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


def sample(stamp_s: float) -> StateSample:
    """Return a state at rest of this stamp."""
    return StateSample(round(stamp_s * NANOSECONDS), np.eye(3), np.array([0.0, 0.02, 0.0]))


def test_momentum_is_dumped_while_the_error_is_small_and_the_field_is_new() -> None:
    law = DipoleLaw(Magnetorquers(LIMITS, 60.0, max_error_rad=0.01, field_timeout_s=5.0),
                    wheels(), J)
    report = FieldReport(10 * NANOSECONDS, np.array([2e-5, 0.0, -1e-5]))
    momentum = np.array([2e-3, 2e-3, 2e-3, np.nan])
    law.observe(sample(10.0), None)
    assert 'no magnetic field has come' in law.missing
    assert not law.dumping(momentum, 0.0).any()
    law.observe(sample(15.0), report)
    assert law.missing == ''
    dipole = law.dumping(momentum, 0.01)
    stored = wheels().axes_B.T @ np.nan_to_num(momentum)
    assert law.torque(dipole) @ stored < 0.0
    assert not law.dumping(momentum, 0.0101).any()
    assert not law.dumping(momentum, float('nan')).any()
    assert not law.dumping(None, 0.0).any()
    law.observe(sample(15.1), report)
    assert law.missing == 'the magnetic field is 5.1 s old: no dipole'
    assert not law.dumping(momentum, 0.0).any()
    assert not law.braking(np.ones(3)).any()


def test_a_dipole_goes_with_one_torque_and_brakes_where_there_can_be_none() -> None:
    given = Magnetorquers(LIMITS)
    field = FieldReport(NANOSECONDS, np.array([2e-5, 0.0, -1e-5]))
    gate = OutputGate(TorqueActuator(None))
    assert gate.magnetise(sample(1.0), 0.0) is None
    gate.dipoles, gate.field = DipoleLaw(given, wheels(), J), field
    gate.devices = np.full(4, 2e-3)
    torque = gate.magnetise(sample(1.0), 0.0)
    assert torque is not None
    first, second = gate.let_through(np.full(3, 0.1)), gate.let_through(np.full(3, 0.1))
    np.testing.assert_array_equal(first.acting_B_n_m, 0.1 + torque)
    assert not second.dipole_B_a_m2.any()
    gate.magnetise(sample(1.0), 0.0)
    assert not gate.zero().dipole_B_a_m2.any()
    alone = OutputGate(OnlyMagnetorquers(None))
    alone.dipoles, alone.field = DipoleLaw(given, None, J), field
    alone.magnetise(sample(1.0), 1.0)
    command = alone.let_through(np.full(3, 0.1))
    assert not command.torque_B_n_m.any()
    assert command.acting_B_n_m @ sample(1.0).omega_BN_B < 0.0


@pytest.mark.parametrize(('kind', 'dipole', 'built'), [
    ('wheels', [0.0], False), ('wheels', [0.1], True), ('torque', [0.0], False),
    ('magnetorquers', [0.1, 0.0, 0.2], True), ('torque', [0.1], None),
    ('magnetorquers', [0.0], None), ('wheels', [-0.1], None)])
def test_magnetorquers_are_there_where_they_can_act(
    kind: str, dipole: list[float], built: bool | None,
) -> None:
    values = {'actuators.kind': kind, 'magnetorquers.max_dipole_a_m2': dipole,
              'magnetorquers.dump_time_s': 60.0, 'magnetorquers.max_error_rad': 0.01,
              'magnetorquers.braking_gain': 1e-3, 'magnetorquers.field_timeout_s': 5.0}
    if built is not None:
        assert (Magnetorquers.from_parameters(values) is not None) is built
        return
    with pytest.raises(ConfigurationError, match=r'magnetorquers\.max_dipole_a_m2'):
        Magnetorquers.from_parameters(values)
