# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""On-times of thrusters: exact, least propellant, minimum pulses, the rest carried on."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.config.thrusters import ThrusterArray
from manifold_mpc_ros.control.devices.thruster_actuator import ThrusterActuator
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.sim.thruster_plant import ThrusterPlant

STEP_S = 0.5
# Two opposite pairs about every axis: twelve thrusters, redundant.
PLACES = np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0]]) * 0.4
PUSHES = np.array([[0, 0, 1], [0, 0, 1], [1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]])
J = np.diag([2.0, 1.5, 1.0])


def array(**changes: Any) -> ThrusterArray:
    """Return twelve thrusters of 0.5 N that pulse for 20 ms at the least."""
    return ThrusterArray(**{
        'positions_B_m': np.vstack([PLACES, PLACES]), 'directions_B': np.vstack([PUSHES, -PUSHES]),
        'force_n': 0.5, 'min_on_time_s': 0.02, **changes})


def test_on_times_make_the_torque_exactly_with_the_least_propellant() -> None:
    """Long enough pulses; the least is that of a linear program of its own."""
    rng, thrusters = np.random.default_rng(1), array(min_on_time_s=1e-6)
    actuator = ThrusterActuator(thrusters, STEP_S)
    for _ in range(20):
        torque = rng.uniform(-0.15, 0.15, 3)
        asked = actuator.limited(torque)
        assert asked is torque
        done = actuator.allocate(asked)
        assert ((done.device >= 0.0) & (done.device <= STEP_S)).all()
        np.testing.assert_allclose(thrusters.matrix @ done.device / STEP_S, torque, atol=1e-6)
        least = linprog(np.ones(12), A_eq=thrusters.matrix, b_eq=STEP_S * torque,
                        bounds=[(0.0, STEP_S)] * 12).fun
        assert done.device.sum() == pytest.approx(least, abs=1e-5)


def test_more_than_there_is_keeps_its_direction() -> None:
    actuator = ThrusterActuator(array(), STEP_S)
    torque = np.array([3.0, -1.0, 2.0])
    limited = actuator.limited(torque)
    assert np.linalg.norm(np.cross(limited, torque)) < 1e-9
    assert actuator.limited(0.999 * limited) is not limited
    assert np.linalg.norm(actuator.limited(1.001 * limited) - limited) < 1e-6
    np.testing.assert_allclose(actuator.limited(torque, 0.5), limited / 2, atol=1e-9)
    done = actuator.allocate(limited)
    np.testing.assert_allclose(done.realised_B_n_m, limited, atol=1e-9)


def test_pulses_are_long_enough_and_what_is_left_is_carried_on() -> None:
    """A torque of a hundredth of a pulse in every step comes as pulses, right on average."""
    thrusters = array()
    actuator = ThrusterActuator(thrusters, STEP_S)
    torque, given = np.array([0.31e-3, -0.12e-3, 0.2e-3]), np.zeros(3)
    for _ in range(400):
        done = actuator.allocate(torque)
        on = done.device[done.device > 0.0]
        assert (on >= 0.02).all()
        given += STEP_S * done.realised_B_n_m
    assert 0 < actuator.pulses < 100
    pulse = 0.02 * 0.5 * 0.4
    assert np.abs(given - 400 * STEP_S * torque).max() <= pulse * (1 + 1e-9)
    flow = 0.5 / (220.0 * 9.80665)
    assert actuator.propellant_kg == pytest.approx(actuator.pulses * 0.02 * flow)
    actuator.rest()
    assert not actuator.allocate(np.zeros(3)).device.any()


def plant(**changes: Any) -> ThrusterPlant:
    """Return a body at rest with the thrusters."""
    config = SimulatorConfig(inertia_kg_m2=J, step_s=0.025, thrusters=array(), **changes)
    assert config.thrusters is not None
    return ThrusterPlant(config, config.thrusters)


def test_the_plant_pulses_for_its_on_times_after_its_delay() -> None:
    body, late = plant(), plant(actuation_delay_s=0.1)
    on = np.zeros(12)
    on[0] = 0.06
    rates = []
    for _ in range(8):
        body.step(on)
        late.step(on)
        rates.append([body.omega_BN_B[0], late.omega_BN_B[0]])
    impulse = 0.5 * 0.4 / J[0, 0]
    np.testing.assert_allclose(np.array(rates)[:, 0], impulse * np.array(
        [0.025, 0.05, 0.06, 0.06, 0.06, 0.06, 0.06, 0.06]), rtol=1e-12)
    np.testing.assert_allclose(np.array(rates)[4:, 1], np.array(rates)[:4, 0], rtol=1e-12)
    assert body.usage['pulses'] == 1
    assert body.usage['propellant_kg'] == pytest.approx(0.06 * 0.5 / (220.0 * 9.80665))
    body.step(on.copy())  # another command, the same on-times
    assert body.usage['pulses'] == 2
    assert body.omega_BN_B[0] > rates[-1][0]


def test_a_thruster_that_is_stuck_off_gives_nothing() -> None:
    off = np.full(12, np.inf)
    off[0] = 0.05
    body, on = plant(thruster_off_from_s=off), np.where(np.arange(12) < 2, 0.1, 0.0)
    for _ in range(4):
        body.step(on)
    assert body.omega_BN_B[0] == pytest.approx(-0.05 * 0.5 * 0.4 / J[0, 0])


def test_one_number_is_for_every_thruster_as_in_a_file() -> None:
    config = SimulatorConfig(inertia_kg_m2=J, thrusters=array(),
                             thruster_off_from_s=[np.inf])  # type: ignore[arg-type]
    np.testing.assert_array_equal(config.thruster_off_from_s, np.full(12, np.inf))
    with pytest.raises(ConfigurationError, match=r'^thruster_off_from_s: '):
        plant(thruster_off_from_s=[1.0, 2.0])


def test_a_thruster_that_failed_is_not_used() -> None:
    for failed in ('thruster_1', 'thruster_8'):  # both of them turn the body about x
        actuator = ThrusterActuator(array(failed=[failed]), STEP_S)
        done = actuator.allocate(np.array([0.1, 0.05, -0.1]))
        assert done.device[int(failed[-1]) - 1] == 0.0
        np.testing.assert_allclose(done.realised_B_n_m, [0.1, 0.05, -0.1], atol=1e-9)


@pytest.mark.parametrize(('changes', 'key'), [
    ({'failed': ['thruster_1', 'thruster_8']}, 'thrusters.positions_B_m'),
    ({'failed': ['thruster_99']}, 'thrusters.failed'),
    ({'force_n': 0.0}, 'thrusters.force_n'),
    ({'min_on_time_s': [1.0, 2.0]}, 'thrusters.min_on_time_s'),
    ({'directions_B': np.zeros((12, 3))}, 'thrusters.directions_B'),
    ({'positions_B_m': np.ones((3, 3))}, 'thrusters.positions_B_m'),
    ({'directions_B': np.vstack([PUSHES, PUSHES]), 'positions_B_m': np.vstack(
        [PLACES[:1]] * 12)}, 'thrusters.positions_B_m'),
    ({'names': ['a', 'a']}, 'thrusters.names'),
])
def test_what_is_no_thruster_is_named(changes: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigurationError, match=f'^{key}: '):
        array(**changes)
