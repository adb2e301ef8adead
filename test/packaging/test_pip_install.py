# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``pip install .`` gives commands on PATH, and a prefix in which ``ros2 run`` finds them."""

from __future__ import annotations

from pathlib import Path

import pytest
from installed import COMMANDS, TOP, found_by_ros2_run, run, shipped, starts_and_stops


def test_the_commands_are_on_path(pip_prefix: Path) -> None:
    for command in COMMANDS:
        first = (pip_prefix / 'bin' / command).read_text(encoding='utf-8')
        assert 'import main' in first


def test_ros2_run_finds_the_executables(pip_prefix: Path) -> None:
    assert found_by_ros2_run(pip_prefix) == COMMANDS


def test_nothing_is_found_in_another_prefix(tmp_path: Path) -> None:
    assert found_by_ros2_run(tmp_path) == set()


def test_share_holds_configuration_launch_files_and_manifest(pip_prefix: Path) -> None:
    assert shipped(pip_prefix / 'share/manifold_mpc_ros') == shipped(TOP)


def test_the_installed_package_is_imported(pip_prefix: Path, tmp_path: Path) -> None:
    ask = 'import manifold_mpc_ros; print(manifold_mpc_ros.__file__)'
    where = run([pip_prefix / 'bin/python', '-c', ask], cwd=tmp_path)
    assert Path(where.strip()).is_relative_to(pip_prefix)


@pytest.mark.parametrize('folder', ['bin', 'lib/manifold_mpc_ros'])
def test_the_command_line_starts(pip_prefix: Path, folder: str, tmp_path: Path) -> None:
    printed = run([pip_prefix / folder / 'manifold-mpc', '--help'], cwd=tmp_path)
    assert 'simulate' in printed


def test_a_stub_runs_through_a_link(pip_prefix: Path, tmp_path: Path) -> None:
    link = tmp_path / 'manifold-mpc'
    link.symlink_to(pip_prefix / 'lib/manifold_mpc_ros/manifold-mpc')
    assert 'simulate' in run([link, '--help'], cwd=tmp_path)


@pytest.mark.parametrize('name', ['controller', 'simulator'])
@pytest.mark.parametrize('folder', ['bin', 'lib/manifold_mpc_ros'])
def test_a_node_starts_and_stops(pip_prefix: Path, folder: str, name: str) -> None:
    configuration = pip_prefix / f'share/manifold_mpc_ros/config/{name}.yaml'
    starts_and_stops([pip_prefix / folder / name], configuration)
