# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The keys of a scenario file: one table for each group, and the checks that go by them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from manifold_mpc_ros.config import checks
from manifold_mpc_ros.config.guidance import MODES
from manifold_mpc_ros.config.parameter import ParameterSpec, Value
from manifold_mpc_ros.errors import ConfigurationError

TIME_MODES = ('lockstep', 'clock', 'wall')

#: Keys that hold another group or a list of groups: name, whether it is a list, meaning.
GROUPS: dict[str, tuple[bool, str]] = {
    'controller': (False, 'changes to the shipped config/controller.yaml, by ROS parameter name'),
    'simulator': (False, 'changes to the shipped config/simulator.yaml, by ROS parameter name'),
    'guidance': (False, 'changes to the shipped config/guidance.yaml, by ROS parameter name, for '
                        'setpoints that move'),
    'setpoints': (True, 'what is commanded when; without it the initial setpoint stays'),
    'time': (False, 'how simulated time goes'),
    'faults': (False, 'what goes wrong between and around the nodes'),
    'acceptance': (False, 'limits that the run has to keep; what is left out is not judged'),
}
FAULT_GROUPS: dict[str, tuple[bool, str]] = {
    'state_link': (False, 'the way of the state from the simulator to the controller'),
    'command_link': (False, 'the way of the torque from the controller to the simulator'),
    'controller_stops': (True, 'times in which the controller gets no processor'),
}

SCENARIO_KEYS = (
    ParameterSpec('description', 'str', 'a manoeuvre', 'what it is and why, in a sentence or two',
                  required=True),
    ParameterSpec('duration_s', 'float', 30.0,
                  'simulated time from the first state to the last, a multiple of mpc.step_s',
                  unit='s', low=1e-3, high=1e6, required=True),
)
TIME_KEYS = (
    ParameterSpec('mode', 'str', 'lockstep',
                  'lockstep: time waits for each torque, the same bits every run; clock: '
                  'simulated time on /clock, factor times as fast; wall: real time',
                  choices=TIME_MODES),
    ParameterSpec('factor', 'float', 1.0, 'simulated seconds in one of wall clock (mode: clock)',
                  unit='1', low=1e-3, high=1000.0),
)
SETPOINT_KEYS = (
    ParameterSpec('at_s', 'float', 0.0, 'time from the first state; 0 is before anything moves',
                  unit='s', low=0.0, high=1e6, required=True),
    ParameterSpec('attitude_xyzw', 'floats', [0.0, 0.0, 0.0, 1.0],
                  'commanded attitude, body to inertial, as x, y, z, w', unit='1', lengths=(4,)),
    ParameterSpec('direction_N', 'floats', [1.0, 0.0, 0.0],
                  'inertial direction for the pointing axis (target: pointing), or of a cone',
                  unit='1', lengths=(3,)),
    ParameterSpec('cone', 'str', 'sun',
                  'with direction_N: the cone whose direction_topic brings it'),
    ParameterSpec('guidance', 'str', 'nadir',
                  'an attitude that moves, as guidance commands it in this mode, to the end',
                  choices=MODES),
)
LINK_KEYS = (
    ParameterSpec('drop_probability', 'float', 0.0, 'part of the messages that are lost',
                  unit='1', low=0.0, high=1.0),
    ParameterSpec('delay_s', 'float', 0.0, 'time that every other message is late', unit='s',
                  low=0.0, high=60.0),
    ParameterSpec('seed', 'int', 0, 'seed of which messages are lost', low=0, high=2**31 - 1),
)
STOP_KEYS = (
    ParameterSpec('at_s', 'float', 0.0, 'time from the first state', unit='s', low=0.0,
                  high=1e6, required=True),
    ParameterSpec('for_s', 'float', 1.0, 'how long', unit='s', low=1e-3, high=1e6,
                  required=True),
)
ACCEPTANCE_KEYS = (
    ParameterSpec('attitude_tolerance_deg', 'float', 0.1,
                  'settled below this error of attitude (or pointing)', unit='deg', low=1e-9,
                  high=180.0),
    ParameterSpec('rate_tolerance_rad_s', 'float', 1e-3, 'and below this norm of the body rate',
                  unit='rad/s', low=1e-12, high=1e3),
    ParameterSpec('settle_time_s', 'float', 30.0,
                  'settled no later than this after the start and after each setpoint', unit='s',
                  low=0.0, high=1e6),
    ParameterSpec('final_error_deg', 'float', 0.1, 'largest error of the last state', unit='deg',
                  low=0.0, high=180.0),
    ParameterSpec('final_rate_rad_s', 'float', 1e-3, 'largest norm of the last body rate',
                  unit='rad/s', low=0.0, high=1e3),
    ParameterSpec('peak_torque_n_m', 'floats', [0.3], 'largest commanded torque, by axis',
                  unit='N m', lengths=(1, 3)),
    ParameterSpec('peak_rate_rad_s', 'floats', [0.6], 'largest body rate, by axis', unit='rad/s',
                  lengths=(1, 3)),
    ParameterSpec('violations', 'int', 0,
                  "torques and rates beyond the controller's own limits by more than 1 %",
                  low=0, high=2**31 - 1),
    ParameterSpec('cone_violation_s', 'float', 0.0,
                  'time in which a cone is not kept for sure, between samples too', unit='s',
                  low=0.0, high=1e6),
    ParameterSpec('solver_time_p99_ms', 'float', 50.0, '99 % of the solves take no longer',
                  unit='ms', low=0.0, high=1e6),
    ParameterSpec('promises_broken', 'int', 0,
                  'ticks at which the value function fell by less than promised', low=0,
                  high=2**31 - 1),
    ParameterSpec('infeasible_ticks', 'int', 0, 'plans that are infeasible or failed', low=0,
                  high=2**31 - 1),
    *(ParameterSpec(f'{mode.lower()}_ticks', 'int', 0, f'ticks in mode {mode}', low=0,
                    high=2**31 - 1) for mode in ('HOLD', 'FALLBACK', 'COAST')),
    ParameterSpec('refused_messages', 'int', 0, 'messages that the controller refused', low=0,
                  high=2**31 - 1),
)


def check_group(
    specs: Sequence[ParameterSpec], groups: Mapping[str, tuple[bool, str]], given: object,
    prefix: str,
) -> dict[str, Any]:
    """Return the checked values of one group; nested groups and lists come as they are.

    Raises ConfigurationError for an unknown key (with the nearest valid one), a missing one or an
    invalid value; the key is named in full, ``prefix`` included.
    """
    if not isinstance(given, Mapping):
        raise ConfigurationError(prefix.rstrip('.') or 'scenario', given, 'nested keys')
    table = {spec.name: spec for spec in specs}
    known = [*table, *groups]
    values: dict[str, Any] = {}
    for key, value in given.items():
        if key not in known:
            raise ConfigurationError(
                f'{prefix}{key}', value, 'a key that exists (unknown key; the nearest is '
                f'{prefix}{checks.nearest(key, known)})')
        values[key] = (check_value(table[key], value, prefix) if key in table
                       else _nested(value, f'{prefix}{key}', is_list=groups[key][0]))
    for spec in specs:
        if spec.required and spec.name not in values:
            raise ConfigurationError(
                f'{prefix}{spec.name}', None,
                f'{spec.valid}: {spec.description} (the key is missing)')
    return values


def check_value(spec: ParameterSpec, value: object, prefix: str) -> Value:
    """Return a checked value; the error names the key in full."""
    try:
        return spec.check(value)
    except ConfigurationError as error:
        raise ConfigurationError(f'{prefix}{error.key}', error.value, error.valid) from None


def all_keys() -> Iterator[tuple[str, ParameterSpec]]:
    """Yield the full name of every key and its description, ``[]`` for an element of a list."""
    tables = (
        ('', SCENARIO_KEYS), ('time.', TIME_KEYS), ('setpoints[].', SETPOINT_KEYS),
        ('faults.state_link.', LINK_KEYS), ('faults.command_link.', LINK_KEYS),
        ('faults.controller_stops[].', STOP_KEYS), ('acceptance.', ACCEPTANCE_KEYS))
    for prefix, specs in tables:
        yield from ((prefix + spec.name, spec) for spec in specs)


def _nested(value: object, name: str, *, is_list: bool) -> Any:
    """Return a nested group or list of groups after a look at its kind."""
    if is_list and not isinstance(value, (list, tuple)):
        raise ConfigurationError(name, value, 'a list of groups of keys')
    if not is_list and not isinstance(value, Mapping):
        raise ConfigurationError(name, value, 'nested keys')
    return value
