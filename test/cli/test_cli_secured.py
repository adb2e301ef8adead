# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Verbs that start nodes in a domain of their own do so without the security of the shell."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from manifold_mpc_ros.cli.processes import node_environment, stay_private

TOP = Path(__file__).parents[2]


def run(folder: Path, *arguments: str) -> str:
    """Run a verb where security is to be enforced, with a keystore that is none."""
    path = os.pathsep.join([str(TOP), *filter(None, [os.environ.get('PYTHONPATH')])])
    done = subprocess.run(
        [sys.executable, '-m', 'manifold_mpc_ros.cli.main', *arguments], text=True, check=False,
        env=node_environment(0) | {
            'PYTHONPATH': path, 'ROS_DOMAIN_ID': '', 'ROS_SECURITY_ENABLE': 'true',
            'ROS_SECURITY_STRATEGY': 'Enforce',
            'ROS_SECURITY_KEYSTORE': str(folder / 'absent'),
            'ROS_SECURITY_ENCLAVE_OVERRIDE': '/operator'},
        cwd=folder, capture_output=True, timeout=240)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_recording_and_replaying_go_on_in_private(tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    run(tmp_path, 'record', 'rest_to_rest_10', '-o', 'bag')
    run(tmp_path, 'replay', 'bag')


def test_the_demo_goes_on_in_private(tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    assert 'settled after' in run(
        tmp_path, 'demo', '--time-limit', '41', '--start-limit', '120', '--output', 'demo')


def test_nothing_of_security_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('ROS_SECURITY_ENABLE', 'true')
    monkeypatch.setenv('ROS_SECURITY_ANYTHING', '1')
    environment = dict(os.environ)
    stay_private(environment)
    for left in (environment, node_environment(3)):
        assert not [name for name in left if name.startswith('ROS_SECURITY_')]
        assert left['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
