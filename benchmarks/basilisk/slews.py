# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Half turns of a 6U in Basilisk by the controller over DDS: torques, wheels, thrusters."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any, NamedTuple

import numpy as np
from body import (
    FRICTION_N_M,
    INERTIA,
    RATE_RAD_S,
    STEP_S,
    TORQUE_N_M,
    WHEELS,
    common,
    hub,
    observer,
    orbit,
    wheel_parameters,
    wheels,
)
from link import BasiliskProcess
from loop import Controller, History, error_rad, fly

from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

HALF_TURN = so3.exp([0.0, 0.0, math.pi])
DURATION_S, STEADY_S = 260.0, 60.0
SETTLED_DEG, SETTLED_DEG_S = 0.1, 0.01
#: The part of the rate limit that plans keep: friction turns round in wheels that pass zero speed,
#: and is estimated a step later.
TIGHTENED = 0.985
#: A point of the traces for so many control periods.
EVERY = 8
#: Twelve thrusters of 10 mN, six places, pulses of 10 ms or longer.
_PUSHES_B = np.repeat(np.eye(3)[[2, 0, 1]], 2, axis=0)
POSITIONS_B_M = np.array([[0, 0.1, 0], [0, -0.1, 0], [0, 0, 0.15], [0, 0, -0.15],
                          [0.1, 0, 0], [-0.1, 0, 0]] * 2)
DIRECTIONS_B = np.vstack([_PUSHES_B, -_PUSHES_B])
FORCE_N, PULSE_S, IMPULSE_S = 0.01, 0.01, 60.0


class Slew(NamedTuple):
    """One run: spacecraft, parameters, topic of the devices, and what counts as settled."""

    spacecraft: dict[str, Any]
    parameters: dict[str, Any]
    topic: str = ''
    settled_deg: float = SETTLED_DEG
    settled_deg_s: float = SETTLED_DEG_S


def slews() -> dict[str, Slew]:
    """Return the runs by name."""
    from_rest, turned = {'R_NB': HALF_TURN}, common()
    estimated = {**turned, **wheel_parameters(), **observer()}
    tightened = {**estimated, 'limits.max_rate_rad_s': [TIGHTENED * RATE_RAD_S] * 3}
    rubbing = hub(**from_rest, wheels=wheels(FRICTION_N_M), **orbit())
    return {
        'ideal torque': Slew(hub(**from_rest, max_torque_n_m=[TORQUE_N_M] * 3), turned),
        'wheels without friction': Slew(
            hub(**from_rest, wheels=wheels(0.0)), {**turned, **wheel_parameters()},
            'wheel_commands'),
        'wheels, not estimated': Slew(
            rubbing, {**turned, **wheel_parameters()}, 'wheel_commands'),
        'wheels, estimated': Slew(rubbing, estimated, 'wheel_commands'),
        'wheels, estimated, away from zero': Slew(
            rubbing, {**estimated, 'actuators.wheels.null_space': 'away_from_zero'},
            'wheel_commands'),
        'wheels, estimated, rate limit tightened': Slew(rubbing, tightened, 'wheel_commands'),
        # A pulse that is rounded to a step of the integration is long by a sixth of it.
        'thrusters': Slew(
            hub(**from_rest, thrusters=thrusters(), **orbit(), step_s=0.001),
            {**turned, **thruster_parameters()}, 'thruster_commands',
            settled_deg=0.5, settled_deg_s=0.06),
    }


def thrusters() -> dict[str, Any]:
    """Return the description of the thrusters."""
    return {'positions_B_m': POSITIONS_B_M.tolist(), 'directions_B': DIRECTIONS_B.tolist(),
            'force_n': FORCE_N, 'min_on_time_s': PULSE_S, 'specific_impulse_s': IMPULSE_S}


def thruster_parameters() -> dict[str, Any]:
    """Return the parameters of the controller for the thrusters."""
    key = 'actuators.thrusters'
    return {'actuators.kind': 'thrusters',
            f'{key}.names': [f'thruster_{i + 1}' for i in range(len(POSITIONS_B_M))],
            f'{key}.positions_B_m': POSITIONS_B_M.ravel().tolist(),
            f'{key}.directions_B': DIRECTIONS_B.ravel().tolist(), f'{key}.force_n': [FORCE_N],
            f'{key}.min_on_time_s': [PULSE_S], f'{key}.specific_impulse_s': [IMPULSE_S]}


def run(slew: Slew) -> dict[str, Any]:
    """Fly one; return its figures."""
    names = WHEELS.names if 'wheels' in slew.spacecraft else ()
    with (BasiliskProcess(slew.spacecraft) as plant,
          Controller(slew.parameters, slew.topic, names) as controller):
        history = fly(controller, plant, round(DURATION_S / STEP_S))
        return summary(slew, history, controller)


def summary(slew: Slew, history: History, controller: Controller) -> dict[str, Any]:
    """Return the figures of a run."""
    states = history.states
    error = np.degrees([error_rad(np.eye(3), each.R_NB) for each in states])
    rate = np.degrees([np.linalg.norm(each.omega_BN_B) for each in states])
    ratio = np.array([each.peak_rate_rad_s.max() for each in states]) / RATE_RAD_S
    late = np.flatnonzero((error >= slew.settled_deg) | (rate >= slew.settled_deg_s))
    steady = round(STEADY_S / STEP_S)
    device = np.array(history.device)
    speed = np.array([each.wheel_speed_rad_s for each in states])
    found = {
        'settled_s': float(late[-1] + 1) * STEP_S if late[-1] + 1 < len(error) else None,
        'largest_rate_over_limit': float(ratio.max()),
        'steady_error_deg': float(error[-steady:].max()),
        'ticks': {' '.join(kind): count for kind, count in sorted(
            Counter(controller.ticks.values()).items())},
        'trace': {'every_s': EVERY * STEP_S, 'error_deg': _digits(error[::EVERY]),
                  'rate_over_limit': _digits(_peaks(ratio))}}
    if speed.shape[1]:
        found['zero_crossings'] = int(np.count_nonzero(np.diff(np.sign(speed), axis=0)))
        found['largest_motor_torque_over_limit'] = float(np.abs(device).max() / 7e-4)
        found['trace']['wheel_rpm'] = [_digits(each) for each in speed[::EVERY].T * 30.0 / np.pi]
    elif device.shape[1]:
        found['pulses'] = int(controller.said['pulses'])
        found['propellant_kg'] = float(controller.said['propellant_kg'])
        found['shortest_pulse_deg_s'] = float(np.degrees(
            PULSE_S * FORCE_N * 0.1 / np.diag(INERTIA).min()))
    return found


def _peaks(values: Array) -> Array:
    """Return the largest of every so many."""
    return np.array([values[k:k + EVERY].max() for k in range(0, len(values), EVERY)])


def _digits(values: Array) -> list[float]:
    """Return numbers with five digits."""
    return [float(f'{value:.5g}') for value in values]
