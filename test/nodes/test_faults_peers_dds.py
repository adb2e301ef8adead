# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The controller over DDS against peers that mean harm or know no better."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from bench import Bench, odometry, valid
from geometry_msgs.msg import QuaternionStamped, WrenchStamped
from harness import stamp_ns, torque_of
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from std_srvs.srv import Trigger

if TYPE_CHECKING:
    from harness import Rig

NODE = '/attitude_controller'


def parameter(name: str, kind: int, **value: Any) -> Parameter:
    return Parameter(name=name, value=ParameterValue(type=kind, **value))


def floats(name: str, *values: float) -> Parameter:
    return parameter(name, ParameterType.PARAMETER_DOUBLE_ARRAY, double_array_value=list(values))


NONSENSE = [
    parameter('mpc.horizon', 200),
    parameter('mpc.horizon', ParameterType.PARAMETER_NOT_SET),
    parameter('mpc.horizon', ParameterType.PARAMETER_STRING, string_value='long'),
    parameter('mpc.horizon', ParameterType.PARAMETER_INTEGER, integer_value=-1),
    parameter('', ParameterType.PARAMETER_BOOL, bool_value=True),
    parameter('no.such.thing', ParameterType.PARAMETER_BOOL, bool_value=True),
    parameter('mpc.step_s', ParameterType.PARAMETER_DOUBLE, double_value=0.1),
    parameter('use_sim_time', ParameterType.PARAMETER_BOOL, bool_value=False),
    parameter('use_sim_time', ParameterType.PARAMETER_NOT_SET),
    parameter('mpc.terminal_scale', ParameterType.PARAMETER_DOUBLE, double_value=math.nan),
    floats('spacecraft.inertia_kg_m2', 1.0, 0.3, 0.6),
    floats('limits.max_rate_rad_s', 5.0, 5.0, 5.0),
    floats('limits.max_torque_n_m', math.nan, 0.1, 0.1),
]


def test_requests_that_make_no_sense_are_refused_and_change_nothing(rig: Rig) -> None:
    bench = Bench(rig, use_sim_time=True)
    bench.until(lambda: bench.value('mode') == 'NOMINAL', 'a valid state', valid)
    answer = rig.call(SetParameters, f'{NODE}/set_parameters',
                      SetParameters.Request(parameters=NONSENSE))
    assert [result.successful for result in answer.results] == [False] * len(NONSENSE)
    assert all(result.reason for result in answer.results)
    together = SetParametersAtomically.Request(parameters=[
        floats('limits.max_torque_n_m', 0.2, 0.2, 0.2), NONSENSE[0]])
    assert not rig.call(
        SetParametersAtomically, f'{NODE}/set_parameters_atomically', together).result.successful
    names = ['', 'no.such.thing', 'limits.max_torque_n_m']
    assert not rig.call(GetParameters, f'{NODE}/get_parameters',
                        GetParameters.Request(names=names)).values
    rig.call(DescribeParameters, f'{NODE}/describe_parameters',
             DescribeParameters.Request(names=names))
    for number, label in [(0, ''), (1, ''), (30, ''), (255, ''), (99, 'configure'), (0, '\x00'),
                          (0, 'transition_error'), (Transition.TRANSITION_CONFIGURE, '')]:
        request = ChangeState.Request(transition=Transition(id=number, label=label))
        assert not rig.call(ChangeState, f'{NODE}/change_state', request).success
    value, = rig.call(GetParameters, f'{NODE}/get_parameters',
                      GetParameters.Request(names=names[2:])).values
    assert list(value.double_array_value) == [0.3, 0.3, 0.3]
    assert bench.value('parameter_changes') == '0'
    before = len(bench.torques)
    bench.until(lambda: len(bench.torques) > before + 2, 'commands after it all', valid)
    assert bench.value('mode') == 'NOMINAL'


def test_another_horizon_inertia_and_limit_take_over_between_two_ticks(rig: Rig) -> None:
    """All at once; while the solver is being built the old one goes on."""
    bench = Bench(rig, use_sim_time=True, **{'mpc.backend': 'c'})
    bench.until(lambda: bench.pulls(0.1), 'a torque', valid)
    request = SetParametersAtomically.Request(parameters=[
        parameter('mpc.horizon', ParameterType.PARAMETER_INTEGER, integer_value=12),
        floats('spacecraft.inertia_kg_m2', 0.5, 0.4, 0.4),
        floats('limits.max_rate_rad_s', 0.5, 0.5, 0.5),
        floats('limits.max_torque_n_m', 0.05, 0.04, 0.03)])
    result = rig.call(
        SetParametersAtomically, f'{NODE}/set_parameters_atomically', request).result
    assert (result.successful, result.reason) == (True, '')
    first = len(bench.torques)
    bench.until(lambda: bench.value('parameter_changes') == '1', 'the new law', valid)
    bench.until(lambda: bench.value('mode') == 'NOMINAL', 'its plans', valid)
    meanwhile = list(zip(bench.said('parameter_change'), bench.said('mode')))
    assert ('building', 'NOMINAL') in meanwhile
    assert len(bench.torques) > first
    assert bench.norms()[first:].max() > 0.1  # the old law, meanwhile
    last = torque_of(bench.torques[-1])
    assert all(abs(x) <= limit for x, limit in zip(last, (0.05, 0.04, 0.03)))
    assert any(last)


def test_bytes_that_are_no_message_are_dropped(rig: Rig) -> None:
    bench = Bench(rig, use_sim_time=True)
    setpoints = rig.node.create_publisher(QuaternionStamped, 'attitude_setpoint', 10)
    bench.until(lambda: bench.value('mode') == 'NOMINAL', 'a valid state', valid)
    rig.until(lambda: setpoints.get_subscription_count() > 0, 'the controller')
    good = bytes(serialize_message(odometry(bench.now_ns)))
    bad = [b'', good[:4], good[:-1], good[:41], b'\xff' * 40, good[:4] + b'\xff' * 200,
           b'\x00\x07\x00\x00' + good[4:], good[:12] + b'\xff\xff\xff\x7f' + good[16:],
           good[:16] + b'\xc3\x28\xff\xfe' + good[20:], good * 40]
    for data in bad:
        bench.states.publish(data)
        setpoints.publish(data)
        bench.tick(valid)
    before = len(bench.torques)
    bench.until(lambda: len(bench.torques) > before + 3 and bench.norms()[-1] > 0.0,
                'torques after it all', valid)
    assert bench.process.running


def test_a_subscriber_that_asks_for_too_much_is_named_by_its_policy(rig: Rig) -> None:
    bench = Bench(rig)
    rig.node.create_subscription(
        WrenchStamped, 'torque_command', print,
        QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    key = 'incompatible_qos.torque_command'
    rig.until(lambda: bench.value(key) == 'DURABILITY', 'the policy')


def test_two_publishers_of_the_state_latch_zero_until_a_reset(rig: Rig) -> None:
    bench = Bench(rig, use_sim_time=True)
    bench.until(bench.pulls, 'a torque', valid)
    second = rig.node.create_publisher(Odometry, 'odometry', 10)
    rig.until(lambda: second.get_subscription_count() > 0, 'the controller')

    def contradict(state: Odometry) -> None:
        second.publish(odometry(bench.now_ns + 1, (0.0, 0.0, 0.0, 1.0)))
        valid(state)

    bench.until(lambda: bench.value('mode') == 'FAULT', 'the fault', contradict)
    assert bench.value('message').startswith(
        'two publishers of odometry (zero until ~/reset)')
    rig.node.destroy_publisher(second)
    before = len(bench.torques)
    bench.until(lambda: len(bench.torques) > before + 3, 'commands', valid)
    assert bench.norms()[before + 1:].max() == 0.0
    assert bench.value('mode') == 'FAULT'
    assert rig.call(Trigger, f'{NODE}/reset', Trigger.Request()).success
    bench.until(bench.pulls, 'torque after the reset', valid)


def test_gaps_are_bridged_by_the_plan_and_the_clock_may_go_back(rig: Rig) -> None:
    bench = Bench(rig, use_sim_time=True)
    bench.until(lambda: bench.now_ns > 10**10 and bench.value('mode') == 'NOMINAL', 'torque',
                valid)
    bench.until(lambda: bench.value('mode') == 'HOLD', 'a gap')
    assert bench.value('command_source') == 'plan'
    assert bench.norms()[-1] > 0.0
    bench.until(lambda: bench.value('mode') == 'NOMINAL', 'states again', valid)
    first, bench.now_ns = len(bench.torques), 10**9
    bench.until(lambda: [stamp_ns(m) < 5 * 10**9 for m in bench.torques[first:]].count(True) > 2,
                'the new time', valid)
    new = [torque_of(m) for m in bench.torques[first:] if stamp_ns(m) < 5 * 10**9]
    assert new[0] == (0.0, 0.0, 0.0)
    bench.until(bench.pulls, 'torque in the new time', valid)


def test_a_clock_that_never_comes_is_said(rig: Rig) -> None:
    bench = Bench(rig, use_sim_time=True)
    rig.until(lambda: 'waiting for time on /clock' in bench.value('message'), 'the message')
    assert bench.value('mode') == 'WAIT'
    assert not bench.torques


def test_realtime_is_given_or_said_not_to_be(rig: Rig) -> None:
    bench = Bench(rig, **{'realtime.scheduler_priority': 60, 'realtime.lock_memory': True})
    rig.until(lambda: bool(bench.value('scheduling')), 'scheduling')
    said = [bench.value('scheduling'), bench.value('memory')]
    for value, given in zip(said, ('fifo 60', 'locked')):
        assert value == given or value.startswith('not permitted (')
    refused = any(value.startswith('not permitted') for value in said)
    assert refused == ('not permitted' in bench.process.log)
