# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``colcon build``, plain and with ``--symlink-install``, gives a package that ROS 2 finds."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from installed import COMMANDS, TOP, found_by_ros2_run, run, shipped, starts_and_stops

PACKAGE = Path('manifold_mpc_ros')


def is_symlink_install(prefix: Path) -> bool:
    """Return whether the prefix is the one of the symlink build."""
    return 'symlink' in prefix.parts


def sourced(prefix: Path) -> list[str]:
    """Return a command that runs its arguments after sourcing the workspace."""
    setup = prefix.parent / 'local_setup.sh'
    script = f'COLCON_CURRENT_PREFIX="{prefix.parent}" . "{setup}" && exec "$@"'
    return ['sh', '-c', script, 'sh']


def test_ros2_run_finds_the_executables(colcon_prefix: Path) -> None:
    assert found_by_ros2_run(colcon_prefix) == COMMANDS


def test_share_holds_configuration_launch_files_and_manifest(colcon_prefix: Path) -> None:
    assert shipped(colcon_prefix / 'share' / PACKAGE) == shipped(TOP)


def test_only_the_symlink_build_links_to_the_sources(colcon_prefix: Path, checkout: Path) -> None:
    links = is_symlink_install(colcon_prefix)
    share = colcon_prefix / 'share' / PACKAGE / 'config'
    files = [path for path in share.rglob('*') if not path.is_dir()]
    assert {path.name for path in files} >= {'controller.yaml', 'tumble_recovery.yaml'}
    for installed in files:
        original = checkout / 'config' / installed.relative_to(share)
        assert installed.is_symlink() == links
        assert installed.samefile(original) == links


def test_the_module_is_imported_from_the_workspace(
        colcon_prefix: Path, checkout: Path, tmp_path: Path) -> None:
    ask = 'import manifold_mpc_ros, os; print(os.path.realpath(manifold_mpc_ros.__file__))'
    python = [*sourced(colcon_prefix), sys.executable]
    where = Path(run([*python, '-c', ask], cwd=tmp_path).strip())
    origin = checkout if is_symlink_install(colcon_prefix) else colcon_prefix
    assert where.is_relative_to(origin)


def test_the_command_line_starts(colcon_prefix: Path, tmp_path: Path) -> None:
    command = colcon_prefix / 'lib' / PACKAGE / 'manifold-mpc'
    assert 'simulate' in run([*sourced(colcon_prefix), command, '--help'], cwd=tmp_path)


@pytest.mark.parametrize('name', ['controller', 'simulator'])
def test_a_node_starts_and_stops(colcon_prefix: Path, name: str) -> None:
    configuration = colcon_prefix / 'share' / PACKAGE / 'config' / f'{name}.yaml'
    command = colcon_prefix / 'lib' / PACKAGE / name
    starts_and_stops([*sourced(colcon_prefix), command], configuration)
