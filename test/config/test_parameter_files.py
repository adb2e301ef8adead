# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameter files: the shipped ones, the forms ROS knows, and every mistake in them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig, SimulatorConfig
from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.guidance import GUIDANCE_NAME, GUIDANCE_PARAMETERS
from manifold_mpc_ros.config.parameter import ParameterSpec, resolve_parameters
from manifold_mpc_ros.config.tables import (
    CONTROLLER_NAME,
    CONTROLLER_PARAMETERS,
    MARKERS_NAME,
    SIMULATOR_NAME,
    SIMULATOR_PARAMETERS,
)
from manifold_mpc_ros.config.yaml_file import read_parameter_file, sections_of
from manifold_mpc_ros.dynamics.inertia import nonstandard_inertia
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3

CONFIG = Path(__file__).parents[2] / 'config'
SHIPPED = [
    (CONFIG / 'controller.yaml', CONTROLLER_NAME, CONTROLLER_PARAMETERS),
    (CONFIG / 'simulator.yaml', SIMULATOR_NAME, SIMULATOR_PARAMETERS),
    (CONFIG / 'guidance.yaml', GUIDANCE_NAME, GUIDANCE_PARAMETERS),
]
ALL_SPECS = CONTROLLER_PARAMETERS + SIMULATOR_PARAMETERS


def write(folder: Path, document: Any) -> Path:
    path = folder / 'parameters.yaml'
    path.write_text(
        document if isinstance(document, str) else yaml.safe_dump(document), encoding='utf-8')
    return path


def parameters() -> dict[str, Any]:
    """Return the nested groups of the shipped controller file."""
    document = yaml.safe_load((CONFIG / 'controller.yaml').read_text(encoding='utf-8'))
    (section,) = document.values()
    return section['ros__parameters']


@pytest.mark.parametrize(('path', 'node', 'specs'), SHIPPED)
def test_the_shipped_files_say_what_the_tables_say(
    path: Path, node: str, specs: tuple[ParameterSpec, ...],
) -> None:
    """So a node without a parameter file does the same as one with the shipped file."""
    given = read_parameter_file(path, node)
    assert list(given) == [spec.name for spec in specs]
    assert given == {spec.name: spec.default for spec in specs}
    assert resolve_parameters(specs, given, complete=True) == (
        resolve_parameters(specs, {}, complete=False))


def test_the_shipped_spacecraft_is_the_same_in_both() -> None:
    controller = ControllerConfig.from_yaml(CONFIG / 'controller.yaml')
    plant = SimulatorConfig.from_yaml(CONFIG / 'simulator.yaml')
    np.testing.assert_array_equal(controller.mpc.inertia_kg_m2, plant.inertia_kg_m2)
    np.testing.assert_array_equal(controller.mpc.max_torque_n_m, plant.max_torque_n_m)
    np.testing.assert_allclose(
        controller.mpc.rate_weight, nonstandard_inertia(plant.inertia_kg_m2), atol=1e-15)
    assert plant.control_period_s == controller.mpc.step_s
    assert plant.state_period_s <= controller.mpc.step_s / 5.0
    assert controller.body_frame_id == plant.body_frame_id
    assert controller.inertial_frame_id == plant.inertial_frame_id
    x, y, z, w = plant.initial_attitude_xyzw
    assert so3.angle(so3.rotation_from_quaternion([w, x, y, z])) == np.pi


@pytest.mark.parametrize('spec', ALL_SPECS)
def test_every_parameter_is_described_and_has_a_valid_default(spec: ParameterSpec) -> None:
    assert spec.description
    assert spec.check(spec.default) == spec.default
    numeric = spec.kind in ('float', 'floats')
    suffix = re.search(r'_(n_m_s|s|rad|rad_s|n_m|kg_m2)$', spec.name)
    if suffix:
        unit = {'s': 's', 'rad': 'rad', 'rad_s': 'rad/s', 'n_m': 'N m', 'n_m_s': 'N m s',
                'kg_m2': 'kg m^2'}
        assert spec.unit == unit[suffix.group(1)]
    if numeric:
        assert spec.unit
    assert (spec.low is None) == (spec.high is None)


@pytest.mark.parametrize('section', [
    CONTROLLER_NAME, f'/{CONTROLLER_NAME}', f'/sat1/{CONTROLLER_NAME}', f'/**/{CONTROLLER_NAME}',
    '/**', '/*'])
def test_keys_of_a_section(tmp_path: Path, section: str) -> None:
    path = write(tmp_path, {section: {'ros__parameters': parameters()}})
    assert AttitudeMpcConfig.from_yaml(path).horizon == parameters()['mpc']['horizon']


def test_nested_sections_other_nodes_and_wildcards(tmp_path: Path) -> None:
    path = write(tmp_path, {
        '/**': {'ros__parameters': {'use_sim_time': True, 'lockstep': False}},
        'sat1': {CONTROLLER_NAME: {'ros__parameters': {**parameters(), 'lockstep': True}}},
        'star_tracker': {'ros__parameters': {'rate': 10}},
    })
    assert ControllerConfig.from_yaml(path).lockstep is True
    assert read_parameter_file(path, CONTROLLER_NAME)['use_sim_time'] is True


def test_numbers_that_yaml_takes_for_text(tmp_path: Path) -> None:
    text = (CONFIG / 'controller.yaml').read_text(encoding='utf-8')
    path = write(tmp_path, text.replace('terminal_scale: 0.1', 'terminal_scale: 1e-1'))
    assert AttitudeMpcConfig.from_yaml(path).terminal_scale == 0.1


def test_a_scalar_limit_and_no_limit(tmp_path: Path) -> None:
    changed = parameters()
    changed['limits'] = {'max_torque_n_m': 0.2, 'max_rate_rad_s': [float('inf')] * 3}
    config = AttitudeMpcConfig.from_yaml(
        write(tmp_path, {CONTROLLER_NAME: {'ros__parameters': changed}}))
    np.testing.assert_array_equal(config.max_torque_n_m, [0.2] * 3)
    assert config.max_rate_rad_s is None


@pytest.mark.parametrize(('group', 'key', 'value', 'valid'), [
    ('spacecraft', 'inertia_kg_m2', None, '3 or 9 numbers'),  # written as null: text for ROS
    ('spacecraft', 'inertia_kg_m2', [[1.0, 0.0], [0.0, 1.0]], 'one list'),
    ('spacecraft', 'inertia_kg_m2', [1, 0.9, 0.6], 'one type'),
    ('spacecraft', 'inertia_kg_m2', [True, True, True], '3 or 9 numbers'),
    ('spacecraft', 'inertia_kg_m2', ['a', 'b', 'c'], '3 or 9 numbers'),
    ('spacecraft', 'inertia_kg_m2', [float('nan'), 0.9, 0.6], 'finite'),
    ('spacecraft', 'inertia_kg_m2', [], '3 or 9 numbers'),
    ('spacecraft', 'inertia', [1.0, 0.9, 0.6], "'spacecraft.inertia_kg_m2'"),
    ('mpc', 'horizon', 0, 'at least 1'),
    ('mpc', 'horizon', '30', 'an integer'),
    ('mpc', 'step', 0.5, "'mpc.step_s'"),
    ('limits', 'max_rate_rad_s', [2.0, 2.0, 2.0], '1.5 rad'),
    ('mpc', 'terminal_scale', 1.5, 'at most 1'),
])
def test_mistakes_name_the_full_key(
    tmp_path: Path, group: str, key: str, value: Any, valid: str,
) -> None:
    changed = parameters()
    changed[group][key] = value
    path = write(tmp_path, {CONTROLLER_NAME: {'ros__parameters': changed}})
    with pytest.raises(ConfigurationError) as caught:
        AttitudeMpcConfig.from_yaml(path)
    assert caught.value.key == f'{group}.{key}'
    assert valid in str(caught.value)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize('spec', [spec for spec in CONTROLLER_PARAMETERS if spec.required])
def test_a_missing_key_is_named(tmp_path: Path, spec: ParameterSpec) -> None:
    changed = parameters()
    group, _, key = spec.name.partition('.')
    del changed[group][key]
    if not changed[group]:
        del changed[group]
    path = write(tmp_path, {CONTROLLER_NAME: {'ros__parameters': changed}})
    with pytest.raises(ConfigurationError, match='missing') as caught:
        AttitudeMpcConfig.from_yaml(path)
    assert caught.value.key == spec.name


@pytest.mark.parametrize(('text', 'words'), [
    ('a: "b', 'valid YAML'),
    ('just text', 'a section'),
    ('other_node: {ros__parameters: {a: 1}}', 'attitude_controller'),
    ('attitude_controller: {ros__parameters: 3}', 'nested keys'),
    ('/a/attitude_controller: {ros__parameters: {a: 1}}\n'
     '/b/attitude_controller: {ros__parameters: {a: 1}}', 'one section'),
])
def test_files_that_are_not_for_the_controller(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ConfigurationError, match=re.escape(words)):
        AttitudeMpcConfig.from_yaml(write(tmp_path, text))


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match='No such file'):
        AttitudeMpcConfig.from_yaml(tmp_path / 'absent.yaml')


@pytest.mark.parametrize('text', [
    'n: {ros__parameters: {a: [1, 0.5]}}', 'n: {ros__parameters: {a: {}, b: 1}}',
    'n: {ros__parameters: {a: }}', 'n: {ros__parameters: [1]}', '[1, 2]', '{a: {b: 1}}',
    '{n: {ros__parameters: {a: &x 1, b: *x}}}', '1n: {ros__parameters: {a: 1}}',
    'a//b: {ros__parameters: {a: 1}}', 'ros__parameters: {a: 1}'])
def test_files_that_ros_cannot_read(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigurationError, match=r'line \d'):
        sections_of(write(tmp_path, text))


def test_the_aggregator_groups_every_node_once() -> None:
    """Any namespace: the name on /diagnostics ends with the node's, which one group contains."""
    document = yaml.safe_load(
        (CONFIG / 'diagnostic_aggregator.yaml').read_text(encoding='utf-8'))
    groups = [group['contains'] for group in document['analyzers']['ros__parameters'].values()
              if isinstance(group, dict)]
    assert sorted(name for group in groups for name in group) == sorted(
        (CONTROLLER_NAME, MARKERS_NAME, SIMULATOR_NAME))
