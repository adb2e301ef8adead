# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Devices that fail in flight, which nobody tells the controller: found, named, not used."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from harness import open_rig, stamp_ns
from nav_msgs.msg import Odometry
from std_msgs.msg import Float64MultiArray

from manifold_mpc_ros.lie import so3


def failing(kind: str, failure: str, which: int, of: int) -> dict[str, Any]:
    """Return parameters of the simulator in which one device of so many fails after 3 s."""
    times = ['3.0' if i == which else '.inf' for i in range(of)]
    return {'actuators.kind': kind, failure: f'[{", ".join(times)}]'}


@pytest.mark.parametrize(('kind', 'topic', 'failure', 'which', 'of', 'words'), [
    ('wheels', 'wheel_commands', 'plant.wheels.dead_from_s', 1, 4,
     'wheel_2 does not follow its motor: not used until ~/reset'),
    ('thrusters', 'thruster_commands', 'plant.thrusters.off_from_s', 7, 12,
     't8 gives no torque: not used until ~/reset')])
def test_a_device_that_fails_untold_is_named_not_used_and_the_slew_settles(
    tmp_path: Path, kind: str, topic: str, failure: str, which: int, of: int, words: str,
) -> None:
    both: dict[str, Any] = {'actuators.kind': kind, 'lockstep': True, 'autostart': False}
    if kind == 'thrusters':  # twelve, two for each torque
        places = 0.5 * np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [1, 0, 0],
                                 [-1, 0, 0]])
        pushes = np.array([[0, 0, 1], [0, 0, 1], [1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]])
        both |= {
            'actuators.thrusters.names': [f't{i}' for i in range(1, 13)],
            'actuators.thrusters.positions_B_m': np.vstack([places, places]).ravel().tolist(),
            'actuators.thrusters.directions_B': np.vstack(
                [pushes, -pushes]).astype(float).ravel().tolist(),
            'actuators.thrusters.force_n': [0.5]}
    with open_rig(tmp_path) as rig:
        states = rig.watch(Odometry, 'odometry')
        commands = rig.watch(Float64MultiArray, topic)
        status = rig.watch(DiagnosticArray, '/diagnostics')
        rig.start('simulator', parameters=both | failing(kind, failure, which, of) | {
            'plant.initial_attitude_xyzw': [0.5, 0.5, 0.5, 0.5]})
        rig.start('controller', parameters=both)
        for node in ('/attitude_controller', '/lgvi_simulator'):
            rig.activate(node)
        rig.until(lambda: len({stamp_ns(m) for m in states}) > 60, 'sixty exchanges')
        said = {each.message for array in status for each in array.status if words in each.message}
    assert said
    end = states[-1].pose.pose.orientation
    assert so3.angle(so3.rotation_from_quaternion([end.w, end.x, end.y, end.z])) < 0.03
    assert not np.array([m.data for m in commands])[-20:, which].any()
