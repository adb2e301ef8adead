# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Commands in described messages: torque, normalised torque, devices, stamps, fixed values."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml

from manifold_mpc_ros.config.description import command_description
from manifold_mpc_ros.control.actuator import Actuation
from manifold_mpc_ros.control.described.command import CommandWriter
from manifold_mpc_ros.errors import ConfigurationError

TORQUE = np.array([0.1, -0.2, 0.3])
ACTUATION = Actuation(TORQUE, np.array([1.0, 2.0, 3.0, 4.0]), TORQUE)
INF = float('inf')


def writer(folder: Path, full_scale: Any = (INF, INF, INF), **keys: Any) -> CommandWriter:
    """Return the writer of the one message of a description."""
    path = folder / 'mine.yaml'
    path.write_text(yaml.safe_dump(
        {'command': [{'topic': 'out', 'type': 'my_msgs/msg/Out', 'field': 'v', **keys}]}))
    command_description.cache_clear()
    message, = command_description(str(path))
    return CommandWriter(message, 'base_link', full_scale)


def empty() -> SimpleNamespace:
    time = SimpleNamespace(sec=0, nanosec=0)
    return SimpleNamespace(v=[0.0] * 3, t=time, us=0, s=0.0, frame='', mode=0)


def test_a_torque_is_turned_scaled_and_read_back(tmp_path: Path) -> None:
    out = writer(tmp_path, (0.5, 0.4, 0.6), body_axes='FRD', unit='normalised')
    message = out.fill(empty(), 1, 2, ACTUATION)
    np.testing.assert_allclose(message.v, [0.2, 0.5, -0.5], rtol=1e-15)
    np.testing.assert_allclose(out.read(message), TORQUE, rtol=1e-15)


def test_stamps_frame_fixed_values_and_devices(tmp_path: Path) -> None:
    message = writer(tmp_path, stamp='t', body_frame_id='frame', set={'mode': 3}).fill(
        empty(), 5_000_000_007, 9, ACTUATION)
    assert (message.t.sec, message.t.nanosec, message.frame, message.mode) == (
        5, 7, 'base_link', 3)
    message = writer(tmp_path, stamp='us', sent='s', stamp_unit='us', quantity='device').fill(
        empty(), 5_000_007_999, 9_500_000, ACTUATION)
    assert (message.us, message.s, message.v) == (5_000_007, 9_500.0, [1.0, 2.0, 3.0, 4.0])


@pytest.mark.parametrize(('keys', 'says'), [
    ({'field': 'w'}, "out: 'my_msgs/msg/Out'.*no attribute 'w'"),
    ({'set': {'modes': 3}}, "no attribute 'modes'"),
    ({'stamp': 'frame'}, 'a type with the fields described'),
    ({'unit': 'normalised'}, 'full_scale_torque_n_m.*the torque that is 1 on out'),
    ({'unit': 'Nm'}, "command.0..unit: 'Nm'.*'normalised'"),
    ({'period_s': 0.1}, 'period_s.*left out where there is a field'),
    ({'set': {'mode': [1]}}, 'set.*for each path')])
def test_a_mistake_gets_one_sentence(tmp_path: Path, keys: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigurationError, match=says) as caught:
        writer(tmp_path, **keys).check(empty())
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(('given', 'says'), [
    ('imu', "command_sink: 'imu'.*the key 'command'"), ('[]', 'a list of messages'),
    ('[{topic: a, type: b/msg/C}]', 'of which one has a field')])
def test_a_description_without_a_command_is_refused(
    tmp_path: Path, given: str, says: str,
) -> None:
    path = tmp_path / 'mine.yaml'
    path.write_text(f'command: {given}')
    with pytest.raises(ConfigurationError, match=says):
        command_description('imu' if given == 'imu' else str(path))
