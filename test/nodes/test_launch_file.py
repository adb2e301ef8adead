# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The launch file: what it imports, declares and starts.

The package launch is not on PyPI, so stand-ins record what the file asks it for.
"""

from __future__ import annotations

import ast
import runpy
import sys
import types
from pathlib import Path
from typing import Any

import pytest

FILE = Path(__file__).parents[2] / 'launch' / 'attitude_control.launch.py'
MODULES = {
    'launch': ['LaunchDescription'],
    'launch.actions': ['DeclareLaunchArgument'],
    'launch.conditions': ['IfCondition'],
    'launch.substitutions': ['LaunchConfiguration', 'PathJoinSubstitution'],
    'launch_ros': [],
    'launch_ros.actions': ['Node'],
    'launch_ros.parameter_descriptions': ['ParameterValue'],
    'launch_ros.substitutions': ['FindPackageShare'],
}


class Recorded:
    """One call of the launch file, with its arguments."""

    def __init__(self, name: str, args: tuple, kwargs: dict[str, Any]) -> None:
        self.name, self.args, self.kwargs = name, args, kwargs


@pytest.fixture
def entities(monkeypatch: pytest.MonkeyPatch) -> list[Recorded]:
    """Return what the launch description is made of."""
    for module, names in MODULES.items():
        fake = types.ModuleType(module)
        for name in names:
            setattr(fake, name, lambda *args, _name=name, **kwargs: Recorded(_name, args, kwargs))
        monkeypatch.setitem(sys.modules, module, fake)
    description = runpy.run_path(str(FILE))['generate_launch_description']()
    return description.args[0]


def test_it_imports_launch_and_launch_ros_and_nothing_else() -> None:
    imported = {node.module for node in ast.walk(ast.parse(FILE.read_text(encoding='utf-8')))
                if isinstance(node, ast.ImportFrom)}
    assert imported <= set(MODULES)
    assert not [node for node in ast.walk(ast.parse(FILE.read_text(encoding='utf-8')))
                if isinstance(node, ast.Import)]


def test_arguments(entities: list[Recorded]) -> None:
    declared = {entity.args[0]: entity.kwargs for entity in entities
                if entity.name == 'DeclareLaunchArgument'}
    assert set(declared) == {
        'namespace', 'controller_params', 'simulator_params', 'use_sim_time', 'with_simulator',
        'enclaves', 'markers', 'respawn', 'rviz'}
    assert all(kwargs['description'] for kwargs in declared.values())
    for name, file in [('controller_params', 'controller'), ('simulator_params', 'simulator')]:
        share, folder, yaml = declared[name]['default_value'].args[0]
        assert (share.args[0], folder, yaml) == ('manifold_mpc_ros', 'config', f'{file}.yaml')
        assert (FILE.parents[1] / folder / yaml).exists()


def test_nodes(entities: list[Recorded]) -> None:
    nodes = {entity.kwargs['executable']: entity.kwargs for entity in entities
             if entity.name == 'Node'}
    assert set(nodes) == {'controller', 'simulator', 'markers', 'rviz2'}
    assert nodes['markers']['namespace'].args[0] == 'namespace'
    for executable, policy in (('controller', 'attitude_controller'), (
            'simulator', 'lgvi_simulator'), ('markers', 'attitude_markers')):
        flag, (where, name) = nodes[executable]['ros_arguments']
        assert (flag, where.args[0], name) == ('--enclave', 'enclaves', f'/{policy}')
        assert (FILE.parents[1] / 'config' / 'sros2' / f'{policy}.xml').exists()
    for executable in ('controller', 'simulator'):
        kwargs = nodes[executable]
        assert kwargs['package'] == 'manifold_mpc_ros'
        assert kwargs['namespace'].args[0] == 'namespace'
        assert (kwargs['respawn'].args[0], kwargs['respawn_delay']) == ('respawn', 0.5)
        assert kwargs['parameters'][0].args[0] == f'{executable}_params'
    for executable, argument in (
        ('simulator', 'with_simulator'), ('markers', 'markers'), ('rviz2', 'rviz')):
        assert nodes[executable]['condition'].args[0].args[0] == argument
    _, folder, file = nodes['rviz2']['arguments'][1].args[0]
    assert (FILE.parents[1] / folder / file).exists()
    assert 'condition' not in nodes['controller']
    for executable, key in [('controller', 'use_sim_time'), ('simulator', 'timing.publish_clock')]:
        value = nodes[executable]['parameters'][1][key]
        assert value.kwargs['value_type'] is bool
        assert value.args[0].args[0] == 'use_sim_time'
