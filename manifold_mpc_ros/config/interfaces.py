# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""State sources and actuators by kind: their topics, and the class that does the work.

The tables from which everything else about them follows: the valid values of the parameters
``state_source`` and ``actuators.kind``, what the nodes subscribe to and publish, ``--help``, the
laboratory. A further kind is one file with its class, and one entry here.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Topic:
    """A topic: its name, the type of its messages (package/msg/Name), and what they say."""

    name: str
    message_type: str
    meaning: str


@dataclass(frozen=True)
class InterfaceKind:
    """One kind of state source or of actuator.

    ``implementation`` is 'module:Class', below the package, imported when it is used: a
    `StateSource` (nodes/state_input.py) or an `Actuator` (control/actuator.py).
    """

    topics: tuple[Topic, ...]
    implementation: str

    def load(self) -> Any:
        """Return the class."""
        return load(self.implementation)


#: Where a complete state comes from, by the value of the parameter ``state_source``.
STATE_SOURCES = {
    'odometry': InterfaceKind(
        (Topic('odometry', 'nav_msgs/msg/Odometry', 'attitude (pose), body rate (twist)'),),
        'manifold_mpc_ros.nodes.odometry_source:OdometrySource'),
    'imu': InterfaceKind(
        (Topic('imu', 'sensor_msgs/msg/Imu', 'attitude (orientation), body rate'),),
        'manifold_mpc_ros.nodes.imu_source:ImuSource'),
}

#: What turns the body, by the value of the parameter ``actuators.kind``.
ACTUATORS = {
    'torque': InterfaceKind(
        (Topic('torque_command', 'geometry_msgs/msg/WrenchStamped', 'body torque [N m]'),),
        'manifold_mpc_ros.control.torque_actuator:TorqueActuator'),
}


def load(path: str) -> Any:
    """Return what 'module:name' names."""
    module, _, name = path.partition(':')
    return getattr(importlib.import_module(module), name)


def message_class(message_type: str) -> Any:
    """Return the class of a message type 'package/msg/Name'; needs ROS."""
    package, folder, name = message_type.split('/')
    return load(f'{package}.{folder}:{name}')


def state_topics() -> tuple[tuple[str, str, str], ...]:
    """Return name, type and meaning of every topic of a state source.

    The first kind is the shipped one; of the others the meaning is how to choose it.
    """
    first, *others = STATE_SOURCES
    return tuple(
        (topic.name, topic.message_type, topic.meaning)
        for topic in STATE_SOURCES[first].topics) + tuple(
        (topic.name, topic.message_type, f'with state_source {kind}')
        for kind in others for topic in STATE_SOURCES[kind].topics)


def actuator_topics() -> tuple[tuple[str, str, str], ...]:
    """Return name, type and meaning of every topic of an actuator, once."""
    return tuple(dict.fromkeys(
        (topic.name, topic.message_type, topic.meaning)
        for actuator in ACTUATORS.values() for topic in actuator.topics))
