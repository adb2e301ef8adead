# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cones over DDS: gone round, at every state; a direction comes by topic, bad ones are counted."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Odometry
from test_pointing_dds import direction_message
from watching import attitude, error_rad, values_of

from manifold_mpc_ros.config.cones import Cone

if TYPE_CHECKING:
    from harness import Rig

# The telescope's axis x turns by 120 degrees about z: through the Sun, but for the cone.
SUN = (0.5, math.sqrt(0.75), 0.0)
CONTROLLER = {
    'lockstep': True, 'autostart': False, 'mpc.horizon': 40, 'limits.max_rate_rad_s': [0.2],
    'cones.names': ['sun'], 'cones.sun.axis_B': [1.0, 0.0, 0.0],
    'cones.sun.half_angle_deg': 20.0, 'cones.sun.direction_N': [0.0, 0.0, -1.0],
    'cones.sun.direction_topic': 'sun_direction'}
SIMULATOR = {'lockstep': True, 'autostart': False,
             'plant.initial_attitude_xyzw': [0.0, 0.0, math.sqrt(0.75), 0.5]}


def test_a_cone_whose_direction_comes_by_topic_is_gone_round(rig: Rig) -> None:
    states = rig.watch(Odometry, 'odometry')
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    publisher = rig.node.create_publisher(Vector3Stamped, 'sun_direction', 10)
    rig.start('controller', parameters=CONTROLLER)
    rig.start('simulator', parameters=SIMULATOR)
    rig.activate('/attitude_controller')

    def said(key: str) -> bool:
        return key in values_of(diagnostics, 'attitude_controller')

    rig.until(lambda: said('refused.sun_direction.zero_direction'), 'a refusal',
              meanwhile=lambda: publisher.publish(direction_message((0.0, 0.0, 0.0))))
    for _ in range(3):
        publisher.publish(direction_message(SUN))
    rig.activate('/lgvi_simulator')
    rig.until(lambda: bool(states) and error_rad(states[-1]) < 1e-3, 'the target',
              meanwhile=lambda: publisher.publish(direction_message(SUN)))
    cone = Cone('sun', (1.0, 0.0, 0.0), SUN, math.radians(20.0))
    margins = [float(cone.margins_rad(attitude(each.pose.pose.orientation))) for each in states]
    assert min(margins) > 0.0
    assert min(margins) < 0.2  # it was in the way
    assert said('cone.sun.margin_deg')
    last = values_of(diagnostics, 'attitude_controller')['cone.sun.margin_deg']
    assert float(last) == pytest.approx(np.degrees(margins[-1]), abs=1.0)
