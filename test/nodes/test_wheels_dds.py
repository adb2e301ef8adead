# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Controller and simulator with reaction wheels, as processes over DDS."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

import numpy as np
from harness import open_rig, stamp_ns
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState, MagneticField
from std_msgs.msg import Float64MultiArray

from manifold_mpc_ros.lie import so3

WHEELS = {'actuators.kind': 'wheels', 'lockstep': True, 'autostart': False}
SPEEDS = [150.0, -80.0, 60.0, 40.0]


def test_a_half_turn_in_lockstep_settles_with_momentum_stored_and_is_the_same_in_every_run(
    tmp_path: Path,
) -> None:
    runs = []
    for _ in range(2):
        with open_rig(tmp_path) as rig:
            states = rig.watch(Odometry, 'odometry')
            speeds = rig.watch(JointState, 'wheel_states')
            commands = rig.watch(Float64MultiArray, 'wheel_commands')
            rig.start('simulator', parameters=WHEELS | {
                'plant.wheels.initial_speed_rad_s': SPEEDS})
            rig.start('controller', parameters=WHEELS)
            for node in ('/attitude_controller', '/lgvi_simulator'):
                rig.activate(node)
            rig.until(lambda s=states: len({stamp_ns(m) for m in s}) > 60, 'sixty exchanges')
        end = {stamp_ns(m): m for m in states}
        last = end[sorted(end)[59]]
        q = last.pose.pose.orientation
        assert so3.angle(so3.rotation_from_quaternion([q.w, q.x, q.y, q.z])) < 1e-3
        torques = np.array([m.data for m in commands])
        assert (np.abs(torques) <= 0.5 * (1 + 1e-9)).all()
        assert np.abs(torques).max() > 0.05
        assert np.abs(np.array([m.velocity for m in speeds])).max() <= 400.0 * (1 + 1e-9)
        runs.append({stamp_ns(m): tuple(m.velocity) for m in speeds})
    both = runs[0].keys() & runs[1].keys()
    assert len(both) >= 50
    assert all(runs[0][stamp] == runs[1][stamp] for stamp in both)
    assert max(abs(speed) for values in runs[0].values() for speed in values) > 120.0


def test_thrusters_in_lockstep_turn_the_body_by_pulses(tmp_path: Path) -> None:
    given = {**WHEELS, 'actuators.kind': 'thrusters'}
    orbit = {'orbit.altitude_m': 5e5, 'orbit.inclination_deg': 97.4}
    with open_rig(tmp_path) as rig:
        states = rig.watch(Odometry, 'odometry')
        commands = rig.watch(Float64MultiArray, 'thruster_commands')
        fields = rig.watch(MagneticField, 'magnetic_field')
        rig.start('simulator', parameters=given | orbit)
        rig.start('controller', parameters=given)
        for node in ('/attitude_controller', '/lgvi_simulator'):
            rig.activate(node)
        rig.until(lambda: len({stamp_ns(m) for m in states}) > 50, 'fifty exchanges')
        q = states[-1].pose.pose.orientation
        assert so3.angle(so3.rotation_from_quaternion([q.w, q.x, q.y, q.z])) < 0.05
        on = np.array([m.data for m in commands])
        assert on.shape[1] == 6
        assert ((on == 0.0) | ((on >= 0.02) & (on <= 0.5))).all()
        assert np.count_nonzero(on) > 10
        sizes = [np.linalg.norm([m.magnetic_field.x, m.magnetic_field.y, m.magnetic_field.z])
                 for m in fields]
        assert len(sizes) > 40
        assert 2e-5 < min(sizes) <= max(sizes) < 6e-5
