# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Both processes, with a torque that nobody declared and a delay that is declared wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped, WrenchStamped
from nav_msgs.msg import Odometry
from watching import is_settled, values_of

if TYPE_CHECKING:
    from harness import Rig

NODE = 'attitude_controller'
DISTURBANCE = [0.01, -0.01, 0.005]
DELAY_S, DECLARED_S = 0.65, 0.2


def test_what_is_not_declared_is_found_said_and_planned_with(rig: Rig) -> None:
    states = rig.watch(Odometry, 'odometry')
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    estimates = rig.watch(WrenchStamped, f'{NODE}/disturbance')
    deviations = rig.watch(Vector3Stamped, f'{NODE}/disturbance_std')
    rig.start('controller', parameters={
        'lockstep': True, 'disturbance.estimate': True,
        'actuators.actuation_delay_s': DECLARED_S})
    rig.start('simulator', parameters={
        'lockstep': True, 'plant.disturbance_torque_n_m': DISTURBANCE,
        'plant.actuation_delay_s': DELAY_S})
    rig.until(lambda: len(states) > 60 and is_settled(states) and bool(estimates)
              and bool(deviations), 'rest')
    torque = estimates[-1].wrench.torque
    np.testing.assert_allclose([torque.x, torque.y, torque.z], DISTURBANCE, atol=1e-3)
    assert 0.0 < deviations[-1].vector.x < 1e-2
    assert deviations[-1].header.frame_id == 'base_link'
    values = values_of(diagnostics, NODE)
    assert float(values['measured_delay_s']) == pytest.approx(DELAY_S, abs=0.1)
    assert values['planned_delay_s'] == values['measured_delay_s']
    assert any(f'not {DECLARED_S} s as declared' in status.message
               for array in diagnostics for status in array.status)
