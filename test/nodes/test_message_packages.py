# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Message packages that a test builds are what a workspace would have built."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import message_packages
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
if message_packages.missing():
    pytest.skip(f'message packages cannot be built without {message_packages.missing()}',
                allow_module_level=True)

from harness import child_environment

ROUND_TRIP = """
from rclpy.serialization import deserialize_message, serialize_message
from own_msgs.msg import Mixed, Part
message = Mixed(parts=[Part(values=[0.5, -1.0])], name='a')
message.header.stamp.sec = 7
assert deserialize_message(serialize_message(message), Mixed) == message
print(len(serialize_message(message)))
"""


def test_a_package_built_here_carries_its_messages(tmp_path: Path) -> None:
    message_packages.build(tmp_path, 'own_msgs', {
        'Part': 'float32[<=3] values\n',
        'Mixed': 'std_msgs/Header header\nPart[] parts\nstring name\n',
    }, 'std_msgs', 'builtin_interfaces')
    done = subprocess.run(
        [sys.executable, '-c', ROUND_TRIP], text=True, capture_output=True, check=False,
        env=child_environment(0, PYTHONPATH=str(tmp_path)))
    assert done.returncode == 0, done.stderr
    # encapsulation 4; stamp 8; empty frame 4 + 1, aligned 3; parts 4; values 4 + 8; name 4 + 2
    assert int(done.stdout) == 42
