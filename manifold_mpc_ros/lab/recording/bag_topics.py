# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Options that say which topics of a bag to take; the types are what the bag says."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

from manifold_mpc_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from manifold_mpc_ros.lab.recording.bags.run import TopicNames

_OPTIONS = (
    ('state', 'attitude and body rate: nav_msgs/Odometry or sensor_msgs/Imu'),
    ('pose', 'attitude, instead of --state: geometry_msgs/PoseStamped, with --twist'),
    ('twist', 'rate in body axes, joined with the pose of the same stamp: '
              'geometry_msgs/TwistStamped'),
    ('torque', 'recorded torques: geometry_msgs/WrenchStamped'),
    ('attitude_setpoint', 'commanded attitudes: geometry_msgs/QuaternionStamped'),
    ('direction_setpoint', 'commanded directions: geometry_msgs/Vector3Stamped'),
)


def add_topics(parser: argparse.ArgumentParser) -> None:
    """Add an option for each topic."""
    group = parser.add_argument_group(
        'topics of a bag from another stack (default: those that manifold-mpc record uses)')
    for name, meaning in _OPTIONS:
        group.add_argument(
            f'--{name.replace("_", "-")}', metavar='TOPIC', dest=f'topic_{name}', help=meaning)
    for name, what in _DESCRIPTIONS:
        group.add_argument(
            f'--{name.replace("_", "-")}', metavar='DESCRIPTION', dest=f'described_{name}',
            default='', help=f'messages of {what}, by the name of a shipped description (px4, '
                             'basilisk, ...) or a YAML file (docs/interfaces.md)')
    group.add_argument(
        '--full-scale-torque', type=float, nargs=3, metavar='N_M', default=(float('inf'),),
        help='torque about each axis that is 1 in normalised commands [N m]')


_DESCRIPTIONS = (
    ('state_source', 'states'), ('setpoint_source', 'commanded attitudes'),
    ('command_sink', 'commands'))


def topics_given(arguments: argparse.Namespace) -> TopicNames | None:
    """Return the topics to take, None where no option was given.

    Raises ConfigurationError when the options do not go together.
    """
    from manifold_mpc_ros.lab.recording.bags.run import TopicNames
    from manifold_mpc_ros.lab.recording.bags.translate import StackDescriptions
    given = {name: value for name, _ in _OPTIONS
             if (value := getattr(arguments, f'topic_{name}')) is not None}
    described = {name: getattr(arguments, f'described_{name}') for name, _ in _DESCRIPTIONS}
    stack = StackDescriptions(
        **described, full_scale_torque_n_m=tuple(arguments.full_scale_torque),
    ) if any(described.values()) else None
    if not given and stack is None:
        return None
    if ('pose' in given) != ('twist' in given):
        missing = 'twist' if 'pose' in given else 'pose'
        raise ConfigurationError(f'--{missing}', None, 'a topic: --pose and --twist go together')
    if 'pose' in given and 'state' in given:
        raise ConfigurationError('--state', given['state'], 'left out with --pose and --twist')
    if 'pose' in given:
        given['state'] = ''
    return replace(TopicNames(), **given, stack=stack)
