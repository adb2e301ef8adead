# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The configuration loader on anything: a configuration, or one error that names the key."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import PROPERTY, any_float

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.parameter import resolve_parameters
from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.config.tables import CONTROLLER_PARAMETERS, SIMULATOR_PARAMETERS
from manifold_mpc_ros.config.yaml_file import parse_mapping
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.parameter_files import flatten_parameters

scalars = st.none() | st.booleans() | st.integers() | any_float | st.text(max_size=6)
values = scalars | st.lists(scalars, max_size=4) | st.lists(any_float, min_size=3, max_size=3)
names = st.sampled_from([spec.name for spec in CONTROLLER_PARAMETERS]) | st.text(max_size=8)
trees = st.recursive(
    st.dictionaries(st.text(max_size=4), values, max_size=3),
    lambda inner: st.dictionaries(st.text(max_size=4), inner | values, max_size=3), max_leaves=6)


def near_valid(spec: Any) -> st.SearchStrategy[Any]:
    """Draw values of the right type, in and out of range."""
    if spec.kind == 'floats':
        size = st.sampled_from([*spec.lengths, 2])
        number = st.floats(0.01, 2.0) | any_float
        return size.flatmap(lambda n: st.lists(number, min_size=n, max_size=n))
    if spec.kind == 'int':
        return st.integers(-1, 60)
    if spec.kind == 'float':
        return st.floats(0.001, 2.0) | any_float
    if spec.kind == 'names':
        return st.just([''])
    return st.booleans() if spec.kind == 'bool' else st.sampled_from([*spec.choices, 'other'])


def changed(specs: Any) -> st.SearchStrategy[dict[str, Any]]:
    """Draw a few parameters with values that may be right."""
    return st.lists(st.sampled_from(specs), max_size=3, unique_by=lambda spec: spec.name).flatmap(
        lambda chosen: st.fixed_dictionaries({spec.name: near_valid(spec) for spec in chosen}))


def outcome(load: Callable[[], Any]) -> Any:
    """Return what a call returns, or the one error that it may raise."""
    try:
        return load()
    except ConfigurationError as error:
        return error


@PROPERTY
@given(given_values=st.dictionaries(names, values, max_size=4))
def test_any_values_of_any_names_resolve_or_are_refused_by_key(
    given_values: dict[str, Any],
) -> None:
    resolved = outcome(
        lambda: resolve_parameters(CONTROLLER_PARAMETERS, given_values, complete=False))
    if isinstance(resolved, ConfigurationError):
        assert resolved.key in {*given_values, 'use_sim_time'}
        return
    assert set(resolved) == {spec.name for spec in CONTROLLER_PARAMETERS}


@PROPERTY
@given(changes=changed(CONTROLLER_PARAMETERS))
def test_a_controller_that_is_accepted_keeps_what_the_implicit_step_needs(
    changes: dict[str, Any],
) -> None:
    config = outcome(lambda: ControllerConfig.from_parameters(
        resolve_parameters(CONTROLLER_PARAMETERS, changes, complete=False)))
    if isinstance(config, ConfigurationError):
        assert config.key in {spec.name for spec in CONTROLLER_PARAMETERS}
        return
    law = config.mpc
    assert math.isfinite(law.step_s)
    assert law.step_s > 0.0
    assert law.horizon >= 1
    assert config.state_timeout_s >= law.step_s
    rate = law.max_rate_rad_s
    if rate is not None:
        assert law.step_s * math.hypot(*(x for x in rate if math.isfinite(x))) < 1.5


@PROPERTY
@given(changes=changed(SIMULATOR_PARAMETERS))
def test_a_simulator_that_is_accepted_has_whole_periods(changes: dict[str, Any]) -> None:
    config = outcome(lambda: SimulatorConfig.from_parameters(
        resolve_parameters(SIMULATOR_PARAMETERS, changes, complete=False)))
    if isinstance(config, ConfigurationError):
        assert config.key in {spec.name for spec in SIMULATOR_PARAMETERS}
        return
    assert config.steps_per_control >= 1
    assert config.steps_per_control * config.step_s == pytest.approx(config.control_period_s)
    assert config.command_life_s >= 0.15


@PROPERTY
@given(text=st.text(max_size=60) | st.text('[]{}:,-#&*!|>\'"%@` \n\tab01.', max_size=40))
def test_any_text_is_yaml_or_one_error(text: str) -> None:
    flat = outcome(lambda: flatten_parameters(parse_mapping(text, 'parameter file', 'a.yaml')))
    if isinstance(flat, ConfigurationError):
        assert '\n' not in str(flat)
    else:
        assert all(isinstance(name, str) for name in flat)


@PROPERTY
@given(tree=trees)
def test_any_tree_is_flat_names_with_values_that_ros_can_hold(tree: dict[str, Any]) -> None:
    flat = outcome(lambda: flatten_parameters(tree))
    if isinstance(flat, ConfigurationError):
        return
    for value in flat.values():
        items = value if isinstance(value, list) else [value]
        assert len({type(item) for item in items}) == 1


def test_a_file_that_is_no_text_is_one_error(tmp_path: Path) -> None:
    file = tmp_path / 'controller.yaml'
    file.write_bytes(b'\xff\xfe\x00')
    with pytest.raises(ConfigurationError, match='not UTF-8'):
        ControllerConfig.from_yaml(file)
