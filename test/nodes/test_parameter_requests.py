# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Requests to set parameters, in a node of this process: what is described before and after."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

import rclpy
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import String

from manifold_mpc_ros.cli.processes import reserved_domain
from manifold_mpc_ros.config.tables import CONTROLLER_PARAMETERS, SIMULATOR_PARAMETERS
from manifold_mpc_ros.nodes.controller import main as controller
from manifold_mpc_ros.nodes.controller.node import AttitudeControllerNode
from manifold_mpc_ros.nodes.managed_node import ManagedNode
from manifold_mpc_ros.nodes.simulator import main as simulator
from manifold_mpc_ros.nodes.simulator.node import LgviSimulatorNode

#: A weight is given as a whole number, as on a command line.
START = ['--ros-args', '-p', 'pointing.weight:=3', '-p', 'autostart:=false']


@pytest.fixture(scope='module', params=['controller', 'simulator'])
def node(request: pytest.FixtureRequest) -> Iterator[ManagedNode]:
    """Give a node that is configured."""
    with reserved_domain() as number:
        rclpy.init(args=START if request.param == 'controller' else START[:1] + START[3:],
                   domain_id=number, signal_handler_options=SignalHandlerOptions.NO)
        made = AttitudeControllerNode(controller.PROGRAM, complete=False) \
            if request.param == 'controller' \
            else LgviSimulatorNode(simulator.PROGRAM, complete=False)
        assert made.trigger_configure() == TransitionCallbackReturn.SUCCESS
        yield made
        made.destroy_node()
        rclpy.try_shutdown()


def asked(node: ManagedNode, values: dict[str, Any], *, together: bool = False
          ) -> list[SetParametersResult]:
    """Return what the node's service answers to a request."""
    kind = SetParametersAtomically if together else SetParameters
    service = next(each for each in node.services if each.srv_type is kind)
    request = kind.Request(parameters=[
        Parameter(name, value=value).to_parameter_msg() for name, value in values.items()])
    response = service.callback(request, kind.Response())
    return [response.result] if together else list(response.results)


def described(node: ManagedNode) -> dict[str, ParameterDescriptor]:
    """Return copies of all descriptors."""
    return {name: ParameterDescriptor(
        type=each.type, read_only=each.read_only, description=each.description,
        floating_point_range=each.floating_point_range, integer_range=each.integer_range)
        for name in node.list_parameters([], 0).names
        for each in [node.describe_parameter(name)]}


def values_of(node: ManagedNode) -> dict[str, Any]:
    return {name: parameter.value for name in node.list_parameters([], 0).names
            for parameter in [node.get_parameter(name)]}


@pytest.mark.parametrize('together', [False, True])
@pytest.mark.parametrize('wrong', [
    {'limits.max_torque_n_m': ['a', 'b', 'c']}, {'limits.max_torque_n_m': True},
    {'limits.max_torque_n_m': [1, 1]}, {'use_sim_time': True}, {'use_sim_time': 'yes'},
    {'lockstep': True}, {'body_frame_id': 3}, {'secure': 'maybe'}, {'nobody': 1},
    {'inertial_frame_id': 'inertial', 'limits.max_torque_n_m': 'three', 'autostart': True}])
def test_a_refused_set_leaves_types_descriptors_and_values(
    node: ManagedNode, wrong: dict[str, Any], together: bool,
) -> None:
    before, values = described(node), values_of(node)
    assert not all(each.successful for each in asked(node, wrong, together=together))
    assert described(node) == before
    assert values_of(node) == values


def test_the_dump_of_a_node_loads(node: ManagedNode) -> None:
    """Every parameter that it has, read-only ones and use_sim_time among them: no change."""
    before = values_of(node)
    assert before['use_sim_time'] is False
    for together in (False, True):
        assert all(each.successful for each in asked(node, before, together=together))
    assert values_of(node) == before
    whole = {name: [int(each) for each in value] for name, value in before.items()
             if isinstance(value, list) and not isinstance(value[0], str)
             and all(float(each).is_integer() for each in value)}
    assert all(each.successful for each in asked(node, whole))


def test_a_node_describes_itself_to_whoever_comes_late(node: ManagedNode) -> None:
    late, seen = Node('late'), []
    late.create_subscription(String, f'/{node.get_name()}/description', seen.append, QoSProfile(
        depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    executor = SingleThreadedExecutor()
    for each in (late, node):
        executor.add_node(each)
    until_s = time.monotonic() + 60.0
    while not seen and time.monotonic() < until_s:
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    late.destroy_node()
    said = json.loads(seen[0].data)
    assert said['node'] == f'/{node.get_name()}'
    assert said['backend'] == ('c' if isinstance(node, AttitudeControllerNode) else '')
    assert {'manifold_mpc_ros', 'numpy', 'python', 'rmw'} <= set(said['versions'])
    assert said['parameters'] == node._table.resolve()


def test_integers_stay_doubles(node: ManagedNode) -> None:
    before = described(node)
    assert [each.type for each in before.values()] == [
        node.get_parameter(name).type_.value for name in before]
    assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
    numbers = {'limits.max_torque_n_m': [1, 1, 2]} | ({
        'limits.max_rate_rad_s': 1, 'mpc.terminal_scale': 1, 'monitor.decrease_tolerance': 1,
        'mpc.step_s': 1} if isinstance(node, AttitudeControllerNode)
        else {'plant.step_s': 1, 'sensor.rate_noise_std_rad_s': 0})
    kept = values_of(node)
    assert all(each.successful for each in asked(node, numbers))
    for name in numbers:
        assert node.get_parameter(name).type_.value == before[name].type
        assert node.describe_parameter(name).type == before[name].type
    assert all(each.successful for each in asked(node, kept))
    assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS


def test_what_is_read_only_says_so_and_nothing_is_after_cleanup(node: ManagedNode) -> None:
    table = CONTROLLER_PARAMETERS if isinstance(node, AttitudeControllerNode) \
        else SIMULATOR_PARAMETERS
    other = {'bool': lambda value: not value, 'str': lambda value: value + 'x',
             'int': lambda value: value + 1, 'float': lambda value: value + 1e-3,
             'floats': lambda value: [1.5 * each for each in value],
             'strs': lambda value: [each + 'x' for each in value],
             'names': list}
    before = values_of(node)
    changes = {spec.name: list(spec.choices)[-1] if spec.choices else other[spec.kind](
        before[spec.name]) for spec in table} | {'use_sim_time': True}
    for name, change in changes.items():
        if node.describe_parameter(name).read_only and change != before[name]:
            (answer,) = asked(node, {name: change})
            assert not answer.successful
            assert 'deactivate and clean up first' in answer.reason
    fixed = {name for name in changes if node.describe_parameter(name).read_only}
    assert fixed == {'use_sim_time'} | {spec.name for spec in table if spec.read_only or (
        table is SIMULATOR_PARAMETERS)}
    assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
    assert not any(node.describe_parameter(name).read_only for name in changes)
    refused = [each.reason for each in asked(node, changes) if not each.successful]
    assert refused == []
    assert all(each.successful for each in asked(node, before))
    assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
