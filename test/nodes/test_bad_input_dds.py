# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The controller over DDS against states that it must not act on; the test holds the clock."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from bench import STEP_NS, TILTED, Bench, Edit, odometry, valid
from builtin_interfaces.msg import Time
from geometry_msgs.msg import QuaternionStamped
from harness import stamp_ns, torque_of
from nav_msgs.msg import Odometry
from std_srvs.srv import SetBool, Trigger
from watching import values_of

if TYPE_CHECKING:
    from harness import Rig

def not_a_number(state: Odometry) -> None:
    state.pose.pose.orientation.x = math.nan


def infinite_rate(state: Odometry) -> None:
    state.twist.twist.angular.y = math.inf


def no_quaternion(state: Odometry) -> None:
    state.pose.pose.orientation.x = state.pose.pose.orientation.w = 0.0


def another_frame(state: Odometry) -> None:
    state.header.frame_id = 'odom'


BAD = {
    'non_finite': not_a_number, 'quaternion_norm': no_quaternion, 'wrong_frame': another_frame}


def test_zero_until_a_valid_state_then_zero_when_it_is_old(rig: Rig) -> None:
    bench = Bench(rig, use_sim_time=True)
    bench.until(lambda: len(bench.torques) > 3, 'commands without any state')
    assert bench.value('mode') in ('', 'WAIT')
    for reason, edit in [*BAD.items(), ('non_finite', infinite_rate)]:
        key = f'refused.odometry.{reason}'
        before = int(bench.value(key) or 0)
        bench.until(lambda k=key, n=before: int(bench.value(k) or 0) > n + 2, reason, edit)
    assert "'odom'" in ''.join(
        values_of([array], 'attitude_controller').get('message', '')
        for array in bench.diagnostics)
    waiting = len(bench.torques)
    assert waiting > 5
    assert bench.norms()[:waiting].max() == 0.0

    bench.until(lambda: bench.norms()[-3:].min() > 0.0, 'torque on a valid state', valid)
    assert bench.value('mode') in ('WAIT', 'NOMINAL')
    last_state_ns = bench.now_ns
    bench.until(lambda: bench.value('mode') == 'COAST', 'a state that is too old')
    bench.until(lambda: bench.norms()[-3:].max() == 0.0, 'zero torque')
    after = [torque_of(m) for m in bench.torques if stamp_ns(m) == last_state_ns]
    acted = sum(any(torque) for torque in after)
    assert 4 <= acted <= 6  # five steps, give or take the edge
    assert bench.process.running

    bench.until(lambda: bench.norms()[-1] > 0.0, 'torque again', valid)


def test_stale_future_and_repeated_stamps_are_refused(rig: Rig) -> None:
    bench = Bench(rig, use_sim_time=True)
    bench.until(lambda: bench.value('mode') == 'NOMINAL', 'a valid state', valid)

    def shifted(seconds: int) -> Edit:
        def edit(state: Odometry) -> None:
            state.header.stamp.sec += seconds
        return edit

    def frozen(state: Odometry) -> None:
        state.header.stamp = Time(sec=first // 10**9, nanosec=first % 10**9)

    bench.until(lambda: bench.now_ns > 10 * 10**9, 'ten seconds', valid)
    bench.until(lambda: bool(bench.value('refused.odometry.future')), 'future', shifted(3))
    bench.until(lambda: bool(bench.value('refused.odometry.stale')), 'stale', shifted(-5))
    first = bench.now_ns + STEP_NS // 5
    bench.until(lambda: bool(bench.value('refused.odometry.duplicate')), 'duplicate', frozen)
    bench.until(lambda: bench.value('mode') == 'COAST', 'duplicates that keep nothing alive',
                frozen)
    before = int(bench.value('coast_ticks') or 0)
    ticks = int(bench.value('ticks') or 0)
    bench.until(lambda: int(bench.value('ticks') or 0) >= ticks + 5, 'five ticks more', frozen)
    assert int(bench.value('coast_ticks') or 0) - before >= 5
    assert bench.value('fallback_ticks') == bench.value('infeasible_ticks') == '0'


def test_time_that_goes_back_is_a_new_start(rig: Rig) -> None:
    """As after a bag that loops, or a simulator that was started again."""
    bench = Bench(rig, use_sim_time=True)
    bench.until(lambda: bench.now_ns > 12 * 10**9 and bench.value('mode') == 'NOMINAL',
                'twelve seconds', valid)
    bench.now_ns = 10**9
    bench.torques.clear()

    def commands_of_the_new_time() -> int:
        return sum(stamp_ns(m) < 8 * 10**9 and any(torque_of(m)) for m in bench.torques)

    bench.until(lambda: commands_of_the_new_time() > 3, 'commands in the new time', valid)
    assert bench.now_ns < 8 * 10**9


def test_both_signs_of_a_quaternion_give_the_same_bits(rig: Rig) -> None:
    bench = Bench(rig, lockstep=True)
    # exactly 180 degrees about an axis in general position, and a tilt
    for quaternion in [(2 / 7, -3 / 7, 6 / 7, 0.0), TILTED]:
        answers = []
        for sign in (1.0, -1.0):
            assert rig.call(Trigger, '/attitude_controller/reset', Trigger.Request()).success
            bench.now_ns += STEP_NS
            state = odometry(bench.now_ns, tuple(sign * x for x in quaternion))
            rig.tell(bench.states, state, lambda: bool(bench.torques) and (
                stamp_ns(bench.torques[-1]) == bench.now_ns), 'an answer')
            answers.append([x.hex() for x in torque_of(bench.torques[-1])])
        assert answers[0] == answers[1]
        assert any(torque_of(bench.torques[-1]))


def test_setpoints_are_checked_and_a_pause_commands_zero(rig: Rig) -> None:
    bench = Bench(rig, use_sim_time=True, initial_setpoint='hold')
    bench.until(lambda: bench.value('mode') == 'NOMINAL', 'a valid state', valid)
    assert bench.norms().max() < 1e-9  # holding where it is, at rest, takes nothing
    publisher = rig.node.create_publisher(QuaternionStamped, 'attitude_setpoint', 10)
    setpoint = QuaternionStamped()
    setpoint.header.frame_id = 'inertial'
    setpoint.quaternion.w = math.nan

    def aim(state: Odometry) -> None:
        valid(state)
        publisher.publish(setpoint)

    bench.until(lambda: bool(bench.value('refused.attitude_setpoint.non_finite')), 'refusal', aim)
    assert bench.value('setpoint') == 'initial'
    setpoint.quaternion.w = 1.0
    bench.until(lambda: bench.norms()[-1] > 0.01, 'torque towards the setpoint', aim)
    assert rig.call(SetBool, '/attitude_controller/pause', SetBool.Request(data=True)).success
    bench.until(lambda: bench.value('mode') == 'PAUSED' and bench.norms()[-2:].max() == 0.0,
                'a pause', valid)
    assert rig.call(SetBool, '/attitude_controller/pause', SetBool.Request(data=False)).success
    bench.until(lambda: bench.norms()[-1] > 0.01, 'torque again', valid)
