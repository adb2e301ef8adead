# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pointing over DDS: one axis reaches its direction, from the antipode too, and roll is free."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped, WrenchStamped
from harness import torque_of
from nav_msgs.msg import Odometry
from watching import attitude, error_rad, rate_rad_s, values_of

if TYPE_CHECKING:
    from harness import Rig

POINTING = {'lockstep': True, 'target': 'pointing', 'pointing.axis_B': [0.0, 0.0, 1.0]}
# The z axis points along -z, turned about x by 180 degrees and then rolled by 1 rad.
ANTIPODE = {'lockstep': True, 'plant.initial_attitude_xyzw': [
    math.cos(0.5), math.sin(0.5), 0.0, 0.0]}
BY_HAND = {'autostart': False}
Z_AXIS = np.array([0.0, 0.0, 1.0])


def pointing_error_rad(state: Odometry, direction: np.ndarray) -> float:
    """Return the angle between the body z axis and a direction."""
    axis = attitude(state.pose.pose.orientation) @ Z_AXIS
    return math.atan2(float(np.linalg.norm(np.cross(axis, direction))), float(axis @ direction))


def points(states: list[Odometry], direction: np.ndarray) -> bool:
    """Whether the last state points there within 0.1 degree, at rest."""
    return bool(states) and (
        pointing_error_rad(states[-1], direction) < math.radians(0.1)
        and float(np.linalg.norm(rate_rad_s(states[-1]))) < 1e-3)


def direction_message(vector: tuple[float, float, float], frame: str = 'inertial') -> Any:
    """Return a direction setpoint."""
    message = Vector3Stamped()
    message.header.frame_id = frame
    message.vector.x, message.vector.y, message.vector.z = vector
    return message


def test_points_from_the_antipode_and_leaves_the_roll_free(rig: Rig) -> None:
    states, torques = rig.watch(Odometry, 'odometry'), rig.watch(WrenchStamped, 'torque_command')
    rig.start('controller', parameters=POINTING | BY_HAND)
    rig.start('simulator', parameters=ANTIPODE | BY_HAND)
    rig.activate('/attitude_controller')
    rig.activate('/lgvi_simulator')
    rig.until(lambda: points(states, Z_AXIS), 'the z axis along z')
    assert pointing_error_rad(states[0], Z_AXIS) > math.radians(179.9)
    assert np.abs([torque_of(message) for message in torques]).max() <= 0.3
    assert error_rad(states[-1]) > 0.1  # the attitude is not the identity: roll was left alone


def test_a_direction_setpoint_is_reached_and_bad_ones_are_counted(rig: Rig) -> None:
    states = rig.watch(Odometry, 'odometry')
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    publisher = rig.node.create_publisher(Vector3Stamped, 'direction_setpoint', 10)
    rig.start('controller', parameters=POINTING)
    rig.until(lambda: publisher.get_subscription_count() > 0, 'the controller')
    rig.start('simulator', parameters={'lockstep': True})

    def counted(key: str) -> bool:
        return f'refused.direction_setpoint.{key}' in values_of(
            diagnostics, 'attitude_controller')

    for key, bad in (('zero_direction', direction_message((0.0, 0.0, 0.0))),
                     ('non_finite', direction_message((math.nan, 0.0, 1.0))),
                     ('wrong_frame', direction_message((1.0, 0.0, 0.0), 'map'))):
        rig.until(lambda key=key: counted(key), key,  # type: ignore[misc]
                  meanwhile=lambda bad=bad: publisher.publish(bad))  # type: ignore[misc]
    wanted = np.array([2.0, -3.0, 6.0])
    rig.until(lambda: points(states, wanted / 7.0), 'the commanded direction',
              meanwhile=lambda: publisher.publish(direction_message((2.0, -3.0, 6.0))))
