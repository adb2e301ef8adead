# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Descriptions: shipped ones load; a mistake in one of your own gets one sentence."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from manifold_mpc_ros.config.description import preset_names, state_description
from manifold_mpc_ros.errors import ConfigurationError

ATTITUDE = {
    'topic': 'estimate', 'type': 'a_msgs/msg/Estimate', 'field': 'q', 'stamp': 'header.stamp'}


def test_every_preset_of_the_design_is_there() -> None:
    assert preset_names() == [
        'astrobee', 'basilisk', 'imu', 'magnetorquers', 'nav', 'pose_twist', 'px4',
        'space_station_os', 'thrusters', 'wheels']
    for name in set(preset_names()) - {'magnetorquers', 'thrusters', 'wheels'}:  # commands alone
        assert state_description(name).attitude.topic
    assert state_description('odometry') == state_description('nav')


def described(folder: Path, attitude: dict[str, Any], rate: dict[str, Any], **more: Any) -> str:
    """Write a description of a state; return its path."""
    path = folder / 'mine.yaml'
    path.write_text(yaml.safe_dump({'state': {
        'attitude': {**ATTITUDE, **attitude}, 'rate': {'field': 'w', **rate}, **more}}))
    return str(path)


def test_a_rate_shares_what_it_does_not_say(tmp_path: Path) -> None:
    state = state_description(described(tmp_path, {'body_axes': 'FRD'}, {'unit': 'deg/s'}))
    assert state.rate.topic == 'estimate'
    assert state.rate.stamp == state.attitude.stamp
    assert state.rate.convention.body is not None


@pytest.mark.parametrize(('attitude', 'rate', 'more', 'says'), [
    ({'form': 'wxyz'}, {}, {}, r"state.attitude.form: 'wxyz' .*'quaternion_wxyz'"),
    ({'type': 'Estimate'}, {}, {}, "state.attitude.type: 'Estimate' .*package/msg/Name"),
    ({'topic': 'a b'}, {}, {}, 'state.attitude.topic'),
    ({'field': 'q..w'}, {}, {}, 'state.attitude.field.*a path of fields'),
    ({'field': ['a', 'b']}, {}, {}, 'state.attitude.field.*one field, or of 4 numbers'),
    ({'direction': 'inverse'}, {}, {}, 'state.attitude.direction.*world_to_body'),
    ({'body_axes': 'NED'}, {}, {}, 'state.attitude.body_axes.*FLU or FRD'),
    ({'world_axes': [1.0] * 9}, {}, {}, 'state.attitude.world_axes.*rotation matrix'),
    ({'stamp': 'time', 'stamp_unit': 'min'}, {}, {}, "stamp_unit: 'min'.*'us'"),
    ({}, {'unit': 'deg'}, {}, "state.rate.unit.*'deg/s'"),
    ({}, {'axes': 'parent'}, {}, "state.rate.axes.*'world'"),
    ({}, {'type': 'a_msgs/msg/Other'}, {}, 'state.rate.type.*the same type'),
    ({}, {'topic': 'gyro', 'stamp': 'receipt'}, {}, 'state.rate.stamp.*the kind and unit'),
    ({}, {'feild': 'w'}, {}, "state.rate.feild.*nearest is 'field'"),
    ({}, {}, {'join_within_s': -1.0}, 'state.join_within_s'),
])
def test_a_mistake_is_named_with_what_is_valid(
    tmp_path: Path, attitude: dict[str, Any], rate: dict[str, Any], more: dict[str, Any],
    says: str,
) -> None:
    with pytest.raises(ConfigurationError, match=says) as caught:
        state_description(described(tmp_path, attitude, rate, **more))
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(('given', 'says'), [
    ('gyro', "state_source: 'gyro' .*'px4', 'space_station_os', or your own YAML file"),
    ('none.yaml', 'No such file'),
])
def test_a_description_that_is_not_there_is_named(given: str, says: str) -> None:
    with pytest.raises(ConfigurationError, match=says):
        state_description(given)


@pytest.mark.parametrize(('text', 'says'), [
    ('state: [1]', 'state: .*mapping of attitude, rate'), ('{}', "the key 'state'"),
    ('{state: {attitude: {}}}', 'attitude'), ('{states: {}}', "nearest is 'state'"),
    ('{state: {}, install: px4}', 'how to get each package'), ('[', 'valid YAML')])
def test_a_file_that_describes_nothing_is_refused(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / 'mine.yaml'
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=says):
        state_description(str(path))
