# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which sections of a parameter file count, and scalars as ROS reads them, without ROS.

``test/nodes/test_parameters_as_ros_reads.py`` compares the same reader with a real node.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import PROPERTY
from test_parameter_files import CONFIG, parameters, write

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.parameter import resolve_parameters
from manifold_mpc_ros.config.tables import CONTROLLER_NAME, CONTROLLER_PARAMETERS
from manifold_mpc_ros.config.yaml_file import (
    applies,
    read_parameter_file,
    sections_of,
)
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.parameter_files import parameter_file_text


@pytest.mark.parametrize('foreign', [
    'exclude_nodes: []', 'start: 2024-01-01', 'sign: =', 'nothing: ~', "empty: ''", 'h: 190:20:30',
    'merge: <<', 'mixed: {a: [], b: .nan}', 'when: 2001-12-14t21:59:43.10-05:00'])
def test_sections_of_other_nodes_are_not_judged(tmp_path: Path, foreign: str) -> None:
    shipped = (CONFIG / 'controller.yaml').read_text(encoding='utf-8')
    path = write(tmp_path, f'{shipped}\nlog_bridge:\n  ros__parameters:\n    {foreign}\n')
    assert read_parameter_file(path, CONTROLLER_NAME) == (
        read_parameter_file(CONFIG / 'controller.yaml', CONTROLLER_NAME))
    assert sections_of(path) == [f'/**/{CONTROLLER_NAME}', '/log_bridge']


@pytest.mark.parametrize(('before', 'after', 'name', 'value'), [
    ('lockstep: false', 'lockstep: n', 'lockstep', False),
    ('lockstep: false', 'lockstep: On', 'lockstep', True),
    ('terminal_constraint: true', 'terminal_constraint: yes', 'mpc.terminal_constraint', True),
    ('terminal_constraint: true', 'terminal_constraint: OFF', 'mpc.terminal_constraint', False),
    ('max_torque_n_m: [0.3, 0.3, 0.3]', 'max_torque_n_m: [inf, INF, .inf]',
     'limits.max_torque_n_m', [math.inf] * 3),
    ('horizon: 20', 'horizon: 0x14', 'mpc.horizon', 20),
    ('horizon: 20', 'horizon: 024', 'mpc.horizon', 20),
    ('step_s: 0.5', 'step_s: 5e-1', 'mpc.step_s', 0.5),
    ('frame_id: base_link', 'frame_id: !!str 1', 'body_frame_id', '1'),
    ('frame_id: base_link', 'frame_id: 1_0', 'body_frame_id', '1_0'),
    ('frame_id: base_link', 'frame_id: null', 'body_frame_id', 'null'),
])
def test_scalars_are_read_as_ros_reads_them(
    tmp_path: Path, before: str, after: str, name: str, value: Any,
) -> None:
    text = (CONFIG / 'controller.yaml').read_text(encoding='utf-8')
    assert before in text
    given = read_parameter_file(write(tmp_path, text.replace(before, after)), CONTROLLER_NAME)
    assert given[name] == value
    assert type(given[name]) is type(value)
    resolve_parameters(CONTROLLER_PARAMETERS, given, complete=True)


@pytest.mark.parametrize(('before', 'after', 'key'), [
    ('horizon: 20', 'horizon: 2_0', 'mpc.horizon'),
    ('horizon: 20', 'horizon: 024.0', 'mpc.horizon'),
    ('lockstep: false', 'lockstep: "false"', 'lockstep'),
    ('lockstep: false', 'lockstep: oFF', 'lockstep'),
    ('step_s: 0.5', 'step_s: &step 0.5\n      terminal_scale: *step', 'mpc.terminal_scale'),
    ('step_s: 0.5', 'step_s:', 'mpc.step_s'),
    ('step_s: 0.5', 'step_s: []', 'mpc.step_s'),
    ('inertia_kg_m2: [1.0, 0.9, 0.6]', 'inertia_kg_m2: [1, 0.9, 0.6]', 'spacecraft.inertia_kg_m2'),
])
def test_scalars_that_ros_reads_as_something_else_are_refused(
    tmp_path: Path, before: str, after: str, key: str,
) -> None:
    text = (CONFIG / 'controller.yaml').read_text(encoding='utf-8')
    assert before in text
    with pytest.raises(ConfigurationError) as caught:
        ControllerConfig.from_yaml(write(tmp_path, text.replace(before, after)))
    assert caught.value.key == key


@pytest.mark.parametrize(('section', 'node', 'expected'), [
    ('/**', '/a/b/c', True), ('/**', '/c', True), ('/*', '/c', True), ('/*', '/a/c', False),
    ('/**/c', '/c', True), ('/**/c', '/a/b/c', True), ('/**/c', '/a/bc', False),
    ('/*/c', '/a/c', True), ('/*/c', '/c', False), ('/a/*', '/a/c', True),
    ('/a/**', '/a/b/c', True), ('/a/**/c', '/a/c', True), ('/c', '/a/c', False),
])
def test_wildcards(section: str, node: str, expected: bool) -> None:
    assert applies(section, node) is expected


@pytest.mark.parametrize('keys', [
    [f'/sat1/{CONTROLLER_NAME}'], [f'/*/{CONTROLLER_NAME}'], ['/sat1/*'], ['/sat1/**'],
    [f'/sat1/{CONTROLLER_NAME}', '/sat2/other'], ['/*/*'],
    [CONTROLLER_NAME, f'/sat1/{CONTROLLER_NAME}'], [f'/sat1/{CONTROLLER_NAME}', '/sat1/**'],
])
def test_the_namespace_that_the_sections_are_for(tmp_path: Path, keys: list[str]) -> None:
    """Without a namespace of its own the command line takes the one that the file has."""
    document = {key: {'ros__parameters': {'a': 1} if index else parameters()}
                for index, key in enumerate(keys)}
    given = read_parameter_file(write(tmp_path, document), CONTROLLER_NAME)
    assert given['mpc.horizon'] == parameters()['mpc']['horizon']
    assert ('a' in given) is (keys[-1] == '/sat1/**' and len(keys) > 1)


@PROPERTY
@given(values=st.dictionaries(
    st.from_regex('[a-z][a-z_]{0,8}', fullmatch=True),
    st.booleans() | st.integers(-2**63, 2**63 - 1) | st.floats(allow_nan=False,
                                                             allow_subnormal=False)
    | st.text(st.characters(exclude_categories=['C', 'Z']), min_size=1, max_size=8)
    | st.sampled_from(['1e5', 'nan', 'n', 'y', 'inf', '08', '0x1f', 'null', '~', "'", 'a: b'])
    | st.lists(st.floats(-1e9, 1e9, allow_subnormal=False), min_size=1, max_size=3), max_size=5))
def test_a_file_that_is_written_is_read_the_same(
    tmp_path_factory: pytest.TempPathFactory, values: dict[str, Any],
) -> None:
    text = parameter_file_text(CONTROLLER_NAME, {**values, 'twice': [1.5]})
    path = write(tmp_path_factory.getbasetemp(), text)
    given = read_parameter_file(path, CONTROLLER_NAME)
    assert given == {**values, 'twice': [1.5]}
    assert all(type(given[name]) is type(value) for name, value in values.items())
