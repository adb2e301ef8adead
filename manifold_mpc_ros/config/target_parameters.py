# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of what is aimed at: cones, targets that move, profiles towards others."""

from __future__ import annotations

from manifold_mpc_ros.config.parameter import ParameterSpec

#: Parameters of a cone, below ``cones.NAME``.
CONE_PARAMETERS = (
    ParameterSpec(
        'axis_B', 'floats', [0.0, 0.0, 1.0], 'body axis', unit='1', lengths=(3,), required=True),
    ParameterSpec(
        'half_angle_deg', 'float', 30.0, 'half angle', unit='deg', low=0.001, high=179.999,
        required=True),
    ParameterSpec(
        'kind', 'str', 'keep_out', 'whether the axis stays out of the cone, or in it',
        choices=('keep_out', 'keep_in')),
    ParameterSpec(
        'group', 'str', 'none',
        'name of a group of keep_in cones of which any one has to be kept (none: by itself)',
        read_only=True),
    ParameterSpec(
        'direction_N', 'floats', [1.0, 0.0, 0.0],
        'axis of the cone in inertial axes; with a topic, until its first message', unit='1',
        lengths=(3,), required=True),
    ParameterSpec(
        'direction_topic', 'str', 'none',
        'topic that brings the direction, geometry_msgs/Vector3Stamped (none: it is fixed)',
        read_only=True),
    ParameterSpec(
        'direction_timeout_s', 'float', 60.0,
        'age above which a direction of the topic is stale: the last one holds, with a warning',
        unit='s', low=0.0, high=1e9),
)

#: Parameters of a controller's targets.
TARGET_PARAMETERS = (
    ParameterSpec(
        'reference.timeout_s', 'float', 0.0,
        'age of an odometry_setpoint that still goes on; 0: take neither it nor a reference',
        unit='s', low=0.0, high=86400.0, read_only=True, name_in_config='reference_timeout_s'),
    ParameterSpec(
        'slew_profile.torque_fraction', 'float', 0.0,
        'part of the torque and rate limits that a profile towards a setpoint uses; 0: no profile',
        unit='1', low=0.0, high=0.99, name_in_config='slew_torque_fraction'),
    ParameterSpec(
        'slew_profile.smallest_angle_rad', 'float', 0.1,
        'a body that is nearer to where it should be begins no profile', unit='rad', low=1e-6,
        high=4.0, name_in_config='slew_smallest_angle_rad'),
)
