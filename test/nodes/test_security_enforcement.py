# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who is let in where security is enforced: unsigned, wrong authority, signed but not allowed.

They need a middleware that was built with its security plugins and the command ``ros2 security``.
The ROS wheels from PyPI have neither; there every test of this file is skipped, and says so.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from harness import PATIENCE_S, child_environment, log_line, reserved_domain

if TYPE_CHECKING:
    from harness import Process, Rig

SROS2 = Path(__file__).parents[2] / 'config' / 'sros2'
NODES = {'controller': 'attitude_controller', 'simulator': 'lgvi_simulator'}
#: What a stranger does: publish torque, and say whether anybody matched.
STRANGER = """
import sys, time, rclpy
from geometry_msgs.msg import WrenchStamped
rclpy.init(args=sys.argv)
node = rclpy.create_node('stranger')
publisher = node.create_publisher(WrenchStamped, sys.argv[1], 10)
end = time.monotonic() + 8.0
while time.monotonic() < end and not publisher.get_subscription_count():
    rclpy.spin_once(node, timeout_sec=0.1)
print('matched' if publisher.get_subscription_count() else 'alone', flush=True)
"""


def keystore(folder: Path) -> Path:
    """Return a keystore made by the shipped script, or skip."""
    if shutil.which('ros2') is None:
        pytest.skip('enforcement is not tested here: the command ros2 security is not installed')
    made = subprocess.run(['sh', str(SROS2 / 'enforce.sh'), str(folder)], text=True, check=False,
                          capture_output=True, timeout=120)
    if made.returncode:
        pytest.skip(f'enforcement is not tested here: {made.stderr.strip()}')
    return folder


def secured(store: Path) -> dict[str, str]:
    """Return the environment of enforced security."""
    return {'ROS_SECURITY_KEYSTORE': str(store), 'ROS_SECURITY_ENABLE': 'true',
            'ROS_SECURITY_STRATEGY': 'Enforce'}


def start(rig: Rig, program: str, store: Path) -> Process:
    """Start a node in its enclave; skip where the middleware has no security."""
    name = NODES[program]
    process = rig.run(
        [f'manifold_mpc_ros.nodes.{program}.main', '--ros-args', '--enclave', f'/{name}',
         '-p', 'secure:=true'], **secured(store))
    rig.until(lambda: log_line(process, ']: active')() or not process.running,
              f'the {program}', alive=False)
    if not process.running:
        if 'ecurity' in process.log and 'secure: ' not in process.log:
            pytest.skip('enforcement is not tested here: this middleware has no security plugins '
                        f'({process.log.strip().splitlines()[-1]})')
        raise AssertionError(process.log)
    return process


@pytest.fixture
def store(tmp_path: Path) -> Path:
    """Give a keystore for the nodes."""
    return keystore(tmp_path / 'keystore')


def stranger(domain: int, topic: str, *arguments: str, **variables: str) -> str:
    """Return 'matched' or 'alone' of a participant that publishes on a topic."""
    done = subprocess.run(
        [sys.executable, '-c', STRANGER, topic, *arguments], text=True, check=False,
        env=child_environment(domain, **variables), capture_output=True, timeout=PATIENCE_S)
    return done.stdout.strip() or done.stderr


def test_strangers_do_not_match(rig: Rig, store: Path, tmp_path: Path) -> None:
    """Unsigned, signed by another authority, and signed for something else."""
    for program in NODES:
        start(rig, program, store)
    domain = rig.domain
    inside = ['--ros-args', '--enclave', '/attitude_controller']
    assert stranger(domain, '/torque_command', *inside, **secured(store)) == 'matched'
    assert stranger(domain, '/torque_command') == 'alone'
    other = keystore(tmp_path / 'other')
    assert stranger(domain, '/torque_command', *inside, **secured(other)) == 'alone'
    recorder = ['--ros-args', '--enclave', '/recorder']
    assert stranger(domain, '/torque_command', *recorder, **secured(store)) != 'matched'


def test_enforcement_without_plugins_is_an_error_and_not_a_way_in(tmp_path: Path) -> None:
    """With keys that are none, a node that has to be secure does not start at all."""
    (tmp_path / 'enclaves' / 'attitude_controller').mkdir(parents=True)
    with reserved_domain() as domain:
        done = subprocess.run(
            [sys.executable, '-m', 'manifold_mpc_ros.nodes.controller.main', '--ros-args',
             '--enclave', '/attitude_controller', '-p', 'secure:=true'],
            env=child_environment(domain, **secured(tmp_path)), text=True, check=False,
            capture_output=True, timeout=PATIENCE_S)
    assert done.returncode == 1
    assert 'Traceback' not in done.stderr
    assert 'ecurity' in done.stderr or 'SECURITY' in done.stderr, done.stderr
