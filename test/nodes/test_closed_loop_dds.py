# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Controller and simulator as two processes over DDS: every start ends at the setpoint."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import QuaternionStamped, WrenchStamped
from harness import stamp_ns, torque_of
from nav_msgs.msg import Odometry, Path
from std_srvs.srv import Trigger
from watching import error_rad, is_settled, rate_rad_s, settling_time_s, values_of

if TYPE_CHECKING:
    from harness import Rig

LOCKSTEP = {'lockstep': True}
BY_HAND = {'autostart': False}
MAX_TORQUE_N_M = 0.3
MAX_RATE_RAD_S = 0.6
STEP_NS = 500_000_000

# exactly 180 degrees about z at rest (the shipped start), about a skew axis, and a tumble
HALF_TURN: dict[str, Any] = {}
SKEW_HALF_TURN = {'plant.initial_attitude_xyzw': [2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0, 0.0]}
TUMBLE = {
    'plant.initial_attitude_xyzw': [0.5, -0.5, 0.5, 0.5],
    'plant.initial_rate_rad_s': [0.12, -0.14, 0.08],
}


@pytest.mark.parametrize('start', [HALF_TURN, SKEW_HALF_TURN, TUMBLE])
def test_settles_in_lockstep_within_the_limits(rig: Rig, start: dict[str, Any]) -> None:
    states, torques = rig.watch(Odometry, 'odometry'), rig.watch(WrenchStamped, 'torque_command')
    rig.start('controller', parameters=LOCKSTEP | BY_HAND)
    rig.start('simulator', parameters=LOCKSTEP | BY_HAND | start)
    rig.activate('/attitude_controller')
    rig.activate('/lgvi_simulator')
    rig.until(lambda: is_settled(states), 'rest at the setpoint')
    assert error_rad(states[0]) > math.radians(100.0)
    assert settling_time_s(states) < 40.0
    rig.until(lambda: len(torques) > 20, 'torques, of which a slow reader loses some')
    commands = np.array([torque_of(message) for message in torques])
    assert np.abs(commands).max() <= MAX_TORQUE_N_M
    answered = [stamp_ns(message) for message in torques]
    assert answered == sorted(answered)
    rig.until(lambda: stamp_ns(states[-1]) >= answered[-1], 'the states that were answered')
    assert {stamp % STEP_NS for stamp in answered} == {stamp_ns(states[0]) % STEP_NS}
    fastest_rad_s = max(np.abs(rate_rad_s(state)).max() for state in states)
    assert 0.1 < fastest_rad_s <= MAX_RATE_RAD_S + 1e-3


def test_settles_with_simulated_time_twenty_times_real_time(rig: Rig) -> None:
    states = rig.watch(Odometry, 'odometry')
    rig.start('controller', parameters={'use_sim_time': True})
    rig.start('simulator', parameters=BY_HAND | {
        'timing.publish_clock': True, 'timing.real_time_factor': 20.0})
    rig.activate('/lgvi_simulator')
    rig.until(lambda: is_settled(states), 'rest at the setpoint')
    assert error_rad(states[0]) > math.radians(100.0)
    gaps = np.diff([stamp_ns(state) for state in states])
    assert np.median(gaps) <= 0.5e9 / 5  # at least five states in a control step


def test_turns_in_real_time_by_the_imu(rig: Rig) -> None:
    """A small turn, so that the clock on the wall has little to wait for."""
    states = rig.watch(Odometry, 'odometry')
    rig.start('controller', parameters={'state_source': 'imu'})
    turn = math.radians(10.0) / 2.0
    rig.start('simulator', parameters=BY_HAND | {
        'plant.initial_attitude_xyzw': [0.0, math.sin(turn), 0.0, math.cos(turn)]})
    rig.activate('/lgvi_simulator')
    rig.until(lambda: bool(states) and error_rad(states[-1]) < math.radians(1.0), 'one degree')
    assert error_rad(states[0]) > math.radians(5.0)


def test_namespace_and_remapped_topics(rig: Rig) -> None:
    states, torques = rig.watch(Odometry, '/sat1/state'), rig.watch(WrenchStamped, '/wheels')
    remap = {'__ns': '/sat1', 'odometry': 'state', 'torque_command': '/wheels'}
    rig.start('controller', parameters=LOCKSTEP, remap=remap)
    rig.start('simulator', parameters=LOCKSTEP, remap=remap)
    rig.until(lambda: is_settled(states) and bool(torques), 'rest at the setpoint')
    topics = dict(rig.node.get_topic_names_and_types())
    assert not {'/odometry', '/torque_command', '/sat1/odometry'} & set(topics)
    assert '/sat1/attitude_controller/prediction' in topics


def test_a_setpoint_is_reached_and_a_reset_returns_to_the_initial_one(rig: Rig) -> None:
    states, paths = rig.watch(Odometry, 'odometry'), rig.watch(Path, (
        '/attitude_controller/prediction'))
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    target = (0.5, 0.5, -0.5, 0.5)
    setpoint = QuaternionStamped()
    setpoint.header.frame_id = 'inertial'
    setpoint.quaternion.x, setpoint.quaternion.y, setpoint.quaternion.z, setpoint.quaternion.w = (
        target)
    publisher = rig.node.create_publisher(QuaternionStamped, 'attitude_setpoint', 10)
    rig.start('controller', parameters=LOCKSTEP)
    rig.until(lambda: publisher.get_subscription_count() > 0, 'the controller')
    rig.start('simulator', parameters=LOCKSTEP)
    rig.until(lambda: values_of(diagnostics, 'attitude_controller').get('setpoint') == 'commanded',
              'the setpoint', meanwhile=lambda: publisher.publish(setpoint))
    rig.until(lambda: is_settled(states, target), 'rest at the setpoint')
    rig.until(lambda: bool(paths), 'a prediction, which has a reader once this one is known')
    assert len(paths[-1].poses) == 21
    assert paths[-1].header.frame_id == 'inertial'
    assert rig.call(Trigger, '/attitude_controller/reset', Trigger.Request()).success
    rig.until(lambda: is_settled(states), 'rest at the identity')
