# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Magnetorquers over DDS: wheels desaturated while pointing holds, a tumble braked, no field."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped, WrenchStamped
from harness import Rig, open_rig, stamp_ns
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState, MagneticField

from manifold_mpc_ros.lie import so3

# A 6U with four wheels of 10.8 mN m s, and dipoles ten times those of magnetorquers of its size:
# what takes a part of an orbit takes minutes.
BODY: dict[str, Any] = {
    'spacecraft.inertia_kg_m2': [0.05, 0.06, 0.02], 'limits.max_torque_n_m': [1.0e-3] * 3,
    'magnetorquers.max_dipole_a_m2': [5.0], 'lockstep': True, 'autostart': False}
ORBIT = {'orbit.altitude_m': 5.0e5, 'orbit.inclination_deg': 97.4, 'timing.control_period_s': 1.0,
         'plant.step_s': 0.1, 'timing.state_period_s': 0.5}
WHEELS = {'actuators.kind': 'wheels', 'actuators.wheels.max_torque_n_m': [7.0e-4],
          'actuators.wheels.max_momentum_n_m_s': [0.01082],
          'actuators.wheels.inertia_kg_m2': [1.72e-5]}
LAW = {'mpc.step_s': 1.0, 'mpc.rate_weight': [2.0, 2.0, 2.0], 'limits.max_rate_rad_s': [0.05],
       'mpc.torque_weight': [1.0e4, 1.0e4, 1.0e4], 'magnetorquers.dump_time_s': 60.0}
AXES_B = np.array([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]]) / np.sqrt(3.0)


def began(rig: Rig, controller: dict[str, Any], simulator: dict[str, Any]) -> None:
    """Start both nodes and let time begin."""
    rig.start('simulator', parameters=BODY | ORBIT | simulator)
    rig.start('controller', parameters=BODY | LAW | controller)
    for node in ('/attitude_controller', '/lgvi_simulator'):
        rig.activate(node)


def test_wheels_are_desaturated_from_80_to_10_percent_while_pointing_holds(
    tmp_path: Path,
) -> None:
    # 80 % of what fits in every attitude, across the field at the begin (which is along -z).
    reach = 4.0 * 0.01082 / 3.0 ** 0.5 / 2.0 ** 0.5
    stored = 0.8 * reach * np.array([1.0, 0.0, 0.0])
    speeds = np.linalg.pinv(AXES_B.T) @ stored / 1.72e-5
    with open_rig(tmp_path) as rig:
        states = rig.watch(Odometry, 'odometry')
        wheels = rig.watch(JointState, 'wheel_states')
        dipoles = rig.watch(Vector3Stamped, 'dipole_command')
        began(rig, WHEELS, WHEELS | {
            'plant.initial_attitude_xyzw': [0.0, 0.0, 0.0, 1.0], 'orbit.phase_deg': 90.0,
            'plant.wheels.initial_speed_rad_s': speeds.tolist()})

        def left() -> float:
            total = AXES_B.T @ np.array(wheels[-1].velocity) * 1.72e-5
            return float(np.linalg.norm(total)) / reach

        rig.until(lambda: len(wheels) > 0, 'wheels')
        assert left() > 0.5  # of the 80 % that it begins with, at the first that is heard
        rig.until(lambda: left() < 0.1, 'desaturation')
    errors = [so3.angle(so3.rotation_from_quaternion([q.w, q.x, q.y, q.z]))
              for q in (m.pose.pose.orientation for m in states)]
    assert np.degrees(max(errors)) < 0.1
    given = np.array([[m.vector.x, m.vector.y, m.vector.z] for m in dipoles])
    assert (np.abs(given) <= 5.0 * (1 + 1e-12)).all()
    assert np.abs(given).max() > 1.0
    assert {m.header.frame_id for m in dipoles} == {'base_link'}


def test_magnetorquers_alone_brake_and_command_no_torque(tmp_path: Path) -> None:
    alone = {'actuators.kind': 'magnetorquers'}
    with open_rig(tmp_path) as rig:
        states = rig.watch(Odometry, 'odometry')
        torques = rig.watch(WrenchStamped, 'torque_command')
        status = rig.watch(DiagnosticArray, '/diagnostics')
        began(rig, alone | {'magnetorquers.braking_gain': 0.05},
              alone | {'plant.initial_rate_rad_s': [0.05, -0.06, 0.04]})
        rig.until(lambda: len({stamp_ns(m) for m in states}) > 60, 'sixty exchanges')
    rates = [np.array([w.x, w.y, w.z]) for w in (m.twist.twist.angular for m in states)]
    inertia = np.array([0.05, 0.06, 0.02])
    energies = [float(inertia @ rate ** 2) for rate in rates]
    assert energies[-1] < 0.3 * energies[0]
    assert not any(m.wrench.torque.x or m.wrench.torque.y or m.wrench.torque.z for m in torques)
    words = {each.message for array in status for each in array.status}
    assert any('they brake' in message for message in words)


def test_without_a_field_there_is_no_dipole_and_diagnostics_say_so(tmp_path: Path) -> None:
    alone = {'actuators.kind': 'magnetorquers', 'lockstep': False}
    with open_rig(tmp_path) as rig:
        dipoles = rig.watch(Vector3Stamped, 'dipole_command')
        status = rig.watch(DiagnosticArray, '/diagnostics')
        fields = rig.node.create_publisher(MagneticField, 'magnetic_field', 1)
        began(rig, alone, alone | {'orbit.altitude_m': 0.0,
                                   'plant.initial_rate_rad_s': [0.05, -0.06, 0.04]})

        def words() -> str:
            return ' '.join(each.message for array in status[-5:] for each in array.status)

        def tell(frame: str, size: float) -> None:
            field = MagneticField()
            field.header.stamp = rig.node.get_clock().now().to_msg()
            field.header.frame_id = frame
            field.magnetic_field.x = size
            fields.publish(field)

        rig.until(lambda: 'no magnetic field has come: no dipole' in words(), 'the warning')
        assert not any(m.vector.x or m.vector.y or m.vector.z for m in dipoles)
        rig.until(lambda: any(value.key.startswith('refused.magnetic_field.') for array in
                              status[-5:] for each in array.status for value in each.values),
                  'a refusal', meanwhile=lambda: tell('map', 3e-5))
        assert not any(m.vector.x or m.vector.y or m.vector.z for m in dipoles)
        rig.until(lambda: any(m.vector.y or m.vector.z for m in dipoles[-3:]), 'a dipole',
                  meanwhile=lambda: tell('base_link', 3e-5))
        rig.until(lambda: 's old: no dipole' in words(), 'the warning of an old field')
