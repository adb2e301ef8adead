# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Thrusters that are off and wheels that are dead are found, by nothing but what is measured."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from wheel_cases import wheels

from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.config.thrusters import ThrusterArray
from manifold_mpc_ros.config.wheel_parameters import WheelMotors
from manifold_mpc_ros.control.devices.device_watch import WheelWatch
from manifold_mpc_ros.control.devices.thruster_actuator import ThrusterActuator
from manifold_mpc_ros.control.devices.wheel_actuator import WheelActuator
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.sim.thruster_plant import ThrusterPlant
from manifold_mpc_ros.sim.wheel_plant import WheelPlant

STEP_S = 0.5
INERTIA = np.diag([2.0, 1.5, 1.0])
PLACES = 0.4 * np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0]])
PUSHES = np.array([[0, 0, 1], [0, 0, 1], [1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]])
#: Twelve thrusters, two for each torque.
TWELVE = ThrusterArray(np.vstack([PLACES, PLACES]), np.vstack([PUSHES, -PUSHES]),
                       0.5)  # type: ignore[arg-type]
#: Six thrusters, one for each torque.
SIX = ThrusterArray(PLACES, PUSHES, 0.5)  # type: ignore[arg-type]


def flown(thrusters: ThrusterArray, off: list[int], seed: int, ticks: int = 60,
          noise_rad_s: float = 0.0, inertia: Array = INERTIA, **plant: Any
          ) -> tuple[ThrusterActuator, list[str]]:
    """Ask for random torques while some thrusters are off from 5 s on; return what was found."""
    rng = np.random.default_rng(seed)
    n = len(thrusters)
    body = ThrusterPlant(SimulatorConfig(
        inertia_kg_m2=INERTIA, step_s=0.05, state_period_s=STEP_S, control_period_s=STEP_S,
        thrusters=thrusters, thruster_off_from_s=np.where(np.isin(range(n), off), 5.0, np.inf),
        **plant), thrusters)
    actuator, words = ThrusterActuator(thrusters, STEP_S, inertia), []
    for _ in range(ticks):
        omega = body.omega_BN_B
        actuator.observe(omega + noise_rad_s * rng.normal(size=3), None)
        words.append(actuator.found)
        torque = 0.2 * rng.normal(size=3) - 0.3 * INERTIA @ omega
        command = actuator.allocate(actuator.limited(torque)).device
        for _ in range(round(STEP_S / body.step_s)):
            body.step(command)
    return actuator, words


@pytest.mark.parametrize('off', [0, 3, 7, 10])
def test_a_thruster_that_sticks_off_is_found_and_not_used(off: int) -> None:
    actuator, words = flown(TWELVE, [off], off, ticks=50, noise_rad_s=1e-4)
    assert not any(words[:10])
    assert words[-1] == f'thruster_{off + 1} gives no torque: not used until ~/reset'
    assert actuator.refusal == ''
    assert actuator.allocate(np.array([0.1, -0.1, 0.1])).device[off] == 0.0
    assert actuator.allocate(np.array([-0.1, 0.1, -0.1])).device[off] == 0.0


def test_one_of_a_kind_is_found_in_few_pulses_and_torque_is_refused_then() -> None:
    actuator, words = flown(SIX, [2], 3)
    first = next(k for k, each in enumerate(words) if each)
    assert 10 < first <= 20
    assert actuator.refusal == 'without thruster_3 thrusters give no torque about some axis'
    torque = actuator.allocate(actuator.limited(np.array([0.1, 0.0, 0.0])))
    assert torque.realised_B_n_m[0] > 0.05


@pytest.mark.parametrize('case', [
    {'noise_rad_s': 2e-3}, {'inertia': 1.3 * INERTIA}, {'inertia': 0.75 * INERTIA},
    {'disturbance_torque_n_m': (0.02, -0.01, 0.015)}])
def test_noise_another_inertia_and_a_disturbance_are_no_failure(case: dict[str, Any]) -> None:
    for seed, thrusters in enumerate((SIX, TWELVE)):
        assert not any(flown(thrusters, [], seed, **case)[1])


def motors(**changes: Any) -> WheelPlant:
    """Return the pyramid's wheels on a body."""
    turning = WheelMotors(wheels(), np.array([300.0, -200.0, 100.0, 250.0]), **changes)
    return WheelPlant(SimulatorConfig(
        inertia_kg_m2=np.diag([0.05, 0.06, 0.02]), step_s=0.05, state_period_s=STEP_S,
        control_period_s=STEP_S, wheel_motors=turning), turning)


@pytest.mark.parametrize(('failure', 'latest'), [('dead_from_s', 14), ('stuck_from_s', 20)])
def test_a_wheel_that_does_not_follow_its_motor_is_used_no_more(
    failure: str, latest: int,
) -> None:
    """Speeds are reported with 1 rad/s of noise, a fiftieth of what a motor gives in a step."""
    plant = motors(**{failure: [np.inf, 5.0, np.inf, np.inf], 'coulomb_friction_n_m': 2e-5,
                      'speed_noise_std_rad_s': 1.0})
    actuator = WheelActuator(wheels(), np.diag([0.05, 0.06, 0.02]), STEP_S)
    found, seen = [], None
    for k in range(30):
        seen = actuator.observe(plant.omega_BN_B, plant.motors.inertia_kg_m2 * (
            plant.measure_speed() + wheels().axes_B @ plant.omega_BN_B))
        found.append(actuator.found)
        torque = 1.5e-3 * np.array([np.sin(0.2 * k), 1.0, np.cos(0.3 * k)]) * (-1.0) ** (k // 8)
        motor = actuator.allocate(actuator.limited(torque)).device
        for _ in range(round(STEP_S / plant.step_s)):
            plant.step(motor)
    assert not any(found[:11])
    assert any(found[11:latest])
    assert found[-1] == 'wheel_2 does not follow its motor: not used until ~/reset'
    assert seen is not None
    assert np.isnan(seen).tolist() == [False, True, False, False]
    assert motor[1] == 0.0


def test_reports_that_are_old_and_motors_with_friction_are_no_failure() -> None:
    rng = np.random.default_rng(2)
    top = np.full(4, 2e-3)
    watch, motor = WheelWatch(top, np.full(4, 2e-2), STEP_S), np.zeros(4)
    for _ in range(2000):
        motor = np.clip(motor + 1e-3 * rng.normal(size=4), -top, top)
        age = rng.uniform() < 0.3  # none of a step has been seen, all of it in the next
        gained = 0.0 * motor if age else STEP_S * (motor - 2e-4 * np.sign(rng.normal(size=4)))
        assert not watch.see(motor, np.zeros(4), gained).any()
