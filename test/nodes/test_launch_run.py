# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The launch file run by launch: what it starts acts, and nothing is left when it fails.

Skipped where launch and launch_ros are not installed; see also test_launch_file.py.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from shutil import which

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
pytest.importorskip('launch_ros', reason='ROS 2 (launch, launch_ros) is not installed')

from geometry_msgs.msg import WrenchStamped
from harness import PATIENCE_S, Rig, child_environment, torque_of
from nav_msgs.msg import Odometry

FOLDER = Path(__file__).parent
FILE = FOLDER.parents[1] / 'launch' / 'attitude_control.launch.py'
PREFIX = Path(sys.prefix)


class LaunchRun:
    """A run of the launch file in a session of its own."""

    def __init__(self, folder: Path, domain: int, *arguments: str) -> None:
        self._log = folder / 'launch.log'
        with self._log.open('wb') as stream:
            self._popen = subprocess.Popen(
                [sys.executable, str(FOLDER / 'run_launch.py'), str(FILE), *arguments],
                env=child_environment(domain, AMENT_PREFIX_PATH=str(PREFIX),
                                      ROS_LOG_DIR=str(folder)),
                stdin=subprocess.DEVNULL, stdout=stream, stderr=stream, start_new_session=True)

    @property
    def log(self) -> str:
        return self._log.read_text(encoding='utf-8', errors='replace')

    @property
    def left(self) -> list[str]:
        """The command lines of all processes of the session."""
        found = []
        for folder in Path('/proc').iterdir():
            try:
                if os.getsid(int(folder.name)) == self._popen.pid:
                    found.append((folder / 'cmdline').read_text().replace('\0', ' '))
            except (ValueError, OSError):
                continue
        return [line for line in found if line]

    def wait(self) -> int:
        """Return the exit status of launch."""
        return self._popen.wait(PATIENCE_S)

    def interrupt(self) -> int:
        """End it as Ctrl-C does; return its exit status."""
        os.killpg(self._popen.pid, signal.SIGINT)
        return self.wait()

    def kill(self) -> None:
        """Kill launch alone."""
        self._popen.kill()
        self.wait()

    def end(self) -> None:
        """Leave nothing running."""
        with suppress(ProcessLookupError):
            os.killpg(self._popen.pid, signal.SIGKILL)
        self.wait()


@pytest.fixture
def launched(rig: Rig, tmp_path: Path) -> Iterator:
    """Return what runs the launch file with arguments."""
    runs: list[LaunchRun] = []

    def run(*arguments: str) -> LaunchRun:
        runs.append(LaunchRun(tmp_path, rig.domain, *arguments))
        return runs[-1]

    yield run
    for each in runs:
        each.end()


def bad_file(folder: Path, node: str) -> Path:
    """Return a parameter file that the node refuses."""
    path = folder / 'bad.yaml'
    path.write_text(f'/**/{node}:\n  ros__parameters:\n    autostart: 5\n', encoding='utf-8')
    return path


@pytest.mark.parametrize(('argument', 'words'), [
    ('rviz:=true', "'rviz2' not found"),
    ('with_simulator:=maybe', "with_simulator: 'maybe' is not valid"),
    ('use_sim_time:=maybe', "use_sim_time: 'maybe' is not valid"),
    ('controller_params:=/nowhere.yaml', "controller_params: '/nowhere.yaml' is not valid")])
def test_a_launch_that_fails_starts_nothing(
    launched: type[LaunchRun], argument: str, words: str) -> None:
    run = launched(argument)
    assert run.wait() == 1, run.log
    assert words in run.log
    assert 'process started' not in run.log
    assert run.left == []


@pytest.mark.parametrize(('argument', 'node'), [
    ('controller_params', 'attitude_controller'), ('simulator_params', 'lgvi_simulator')])
def test_a_node_that_cannot_start_takes_the_others_with_it(
    launched: type[LaunchRun], tmp_path: Path, argument: str, node: str) -> None:
    run = launched(f'{argument}:={bad_file(tmp_path, node)}')
    run.wait()
    assert run.left == [], run.log
    assert 'process has died' in run.log


def test_it_closes_the_loop_under_other_names_and_ends(
    rig: Rig, launched: type[LaunchRun]) -> None:
    states = rig.watch(Odometry, '/sat1/state')
    torques = rig.watch(WrenchStamped, '/sat1/torque')
    run = launched('namespace:=sat1', 'use_sim_time:=true', 'clock:=clock', 'odometry:=state',
                   'torque_command:=torque')
    rig.until(lambda: len(torques) > 3 and len(states) > 3, 'the loop',
              meanwhile=lambda: _alive(run))
    assert rig.node.count_publishers('/sat1/clock') == 1
    assert rig.node.count_publishers('/clock') == 0
    run.interrupt()
    assert run.left == [], run.log
    assert run.log.count('process has finished cleanly') == 3, run.log


@pytest.mark.skipif(which('setpriv') is None, reason='setpriv (util-linux) is not installed')
def test_nodes_end_when_launch_is_killed(rig: Rig, launched: type[LaunchRun]) -> None:
    torques = rig.watch(WrenchStamped, '/torque_command')
    run = launched()
    rig.until(lambda: len(torques) > 3, 'the loop', meanwhile=lambda: _alive(run))
    run.kill()
    rig.until(lambda: run.left == [], 'the end of every node')
    assert torque_of(torques[-1]) == (0.0, 0.0, 0.0)


def _alive(run: LaunchRun) -> None:
    """Fail with what it wrote when the launch has ended."""
    assert 'process has died' not in run.log, run.log
