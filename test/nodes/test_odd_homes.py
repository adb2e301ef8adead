# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Start without a home, with one that cannot be written to, and as the systemd unit starts it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import pytest

from manifold_mpc_ros.errors import CacheError
from manifold_mpc_ros.mpc.cache import cache_directory
from manifold_mpc_ros.nodes.log_folder import why_no_log_file

if TYPE_CHECKING:
    from harness import Process, Rig

UNIT = Path(__file__).parents[2] / 'config' / 'systemd' / 'manifold-mpc-controller.service'
#: Nobody, root neither, can make a folder in these.
CLOSED = ('/proc', '/dev/null')
STRANGER = ('unshare', '-U', '--map-user=12345', '--map-group=12345')


@pytest.mark.parametrize(('variables', 'writable'), [
    ({}, False), ({'HOME': ''}, False), ({'HOME': '{}'}, True), ({'HOME': '{}/new'}, True),
    ({'ROS_LOG_DIR': '{}'}, True), ({'ROS_LOG_DIR': '~/logs', 'HOME': '{}'}, True),
    ({'ROS_LOG_DIR': '~/logs'}, False), ({'ROS_HOME': '{}/ros'}, True), ({'ROS_HOME': '~'}, False),
    *(({'HOME': closed}, False) for closed in CLOSED),
    *(({'HOME': '{}', 'ROS_LOG_DIR': closed}, False) for closed in CLOSED),
    *(({'HOME': closed, 'ROS_LOG_DIR': '{}'}, True) for closed in CLOSED)])
def test_whether_ros_can_write_log_files(
    tmp_path: Path, variables: dict[str, str], writable: bool,
) -> None:
    reason = why_no_log_file({name: text.format(tmp_path) for name, text in variables.items()})
    assert writable is (reason == '')
    assert writable or 'ROS_LOG_DIR' in reason
    assert '\n' not in reason


@pytest.mark.parametrize('variables', [
    {}, *({'HOME': closed} for closed in CLOSED),
    *({'XDG_CACHE_HOME': closed} for closed in CLOSED),
    *({'MANIFOLD_MPC_CACHE': closed + '/cache'} for closed in CLOSED)])
def test_a_cache_that_cannot_be_is_one_sentence_that_names_the_variable(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, variables: dict[str, str],
) -> None:
    """Without HOME the user is one that /etc/passwd does not know."""
    def nowhere() -> NoReturn:
        raise RuntimeError('Could not determine home directory.')

    for name in ('HOME', 'XDG_CACHE_HOME', 'MANIFOLD_MPC_CACHE'):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    if 'HOME' not in variables:
        monkeypatch.setattr(Path, 'home', nowhere)
    with pytest.raises(CacheError, match='MANIFOLD_MPC_CACHE'):
        cache_directory(None)
    monkeypatch.setenv('MANIFOLD_MPC_CACHE', str(tmp_path / 'cache'))
    assert cache_directory(None) == tmp_path / 'cache'


def unit_settings() -> list[tuple[str, str]]:
    """Return the settings of the systemd unit, in their order."""
    lines = UNIT.read_text(encoding='utf-8').splitlines()
    return [(key, value) for line in lines if not line.startswith('#')
            for key, equals, value in [line.partition('=')] if equals]


def as_a_stranger(rig: Rig, folder: Path, arguments: list[str], **environment: str) -> Process:
    """Start the controller as a user id without a name, with this environment and no more."""
    from harness import Process
    if shutil.which('unshare') is None or subprocess.run(
            [*STRANGER, 'true'], check=False, capture_output=True).returncode:
        pytest.skip('no user namespace can be made here')
    return Process(
        [*STRANGER, sys.executable, '-m', 'manifold_mpc_ros.nodes.controller.main', *arguments],
        folder, {'PATH': os.environ['PATH'], **environment, 'ROS_DOMAIN_ID': str(rig.domain)})


def test_the_systemd_unit_sets_what_the_controller_needs(rig: Rig, tmp_path: Path) -> None:
    """Its environment and arguments, with the folders that systemd makes, for its new user."""
    from harness import CONFIG, log_line
    settings = unit_settings()
    made = {setting: value for setting, value in settings if setting.endswith('Directory')}
    assert ('DynamicUser', 'yes') in settings
    assert set(made) == {'LogsDirectory', 'CacheDirectory'}
    environment = dict(value.split('=', 1) for key, value in settings if key == 'Environment')
    environment = {name: text.replace('%L', f'{tmp_path}/L').replace('%C', f'{tmp_path}/C')
                   for name, text in environment.items()}
    logs = tmp_path / 'L' / made['LogsDirectory']
    logs.mkdir(parents=True)
    shutil.copytree(cache_directory(None), tmp_path / 'C' / made['CacheDirectory'])
    (command,) = (value for key, value in settings if key == 'ExecStart')
    arguments = [str(CONFIG / 'controller.yaml') if word.endswith('controller.yaml') else word
                 for word in command.split()[1:]]
    process = as_a_stranger(rig, tmp_path, arguments, **environment)
    try:
        rig.until(log_line(process, ': active'), 'an active controller')
    finally:
        process.end()
    assert process.status == 0
    assert list(logs.iterdir())
    assert 'no log file' not in process.log
    assert 'no solver cache' not in process.log


def test_a_stranger_without_a_home_is_told_one_thing_at_a_time(rig: Rig, tmp_path: Path) -> None:
    """What is missing, a compiler at last; nothing about the end of what never began."""
    process = as_a_stranger(rig, tmp_path, [], CC='no_compiler')
    assert process.wait() == 1
    said = [line for line in process.log.splitlines() if '[INFO]' not in line]
    assert [[word in line for word in ('ROS_LOG_DIR', 'MANIFOLD_MPC_CACHE', 'no_compiler')]
            for line in said] == [[True, False, False], [False, True, False], [False, False, True]]
