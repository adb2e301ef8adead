# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shipped topics of states, setpoints and commands, and actuators by kind.

Messages are described in YAML (description.py). What the nodes subscribe to and publish,
``--help`` and the security policies follow from the descriptions and from the table here.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from manifold_mpc_ros.config.description import (
    PLAIN,
    SHIPPED_STATES,
    command_description,
    setpoint_description,
    state_description,
)
from manifold_mpc_ros.errors import ConfigurationError

#: Topics or services: name, type, meaning.
Interfaces = tuple[tuple[str, str, str], ...]

#: What turns the body, by the value of the parameter ``actuators.kind``: 'module:Class' of an
#: `Actuator` (control/actuator.py), imported when it is used.
ACTUATORS = {'torque': 'manifold_mpc_ros.control.actuator:TorqueActuator',
             'wheels': 'manifold_mpc_ros.control.devices.wheel_actuator:WheelActuator',
             'thrusters': 'manifold_mpc_ros.control.devices.thruster_actuator:ThrusterActuator',
             'magnetorquers': 'manifold_mpc_ros.control.devices.magnetorquers:OnlyMagnetorquers'}

#: What the controller subscribes to and the simulator publishes with ``actuators.kind: wheels``.
WHEEL_STATES = ('wheel_states', 'sensor_msgs/msg/JointState', 'speeds of wheels [rad/s]')

#: What every node hears of the time.
CLOCK = ('/clock', 'rosgraph_msgs/msg/Clock', 'time, with use_sim_time')
#: What the simulator publishes with ``orbit.altitude_m``, for magnetorquers.
MAGNETIC_FIELD = ('magnetic_field', 'sensor_msgs/msg/MagneticField',
                  'magnetic field, body axes [T]')

#: What every node says of itself.
DESCRIPTION = ('~/description', 'std_msgs/msg/String', 'parameters, versions; latched')
#: What each lifecycle node publishes and subscribes to with ``bond_period_s``.
BOND = ('bond', 'bond/msg/Status', 'heartbeats, with bond_period_s')


def load(path: str) -> Any:
    """Return what 'module:name' names."""
    module, _, name = path.partition(':')
    return getattr(importlib.import_module(module), name)


def message_class(message_type: str, install: str = '') -> Any:
    """Return the class of a message type 'package/msg/Name'; needs ROS.

    Raises ConfigurationError for one that is not installed; ``install`` says how to get it.
    """
    package, folder, name = message_type.split('/')
    try:
        return load(f'{package}.{folder}:{name}')
    except ModuleNotFoundError:
        way = install or f'build {package} in this workspace, or source its own'
        raise ConfigurationError(
            'type', message_type, f'a type of an installed package ({way})') from None
    except AttributeError:
        raise ConfigurationError(
            'type', message_type, f'a message that package {package} has') from None


@contextmanager
def named_by(parameter: str, given: str) -> Iterator[None]:
    """Let a ConfigurationError of a message type name the parameter and the description."""
    try:
        yield
    except ConfigurationError as error:
        raise ConfigurationError(
            parameter, given, f'{error.value} to be {error.valid}') from None


def state_topics(*given: str) -> Interfaces:
    """Return name, type and meaning of the topics of states, those of the simulator by default."""
    return tuple(dict.fromkeys(
        (part.topic, part.message_type, 'attitude and body rate' if name == PLAIN
         else f'with state_source {name}')
        for name in given or SHIPPED_STATES
        for part in (state_description(name).attitude, state_description(name).rate)))


def setpoint_topics(given: str = PLAIN) -> Interfaces:
    """Return name, type and meaning of the topic of commanded attitudes."""
    attitude = setpoint_description(given)
    return ((attitude.topic, attitude.message_type, 'commanded attitude'),)


def command_topics(given: str = PLAIN) -> Interfaces:
    """Return name, type and meaning of the topics of commands."""
    meaning = {'wheels': 'torque of wheels [N m]', 'thrusters': 'on-times of thrusters [s]',
               'magnetorquers': 'dipole [A m^2]'}.get(given, 'body torque [N m]')
    return tuple((message.topic, message.message_type, meaning)
                 for message in command_description(given))
