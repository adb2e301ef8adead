# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb campaign: what it prints, writes and returns, for laws that hold and that do not."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import campaign_stubs as stubs
import pyarrow.parquet as parquet
import pytest
import yaml
from campaign_plans import mapping, plants

from manifold_mpc_ros.lab.campaign import chunks
from manifold_mpc_ros.lab.campaign.plan import CampaignPlan
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

Command = Callable[..., tuple[int, str, str]]


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Write a small campaign, some of it changed; return where."""
    def put(**changed: Any) -> Path:
        path = tmp_path / 'small.yaml'
        path.write_text(yaml.safe_dump(mapping(duration_s=25.0, **changed)), encoding='utf-8')
        return path
    return put


@pytest.fixture
def small(write: Callable[..., Path], tmp_path: Path) -> list[object]:
    """Arguments for a campaign of seconds."""
    return ['campaign', write(), '--workers', '1', '--loops', 'opposite=2', '-o', tmp_path / 'out']


@pytest.fixture
def use(monkeypatch: pytest.MonkeyPatch) -> Callable[[Any], None]:
    """Put another controller in the place of the optimiser."""
    def put(make: Any) -> None:
        monkeypatch.setattr(chunks, 'build_controller', make)
    return put


@pytest.fixture(scope='module')
def optimiser() -> AttitudeMpc:
    """The controller of `small`, built once for the tests that need it."""
    plan = CampaignPlan.from_text(yaml.safe_dump(mapping()), 'small')
    return AttitudeMpc(plan.config)


def written(tmp_path: Path) -> dict[str, Any]:
    return json.loads((tmp_path / 'out' / 'campaign.json').read_text(encoding='utf-8'))


def names(tmp_path: Path) -> list[str]:
    return parquet.read_table(tmp_path / 'out' / 'loops.parquet')['name'].to_pylist()


def test_the_optimiser_keeps_every_promise(
    command: Command, small: list[object], tmp_path: Path, optimiser: AttitudeMpc,
    use: Callable[[Any], None],
) -> None:
    use(lambda _config, _backend: optimiser)
    status, out, err = command(*small)
    assert (status, err) == (0, '')
    assert 'Every loop kept every limit' in out
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
    assert names(tmp_path) == ['random-0', 'random-1', 'random-2', 'opposite-0', 'opposite-1']
    page = (tmp_path / 'out' / 'report.html').read_text(encoding='utf-8')
    slowest = data['sets']['random']['slowest'][0]['case']
    assert f'campaign.yaml --case {slowest}' in page
    assert '<p>None.</p>' in page


def test_a_first_torque_with_the_wrong_sign_is_reported(
    command: Command, small: list[object], tmp_path: Path, optimiser: AttitudeMpc,
    use: Callable[[Any], None],
) -> None:
    use(lambda _config, _backend: stubs.FlippedFirst(optimiser))
    status, out, err = command(*small, '--loops', 'opposite=0')
    assert (status, err) == (1, '')
    assert 'FAILED: 3 of 3 loops broke something' in out
    assert 'random-1: decrease' in out
    data = written(tmp_path)
    assert data['sets']['random']['decrease_violations'] == 3
    assert data['sets']['random']['settled'] == 3
    assert [case['name'] for case in data['broken']] == ['random-0', 'random-1', 'random-2']
    assert {tuple(case['broken']) for case in data['broken']} == {('decrease',)}
    page = (tmp_path / 'out' / 'report.html').read_text(encoding='utf-8')
    assert page.count('<td>decrease</td>') == 3


def test_chatter_and_what_never_settles_are_reported(
    command: Command, small: list[object], tmp_path: Path, use: Callable[[Any], None],
) -> None:
    use(stubs.make_undecided)
    status, out, _ = command(*small, '--loops', 'random=0', '--loops', 'opposite=12')
    assert status == 1
    assert 'FAILED: 12 of 12' in out
    assert 'and 2 more, all in the report' in out
    figures = written(tmp_path)['sets']['opposite']
    assert (figures['settled'], figures['chattering_loops']) == (0, 12)
    assert figures['turn_changes_most'] == 50
    assert figures['settling_s'] is None


def test_the_command_that_is_printed_runs_a_broken_case_again(
    command: Command, small: list[object], tmp_path: Path, use: Callable[[Any], None],
) -> None:
    use(stubs.make_undecided)
    _, out, _ = command(*small, '--seed', '5')
    line = next(line for line in out.splitlines() if line.startswith('Run one again:'))
    before = sorted(path.name for path in (tmp_path / 'out').iterdir())
    status, out, _ = command(*line.split('manifold-mpc ')[1].split())
    assert status == 1
    assert 'seed 5' in out
    assert out.count('│ converged │') == 51
    assert 'chatter' in out
    record = written(tmp_path)['broken'][0]
    assert f'{record["initial_rate_rad_s"]:.6g}' in out
    assert sorted(path.name for path in (tmp_path / 'out').iterdir()) == before


def test_plants_have_a_picture_of_their_own(
    command: Command, write: Callable[..., Path], tmp_path: Path, use: Callable[[Any], None],
) -> None:
    use(stubs.make_damping)
    limits = {'spacecraft.inertia_kg_m2': [1.0, 0.9, 0.6]}
    path = write(sets=[plants(loops=4)], controller=limits, acceptance={})
    status, out, err = command('campaign', path, '--workers', '1', '-o', tmp_path / 'out')
    assert (status, err) == (0, '')
    assert 'plants: random attitude, random rate, plant' in out
    assert (tmp_path / 'out' / 'spread.png').read_bytes().startswith(b'\x89PNG')
    page = (tmp_path / 'out' / 'report.html').read_text(encoding='utf-8')
    assert page.count('data:image/png;base64') == 2


def test_an_error_in_a_case_is_one_line(
    command: Command, small: list[object], use: Callable[[Any], None],
) -> None:
    use(stubs.make_thrower)
    status, _, err = command(*small)
    assert status == 2
    assert err == 'manifold-mpc: error: case random-2: ValueError: the third is too much\n'


def test_an_interrupt_reports_what_was_done_and_the_next_run_goes_on(
    command: Command, small: list[object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    use: Callable[[Any], None],
) -> None:
    use(stubs.make_damping)
    run_on_processes, asked = chunks.run_on_processes, []

    def interrupted(work: Any, names: Any, workers: int) -> Iterator[Any]:
        asked.append(list(map(str, names)))
        for done, chunk in enumerate(run_on_processes(work, names, workers)):
            if done == 2 and len(asked) == 1:
                raise KeyboardInterrupt
            yield chunk

    monkeypatch.setattr(chunks, 'run_on_processes', interrupted)
    status, out, _ = command(*small)
    assert status == 130
    assert 'Interrupted' in out
    assert '2 of 5 closed loops' in out
    assert 'The same command again' in out
    data = written(tmp_path)
    assert (data['complete'], data['planned']) == (False, 5)
    assert data['sets']['random']['loops'] == 2
    status, out, _ = command(*small)
    assert '2 of 5 loops are in' in out
    assert asked[1] == ['random-2', 'opposite-0', 'opposite-1']
    assert written(tmp_path)['complete'] is True
    assert names(tmp_path) == ['random-0', 'random-1', *asked[1]]
    command(*small)
    assert len(asked) == 2


def test_a_folder_with_another_campaign_is_refused(
    command: Command, small: list[object], use: Callable[[Any], None],
) -> None:
    use(stubs.make_damping)
    command(*small)
    status, _, err = command(*small, '--seed', '3')
    assert status == 2
    assert 'holds another campaign; --overwrite' in err
    status, out, _ = command(*small, '--seed', '3', '--overwrite')
    assert '5 of 5 closed loops' in out


def test_the_shipped_campaigns_are_listed_and_found_by_name(
    command: Command, use: Callable[[Any], None],
) -> None:
    status, out, _ = command('campaign', '--list')
    assert status == 0
    assert {'theory', 'pointing', 'dispersed'} <= set(out.replace('│', ' ').split())
    use(stubs.make_damping)
    status, out, _ = command('campaign', 'pointing', '--case', 'opposite-3')
    assert 'opposite: exact antipode, at rest' in out


@pytest.mark.parametrize(('arguments', 'words'), [
    (['--loops', '-1'], ['--loops', "'-1'"]),
    (['--loops', 'random=1.5'], ['--loops', 'SET=N']),
    (['--loops', 'tumble=3'], ["'tumble'", "'opposite'"]),
    (['--loops', '0'], ['--loops', 'at least one']),
    (['--workers', '0'], ['--workers', "'0'"]),
    (['--seed', 'x'], ['--seed', "'x'"]),
    (['--workers', '2', '--scheduler', 'tcp://a:1'], ['--scheduler', 'not allowed']),
    (['--case', 'random'], ['random', 'random-17']),
    (['--case', 'tumble-1'], ["'tumble'", "'random'"]),
    (['--controller-config', 'nowhere.yaml'], ['nowhere.yaml']),
    (['-o', 'setup.py'], ['setup.py']),
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


def test_a_campaign_that_is_not_there_is_one_line(command: Command) -> None:
    for given in ('nothing', 'nothing.yaml'):
        status, out, err = command('campaign', given)
        assert (status, out, err.count('\n')) == (2, '', 1)
        assert given in err
