# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb campaign: what it prints, writes and returns, for laws that hold and that do not."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import campaign_stubs as stubs
import pytest
from interruptible import take_interrupts

from manifold_mpc_ros.config import AttitudeMpcConfig
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.sim import campaign_workers

Command = Callable[..., tuple[int, str, str]]
TOP = Path(__file__).parents[2]


@pytest.fixture
def small(write_config: Callable[..., Path], tmp_path: Path) -> list[object]:
    """Arguments for a campaign of seconds: without limits eight steps reach the terminal set."""
    free = [float('inf')] * 3
    config = write_config('controller', **{
        'mpc.horizon': 8, 'mpc.backend': 'vm', 'limits.max_torque_n_m': free,
        'limits.max_rate_rad_s': free})
    return ['campaign', '--controller-config', config, '--random', '3', '--opposite', '2',
            '--duration', '25', '--workers', '1', '--output', tmp_path / 'out' / 'campaign.json']


@pytest.fixture
def use(monkeypatch: pytest.MonkeyPatch) -> Callable[[Any], None]:
    """Put another controller in the place of the optimiser."""
    def put(make: Any) -> None:
        monkeypatch.setattr(campaign_workers, 'build_controller', make)
    return put


@pytest.fixture(scope='module')
def optimiser() -> AttitudeMpc:
    """The controller of `small`, built once for the tests that need it."""
    config = AttitudeMpcConfig.from_yaml(TOP / 'config' / 'controller.yaml')
    return AttitudeMpc(replace(config, horizon=8, max_torque_n_m=None, max_rate_rad_s=None),
                       backend='vm')


def written(tmp_path: Path) -> dict[str, Any]:
    return json.loads((tmp_path / 'out' / 'campaign.json').read_text(encoding='utf-8'))


def test_the_optimiser_keeps_every_promise(
    command: Command, small: list[object], tmp_path: Path, optimiser: AttitudeMpc,
    use: Callable[[Any], None],
) -> None:
    use(lambda _config, _backend: optimiser)
    status, out, err = command(*small, '--table', tmp_path / 'out' / 'loops.csv')
    assert (status, err) == (0, '')
    assert 'Every loop settled' in out
    assert '3 of 3' in out
    assert '2 of 2' in out
    data = written(tmp_path)
    assert data['complete'] is True
    assert data['broken'] == []
    assert data['settings']['steps'] == 50
    assert data['controller']['horizon'] == 8
    assert list(data['sets']) == ['random', 'opposite']
    for figures, loops in zip(data['sets'].values(), (3, 2), strict=True):
        assert figures['loops'] == figures['settled'] == loops
        assert figures['decrease_violations'] == figures['chattering_loops'] == 0
        assert figures['solves'] == 51 * loops
    assert data['this_machine']['solve_times']['random']['warm_us_median'] > 0.0
    assert (tmp_path / 'out' / 'campaign.png').read_bytes().startswith(b'\x89PNG')
    with (tmp_path / 'out' / 'loops.csv').open(encoding='utf-8') as file:
        rows = list(csv.DictReader(file))
    assert [row['name'] for row in rows] == [
        'random-0', 'random-1', 'random-2', 'opposite-0', 'opposite-1']


def test_a_first_torque_with_the_wrong_sign_is_reported(
    command: Command, small: list[object], tmp_path: Path, optimiser: AttitudeMpc,
    use: Callable[[Any], None],
) -> None:
    use(lambda _config, _backend: stubs.FlippedFirst(optimiser))
    status, out, err = command(*small, '--opposite', '0')
    assert (status, err) == (1, '')
    assert 'FAILED: 3 of 3 loops broke something' in out
    assert 'random-1: decrease' in out
    data = written(tmp_path)
    assert data['sets']['random']['decrease_violations'] == 3
    assert data['sets']['random']['settled'] == 3
    assert [case['name'] for case in data['broken']] == ['random-0', 'random-1', 'random-2']
    assert {tuple(case['broken']) for case in data['broken']} == {('decrease',)}


def test_chatter_and_what_never_settles_are_reported(
    command: Command, small: list[object], tmp_path: Path, use: Callable[[Any], None],
) -> None:
    use(stubs.make_undecided)
    status, out, _ = command(*small, '--random', '0', '--opposite', '12')
    assert status == 1
    assert 'FAILED: 12 of 12' in out
    assert 'and 2 more, all in the data file' in out
    figures = written(tmp_path)['sets']['opposite']
    assert (figures['settled'], figures['chattering_loops']) == (0, 12)
    assert figures['turn_changes_most'] == 50
    assert figures['settling_s'] is None


def test_one_case_again_tick_by_tick(
    command: Command, small: list[object], tmp_path: Path, use: Callable[[Any], None],
) -> None:
    use(stubs.make_undecided)
    status, out, _ = command(*small, '--case', 'opposite-7')
    assert status == 1
    assert 'opposite-7' in out
    assert sum(line.count('180.0000') for line in out.splitlines()) == 51
    assert 'chatter' in out
    assert not (tmp_path / 'out').exists()


def test_an_error_in_a_case_is_one_line(
    command: Command, small: list[object], use: Callable[[Any], None],
) -> None:
    use(stubs.make_thrower)
    status, _, err = command(*small)
    assert status == 2
    assert err == 'manifold-mpc: error: case random-2: ValueError: the third is too much\n'


def test_an_interrupt_reports_what_was_done(
    command: Command, small: list[object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    use: Callable[[Any], None],
) -> None:
    use(stubs.make_damping)
    run_cases = campaign_workers.run_cases

    def interrupted(*arguments: Any) -> Iterator[Any]:
        for done, chunk in enumerate(run_cases(*arguments)):
            if done == 2:
                raise KeyboardInterrupt
            yield chunk

    monkeypatch.setattr(campaign_workers, 'run_cases', interrupted)
    status, out, _ = command(*small)
    assert status == 130
    assert 'Interrupted' in out
    assert '2 of 5 closed loops' in out
    data = written(tmp_path)
    assert (data['complete'], data['planned']) == (False, 5)
    assert data['sets']['random']['loops'] == 2


@pytest.mark.parametrize(('arguments', 'words'), [
    (['--random', '-1'], ['--random', "'-1'"]),
    (['--opposite', '1.5'], ['--opposite', "'1.5'"]),
    (['--workers', '0'], ['--workers', "'0'"]),
    (['--duration', '25.3'], ['--duration', '25.3', '0.5']),
    (['--largest-rate', '1.3'], ['largest rate', '1.3', '1.2']),
    (['--largest-rate', 'nan'], ['--largest-rate', "'nan'"]),
    (['--settled-deg', '0'], ['--settled-deg', 'above 0']),
    (['--case', 'tumble-1'], ['tumble-1', 'random-17']),
    (['--random', '0', '--opposite', '0'], ['--random', 'at least one']),
    (['--output', '.'], ['output', 'file that can be written']),
    (['--picture', '.'], ['output', 'file that can be written']),
    (['--controller-config', 'nowhere.yaml'], ['nowhere.yaml']),
])
def test_a_mistake_is_one_line_before_anything_runs(
    command: Command, small: list[object], use: Callable[[Any], None],
    arguments: list[str], words: list[str],
) -> None:
    use(stubs.make_dying)
    status, out, err = command(*small, *arguments)
    assert (status, out) == (2, '')
    assert err.count('\n') == 1
    for word in words:
        assert word in err


def test_ctrl_c_ends_all_processes_without_a_traceback(
    small: list[object], quick_controller: Path,
) -> None:
    """At the terminal every process of the group gets the signal, starting workers too."""
    process = subprocess.Popen(
        [sys.executable, '-m', 'manifold_mpc_ros.cli.main', *map(str, small), '--random', '9999',
         '--workers', '2', '--controller-config', str(quick_controller)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=take_interrupts,
        env=dict(os.environ, PYTHONPATH=os.pathsep.join(
            [str(TOP), *filter(None, [os.environ.get('PYTHONPATH')])])))
    assert process.stdout is not None
    try:
        assert process.stdout.readline() == '10001 loops, 2 at a time\n'
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=120)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130, err
    assert 'Interrupted' in out
    assert err == ''
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)
