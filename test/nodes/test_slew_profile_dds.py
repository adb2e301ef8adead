# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A setpoint that jumps while its predecessor's slew is under way, over DDS, with profiles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import QuaternionStamped
from nav_msgs.msg import Odometry
from watching import attitude, rate_rad_s, values_of

from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.nodes.messages import to_quaternion

if TYPE_CHECKING:
    from harness import Rig

NODE = 'attitude_controller'
GOAL = so3.exp([0.0, 0.0, -np.pi / 2])


def test_a_setpoint_in_the_middle_of_a_slew_is_turned_to_by_a_profile(rig: Rig) -> None:
    states = rig.watch(Odometry, 'odometry')
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    setpoints = rig.node.create_publisher(QuaternionStamped, 'attitude_setpoint', 10)
    rig.start('controller', parameters={
        'lockstep': True, 'slew_profile.torque_fraction': 0.9,
        'limits.max_rate_rad_s': [0.005, 0.005, 0.005]})  # hundreds of seconds for half a turn
    rig.start('simulator', parameters={'lockstep': True})

    def said(key: str) -> str:
        return values_of(diagnostics, NODE).get(key, '')

    rig.until(lambda: said('slew_profile') == 'followed', 'a profile')
    message = QuaternionStamped(quaternion=to_quaternion(GOAL))
    message.header.frame_id = 'inertial'
    rig.tell(setpoints, message, lambda: said('setpoint') == 'commanded', 'the setpoint')
    rig.until(lambda: said('slew_profile') == 'none' and float(
        said('attitude_error_deg')) < 1e-3, 'the end of the slew')
    rig.until(lambda: np.rad2deg(so3.angle(
        GOAL.T @ attitude(states[-1].pose.pose.orientation))) < 1e-2, 'a state at the setpoint')
    assert max(np.abs(rate_rad_s(each)).max() for each in states) < 0.005
    assert said('solver_status') == 'converged'
