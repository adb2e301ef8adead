# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Start the attitude controller, and a simulated spacecraft unless there is a real one.

ros2 launch manifold_mpc_ros attitude_control.launch.py namespace:=sat1 with_simulator:=false
ros2 launch manifold_mpc_ros attitude_control.launch.py odometry:=/ekf/odometry rviz:=true

Everything that can fail is resolved before the first process starts, and the controller starts
last; when it or the simulator ends, what was started beside it ends too, and when launch itself
is killed, every node does.
"""

from __future__ import annotations

from pathlib import Path
from shutil import which

from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    OpaqueFunction,
    RegisterEventHandler,
)
from launch.event_handlers import OnProcessExit
from launch.events import matches_action
from launch.events.process import ShutdownProcess
from launch.launch_context import LaunchContext
from launch.launch_description_entity import LaunchDescriptionEntity
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import ExecutableInPackage, FindPackageShare

from launch import LaunchDescription

PACKAGE = 'manifold_mpc_ros'
RESPAWN_DELAY_S = 0.5
#: Of the controller, with guidance: anything above zero lets it listen.
REFERENCE_TIMEOUT_S = 30.0
#: Linux sends a node SIGINT, as Ctrl-C does, when the process that started it is no more.
END_WITH_LAUNCH = 'setpriv --pdeathsig INT '
TOPICS = {
    'odometry': 'states, controller and simulator',
    'imu': "states, the controller's other input",
    'attitude_setpoint': 'commanded attitude',
    'direction_setpoint': 'commanded direction (target: pointing)',
    'reference': 'commanded attitudes over time',
    'odometry_setpoint': 'commanded attitude that goes on at its rate',
    'sun_direction': 'where the Sun is, from guidance',
    'torque_command': 'body torque, controller and simulator',
    'clock': 'simulated time; clock:=clock gives each namespace a time of its own',
}
NODES = {'controller': 'attitude_controller', 'simulator': 'lgvi_simulator',
         'guidance': 'attitude_guidance', 'markers': 'attitude_markers'}
BOOLEANS = {'true': True, '1': True, 'false': False, '0': False}


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments, and what starts the nodes, which activate themselves."""
    return LaunchDescription([
        _argument('namespace', '', 'namespace of the nodes'),
        _argument('enclaves', '',
                  'where the enclaves attitude_controller, lgvi_simulator and '
                  'attitude_markers are in the keystore, like /sat1'),
        _argument('controller_params', _shipped('controller.yaml'),
                  'parameter file of the controller'),
        _argument('simulator_params', _shipped('simulator.yaml'),
                  'parameter file of the simulator'),
        _argument('guidance_params', _shipped('guidance.yaml'),
                  'parameter file of guidance'),
        _argument('use_sim_time', 'false', 'time comes from the topic of the argument clock'),
        _argument('publish_clock', LaunchConfiguration('use_sim_time'),
                  'the simulator publishes that time; false: it follows one that is there'),
        _argument('with_simulator', 'true', 'start the simulated spacecraft too'),
        _argument('with_guidance', 'false',
                  'start guidance too, and let the controller follow it'),
        _argument('respawn', 'false', 'start a node again when it has ended'),
        _argument('markers', 'true',
                  'start the node that draws for RViz and Foxglove, when they look'),
        _argument('rviz', 'false', 'start RViz too (topics without a namespace)'),
        *(_argument(name, _default_topic(name), f'topic: {meaning}')
          for name, meaning in TOPICS.items()),
        OpaqueFunction(function=_start),
    ])


def _argument(
    name: str, default: str | LaunchConfiguration | PathJoinSubstitution, description: str,
) -> DeclareLaunchArgument:
    """Declare one argument."""
    return DeclareLaunchArgument(name, default_value=default, description=description)


def _shipped(name: str) -> PathJoinSubstitution:
    """Return the path of a file in this package's folder config."""
    return PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', name])


def _default_topic(name: str) -> str:
    """Return the topic's name without an argument: the clock alone is outside namespaces."""
    return '/clock' if name == 'clock' else name


def _start(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Return the nodes in the order of their start; raise ValueError before the first of them."""
    flag = {name: _flag(context, name) for name in (
        'use_sim_time', 'publish_clock', 'with_simulator', 'with_guidance', 'respawn', 'markers',
        'rviz')}
    if flag['publish_clock'] and not flag['use_sim_time']:
        raise ValueError('publish_clock: true needs use_sim_time: true, or the controller '
                         'refuses states of another time')
    respawn = {'respawn': flag['respawn'], 'respawn_delay': RESPAWN_DELAY_S}
    follow = {'use_sim_time': flag['use_sim_time']}
    nodes = {}
    if flag['rviz']:
        config = str(_file(context, 'rviz', _shipped('attitude.rviz').perform(context)))
        nodes['rviz'] = _node(context, 'rviz2', 'rviz2', [follow], arguments=['-d', config])
    if flag['markers']:
        nodes['markers'] = _node(context, PACKAGE, 'markers', [follow])
    if flag['with_simulator']:
        nodes['simulator'] = _node(
            context, PACKAGE, 'simulator',
            [_file(context, 'simulator_params'), {
                'timing.publish_clock': flag['publish_clock'],
                'use_sim_time': flag['use_sim_time'] and not flag['publish_clock']}], **respawn)
    listen = {}
    if flag['with_guidance']:
        nodes['guidance'] = _node(
            context, PACKAGE, 'guidance', [_file(context, 'guidance_params'), follow], **respawn)
        listen = {'reference.timeout_s': REFERENCE_TIMEOUT_S}
    nodes['controller'] = _node(
        context, PACKAGE, 'controller',
        [_file(context, 'controller_params'), {**follow, **listen}], **respawn)
    ends = [] if flag['respawn'] else [
        _end_together(nodes[name], [node for other, node in nodes.items() if other != name])
        for name in ('simulator', 'controller') if name in nodes]
    return [*ends, *nodes.values()]


def _node(
    context: LaunchContext, package: str, executable: str, parameters: list, **options: object,
) -> Node:
    """Return a node in the namespace, under the chosen topics, whose executable is there."""
    ExecutableInPackage(package=package, executable=executable).perform(context)
    namespace = _text(context, 'namespace')
    topics = {_default_topic(name): _text(context, name) for name in TOPICS}
    if package == PACKAGE:
        options['namespace'] = namespace
        options['ros_arguments'] = _enclave(context, executable)
    elif not topics['/clock'].startswith('/'):
        topics['/clock'] = '/'.join(['', namespace.strip('/'), topics['/clock']])
    prefix = [END_WITH_LAUNCH if which('setpriv') else '',
              LaunchConfiguration('launch-prefix', default='')]
    return Node(
        package=package, executable=executable, exec_name=executable, prefix=prefix,
        output='screen', parameters=parameters,
        remappings=[(name, topic) for name, topic in topics.items() if name != topic], **options)


def _enclave(context: LaunchContext, executable: str) -> list[str]:
    """Return the arguments that put a node into the enclave of its name; only security looks."""
    return ['--enclave', f'{_text(context, "enclaves")}/{NODES[executable]}']


def _end_together(node: Node, others: list[Node]) -> RegisterEventHandler:
    """Return what ends the others when a node has ended."""
    return RegisterEventHandler(OnProcessExit(target_action=node, on_exit=[
        EmitEvent(event=ShutdownProcess(process_matcher=matches_action(other)))
        for other in others]))


def _text(context: LaunchContext, name: str) -> str:
    """Return the value of an argument."""
    return LaunchConfiguration(name).perform(context)


def _flag(context: LaunchContext, name: str) -> bool:
    """Return an argument that is true or false; raise ValueError for another value."""
    text = _text(context, name)
    if text.strip().lower() not in BOOLEANS:
        raise ValueError(f'{name}: {text!r} is not valid; expected true or false')
    return BOOLEANS[text.strip().lower()]


def _file(context: LaunchContext, name: str, path: str | None = None) -> Path:
    """Return a file that is there; raise ValueError for one that is not."""
    file = Path(_text(context, name) if path is None else path)
    if not file.is_file():
        raise ValueError(f'{name}: {str(file)!r} is not valid; expected an existing file')
    return file
