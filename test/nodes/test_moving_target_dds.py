# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Targets that move, over DDS: followed without lag; too fast, jumping and stale ones are said."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Transform, Twist
from harness import stamp_ns
from nav_msgs.msg import Odometry
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint
from watching import attitude, values_of

from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.nodes.messages import to_quaternion, to_stamp, to_vector

if TYPE_CHECKING:
    from harness import Rig

NODE = 'attitude_controller'
RATE = np.deg2rad([0.5, -0.5, 0.7])


def message(begin_ns: int, rate: np.ndarray, times_s: range, frame: str = 'inertial',
            ) -> MultiDOFJointTrajectory:
    """Return a trajectory at a constant rate, from the identity."""
    made = MultiDOFJointTrajectory(joint_names=['body'])
    made.header.frame_id, made.header.stamp = frame, to_stamp(begin_ns)
    for time_s in times_s:
        point = MultiDOFJointTrajectoryPoint(time_from_start=Duration(sec=time_s))
        point.transforms = [Transform(rotation=to_quaternion(so3.exp(time_s * rate)))]
        point.velocities = [Twist(angular=to_vector(rate))]
        point.accelerations = [Twist()]
        made.points.append(point)
    return made


def test_what_moves_is_followed_and_what_cannot_be_is_said(rig: Rig) -> None:
    states = rig.watch(Odometry, 'odometry')
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    paths = rig.node.create_publisher(MultiDOFJointTrajectory, 'reference', 10)
    setpoints = rig.node.create_publisher(Odometry, 'odometry_setpoint', 10)
    rig.start('controller', parameters={'lockstep': True, 'reference.timeout_s': 20.0})
    rig.start('simulator', parameters={
        'lockstep': True, 'plant.initial_attitude_xyzw': [0.0, 0.0, 0.0, 1.0]})
    rig.until(lambda: len(states) > 5 and paths.get_subscription_count() > 0, 'states')

    def said(key: str) -> str:
        return values_of(diagnostics, NODE).get(key, '')

    rig.tell(paths, message(0, RATE, range(9), frame='elsewhere'),
             lambda: bool(said('refused.reference.wrong_frame')), 'a refusal')
    begin_ns = stamp_ns(states[-1])
    rig.tell(paths, message(begin_ns, RATE, range(0, 20_000, 50)),
             lambda: said('target') == 'moving', 'a moving target')
    settled_ns = stamp_ns(states[-1]) + 60 * 10**9
    rig.until(lambda: stamp_ns(states[-1]) > settled_ns + 60 * 10**9, 'the target to be followed')
    errors = [np.rad2deg(so3.angle(so3.exp(
        (stamp_ns(each) - begin_ns) / 1e9 * RATE).T @ attitude(each.pose.pose.orientation)))
        for each in states if stamp_ns(each) > settled_ns]
    assert len(errors) > 100
    assert max(errors) < 1e-3
    assert int(said('target_jumps')) == 1

    rig.tell(paths, message(0, np.array([0.0, 0.0, 0.8]), range(0, 400, 2)),
             lambda: 'followed as near as they allow' in said('message'), 'the warning')
    assert float(said('target_limits_used')) > 1.3
    jumps = int(said('target_jumps'))
    assert jumps > 1

    moving = Odometry()
    moving.header.frame_id = 'inertial'
    moving.pose.pose.orientation = to_quaternion(np.eye(3))
    moving.twist.twist.angular = to_vector(RATE)
    rig.tell(setpoints, moving, lambda: int(said('target_jumps')) > jumps, 'the moving setpoint')
    rig.until(lambda: 'the setpoint is stale' in said('message'), 'staleness')
    assert said('target') == 'over'
    rig.until(lambda: float(said('attitude_error_deg')) < 1e-3, 'the last attitude')
    held = so3.exp(20.0 * RATE)
    rig.until(lambda: np.rad2deg(so3.angle(
        held.T @ attitude(states[-1].pose.pose.orientation))) < 1e-3, 'a state at it')
