# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The launch file: what it imports, declares, refuses and starts.

The package launch is not on PyPI, so stand-ins record what the file asks it for. Where it is
there, test_launch_run.py starts the file for real.
"""

from __future__ import annotations

import ast
import runpy
import sys
import types
from pathlib import Path
from shutil import which
from typing import Any

import pytest

REPOSITORY = Path(__file__).parents[2]
FILE = REPOSITORY / 'launch' / 'attitude_control.launch.py'
MODULES = {
    'launch': ['LaunchDescription'],
    'launch.actions': [
        'DeclareLaunchArgument', 'EmitEvent', 'OpaqueFunction', 'RegisterEventHandler'],
    'launch.event_handlers': ['OnProcessExit'],
    'launch.events': ['matches_action'],
    'launch.events.process': ['ShutdownProcess'],
    'launch.launch_context': ['LaunchContext'],
    'launch.launch_description_entity': ['LaunchDescriptionEntity'],
    'launch.substitutions': ['LaunchConfiguration', 'PathJoinSubstitution'],
    'launch_ros': [],
    'launch_ros.actions': ['Node'],
    'launch_ros.substitutions': ['ExecutableInPackage', 'FindPackageShare'],
}
TOPICS = {'odometry', 'imu', 'attitude_setpoint', 'direction_setpoint', 'reference',
          'odometry_setpoint', 'sun_direction', 'torque_command', 'clock'}


class Recorded:
    """One call of the launch file, with its arguments."""

    def __init__(self, name: str, args: tuple, kwargs: dict[str, Any]) -> None:
        self.name, self.args, self.kwargs = name, args, kwargs

    def perform(self, context: dict[str, str]) -> str:
        """Return the text of a substitution, like launch does."""
        if self.name == 'LaunchConfiguration':
            return context[self.args[0]]
        if self.name == 'PathJoinSubstitution':
            return '/'.join(part if isinstance(part, str) else part.perform(context)
                            for part in self.args[0])
        if self.name == 'ExecutableInPackage' and self.kwargs['package'] != 'manifold_mpc_ros':
            raise LookupError(f'package {self.kwargs["package"]!r} not found')
        return str(REPOSITORY)


class Launch:
    """The launch description, and what it starts for given arguments."""

    def __init__(self) -> None:
        self.entities = runpy.run_path(str(FILE))['generate_launch_description']().args[0]
        self.declared = {entity.args[0]: entity.kwargs for entity in self.entities
                         if entity.name == 'DeclareLaunchArgument'}

    def start(self, **arguments: str) -> list[Recorded]:
        """Return what is started, in its order."""
        context: dict[str, str] = {}
        for name, kwargs in self.declared.items():
            default = kwargs['default_value']
            context[name] = arguments.get(
                name, default if isinstance(default, str) else default.perform(context))
        assert set(arguments) <= set(context)
        return self.entities[-1].kwargs['function'](context)

    def nodes(self, **arguments: str) -> dict[str, dict[str, Any]]:
        """Return the nodes that are started, in their order."""
        return {entity.kwargs['executable']: entity.kwargs
                for entity in self.start(**arguments) if entity.name == 'Node'}


@pytest.fixture
def launch(monkeypatch: pytest.MonkeyPatch) -> Launch:
    """Return the launch file, run with stand-ins."""
    for module, names in MODULES.items():
        fake = types.ModuleType(module)
        for name in names:
            setattr(fake, name, lambda *args, _name=name, **kwargs: Recorded(_name, args, kwargs))
        monkeypatch.setitem(sys.modules, module, fake)
    return Launch()


def test_it_imports_launch_and_launch_ros_and_nothing_else() -> None:
    tree = ast.parse(FILE.read_text(encoding='utf-8'))
    imported = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert imported <= {*MODULES, '__future__', 'pathlib', 'shutil'}
    assert not [node for node in ast.walk(tree) if isinstance(node, ast.Import)]


def test_arguments(launch: Launch) -> None:
    assert set(launch.declared) == {
        'namespace', 'enclaves', 'controller_params', 'simulator_params', 'use_sim_time',
        'publish_clock', 'with_simulator', 'with_guidance', 'guidance_params', 'markers',
        'respawn', 'rviz', *TOPICS}
    assert all(kwargs['description'] for kwargs in launch.declared.values())


def test_nodes_and_their_order(launch: Launch) -> None:
    """What may be missing comes first, the node that commands torque last."""
    assert launch.entities[-1].name == 'OpaqueFunction'
    nodes = launch.nodes(namespace='sat1', enclaves='/sat1')
    assert list(nodes) == ['markers', 'simulator', 'controller']
    for name, kwargs in nodes.items():
        assert (kwargs['package'], kwargs['namespace']) == ('manifold_mpc_ros', 'sat1')
        assert kwargs['remappings'] == []
        assert kwargs['exec_name'] == name
        assert kwargs['prefix'][0] == ('setpriv --pdeathsig INT ' if which('setpriv') else '')
        flag, enclave = kwargs['ros_arguments']
        assert (flag, enclave.rpartition('/')[0]) == ('--enclave', '/sat1')
        assert (REPOSITORY / 'config' / 'sros2' / f'{Path(enclave).name}.xml').exists()
        if name != 'markers':
            assert (kwargs['respawn'], kwargs['respawn_delay']) == (False, 0.5)
            assert kwargs['parameters'][0] == REPOSITORY / 'config' / f'{name}.yaml'
    assert list(launch.nodes(with_simulator='0', markers='FALSE')) == ['controller']


@pytest.mark.parametrize(('arguments', 'controller', 'publishes', 'follows'), [
    ({}, False, False, False),
    ({'use_sim_time': 'true'}, True, True, False),
    ({'use_sim_time': 'True', 'publish_clock': 'false'}, True, False, True)])
def test_times(launch: Launch, arguments: dict[str, str], controller: bool, publishes: bool,
               follows: bool) -> None:
    nodes = launch.nodes(**arguments)
    assert nodes['controller']['parameters'][1] == {'use_sim_time': controller}
    assert nodes['markers']['parameters'] == [{'use_sim_time': controller}]
    assert nodes['simulator']['parameters'][1] == {
        'timing.publish_clock': publishes, 'use_sim_time': follows}


@pytest.mark.parametrize('topic', sorted(TOPICS))
def test_topics_are_remapped(launch: Launch, topic: str) -> None:
    source = '/clock' if topic == 'clock' else topic
    for kwargs in launch.nodes(**{topic: 'other'}).values():
        assert kwargs['remappings'] == [(source, 'other')]


@pytest.mark.parametrize(('arguments', 'words'), [
    ({'rviz': 'true'}, "'rviz2' not found"),
    ({'controller_params': '/nowhere.yaml'}, "controller_params: '/nowhere.yaml' is not valid"),
    ({'simulator_params': '/nowhere.yaml'}, "simulator_params: '/nowhere.yaml' is not valid"),
    ({'publish_clock': 'true'}, 'publish_clock: true needs use_sim_time: true'),
    *(({name: 'perhaps'}, f"{name}: 'perhaps' is not valid; expected true or false")
      for name in ('use_sim_time', 'publish_clock', 'with_simulator', 'respawn', 'markers',
                   'rviz'))])
def test_what_can_fail_fails_before_a_node_starts(
    launch: Launch, arguments: dict[str, str], words: str) -> None:
    with pytest.raises((ValueError, LookupError), match=words):
        launch.start(**arguments)


def test_the_simulator_s_file_is_not_asked_for_without_it(launch: Launch) -> None:
    assert 'simulator' not in launch.nodes(
        with_simulator='false', simulator_params='/nowhere.yaml')


def test_nodes_end_together_unless_they_are_started_again(launch: Launch) -> None:
    def ends(**arguments: str) -> dict[str, set[str]]:
        found = {}
        for entity in launch.start(**arguments):
            if entity.name == 'RegisterEventHandler':
                exit_of = entity.args[0].kwargs
                matchers = [action.kwargs['event'].kwargs['process_matcher']
                            for action in exit_of['on_exit']]
                found[exit_of['target_action'].kwargs['executable']] = {
                    matcher.args[0].kwargs['executable'] for matcher in matchers}
        return found

    assert ends() == {'simulator': {'controller', 'markers'}, 'controller': {'simulator',
                                                                             'markers'}}
    assert ends(with_simulator='false') == {'controller': {'markers'}}
    assert ends(respawn='true') == {}
