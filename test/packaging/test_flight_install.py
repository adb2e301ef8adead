# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What flies runs in an environment that has nothing else: no extra but ``ros``."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from installed import environment, run, starts_and_stops

from manifold_mpc_ros.cli.extras import EXTRAS

# The wheels of ROS 2 start Python again with the library path of their own environment.
AFRESH = ['env', '-u', '_ROS_WHEELS_BOOTSTRAP_COMPLETE', '-u', 'LD_LIBRARY_PATH']


def test_nothing_of_the_laboratory_is_there(flight_prefix: Path, tmp_path: Path) -> None:
    ask = f'from importlib.util import find_spec; print(*filter(find_spec, {list(EXTRAS)!r}))'
    assert run([*AFRESH, flight_prefix / 'bin/python', '-c', ask], cwd=tmp_path) == 'rclpy\n'


@pytest.mark.parametrize('name', ['controller', 'simulator'])
def test_each_node_starts_and_stops(flight_prefix: Path, name: str) -> None:
    configuration = flight_prefix / f'share/manifold_mpc_ros/config/{name}.yaml'
    starts_and_stops([*AFRESH, flight_prefix / 'bin' / name], configuration)


def test_the_library_solves(flight_prefix: Path, tmp_path: Path) -> None:
    program = """
import manifold_mpc_ros as m
from pathlib import Path
config = m.AttitudeMpcConfig.from_yaml(Path(m.__file__).parents[4] / 'share/manifold_mpc_ros'
                                       '/config/controller.yaml')
print(m.AttitudeMpc(config).solve([[-1, 0, 0], [0, -1, 0], [0, 0, 1]], [0, 0, 0])
      .status.value)"""
    solved = run([*AFRESH, flight_prefix / 'bin/python', '-c', program], cwd=tmp_path)
    assert solved == 'converged\n'


def test_a_verb_says_what_to_install(flight_prefix: Path, tmp_path: Path) -> None:
    command = flight_prefix / 'bin/manifold-mpc'
    assert 'simulate' in run([*AFRESH, command, '--help'], cwd=tmp_path)
    done = subprocess.run([*AFRESH, command, 'simulate'], cwd=tmp_path, text=True, check=False,
                          capture_output=True, timeout=60, env=environment())
    assert (done.returncode, done.stdout) == (2, '')
    assert done.stderr == ('manifold-mpc: error: simulate needs matplotlib, which is not '
                           "installed: pip install 'manifold_mpc_ros[lab]'\n")
