# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Guidance over DDS: what it publishes, a mode that changes in flight, and a loop that follows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from harness import stamp_ns
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from trajectory_msgs.msg import MultiDOFJointTrajectory
from watching import attitude, values_of

from manifold_mpc_ros.control.guidance.orbit import sun_direction_N
from manifold_mpc_ros.nodes.messages import vector_values

if TYPE_CHECKING:
    from harness import Rig

NODE, SLOW = 'attitude_guidance', 5e-4


def test_a_loop_follows_it_and_a_mode_may_change(rig: Rig) -> None:
    references = rig.watch(MultiDOFJointTrajectory, 'reference')
    suns = rig.watch(Vector3Stamped, 'sun_direction')
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    rig.start('guidance', parameters={
        'mode': 'spin', 'spin_rate_rad_s': SLOW, 'period_s': 1.0, 'ahead_s': 30.0,
        'attitude_xyzw': [0.0, 0.0, 0.0, 1.0], 'orbit.epoch_s': 1.7e9})
    rig.start('controller', parameters={'reference.timeout_s': 5.0})
    rig.start('simulator')

    def said(node: str, key: str) -> str:
        return values_of(diagnostics, node).get(key, '')

    rig.until(lambda: said('attitude_controller', 'target') == 'moving' and float(
        said('attitude_controller', 'attitude_error_deg') or 'inf') < 0.01, 'no lag')
    assert said('attitude_controller', 'target_jumps') == '1'
    rig.until(lambda: bool(said(NODE, 'rate_rad_s')), 'what guidance says')
    assert float(said(NODE, 'rate_rad_s')) == pytest.approx(SLOW)
    spin = references[-1]
    assert len(spin.points) == 32
    np.testing.assert_allclose(
        [vector_values(point.velocities[0].angular) for point in spin.points],
        np.tile([0.0, 0.0, SLOW], (32, 1)), atol=1e-7)

    def change(name: str, value: object) -> None:
        answer = rig.call(SetParameters, f'/{NODE}/set_parameters', SetParameters.Request(
            parameters=[Parameter(name, value=value).to_parameter_msg()]))
        assert answer.results[0].successful, answer.results[0].reason

    change('mode', 'sun')
    rig.until(lambda: said(NODE, 'mode') == 'sun', 'the mode')
    sun = sun_direction_N(np.array([stamp_ns(suns[-1])]))[0]
    np.testing.assert_allclose(vector_values(suns[-1].vector), sun, atol=1e-9)
    rig.until(lambda: np.abs(attitude(references[-1].points[0].transforms[0].rotation)[:, 2]
                             - sun).max() < 1e-6, 'the Sun')
    rig.until(lambda: int(said('attitude_controller', 'target_jumps')) > 1, 'the jump')
    change('mode', 'target')
    rig.until(lambda: bool(said(NODE, 'elevation_deg')), 'the target')
