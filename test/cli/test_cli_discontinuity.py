# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``discontinuity``: the jump of the paper's law, its files, and its refusals."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from manifold_mpc_ros.cli.main import main
from manifold_mpc_ros.lab.discontinuity import study

# Design page, trap 1 [N m].
FIRST_TORQUE = 1.1788
PICTURES = {'discontinuity_attitude.png', 'discontinuity_map.png', 'discontinuity_pointing.png'}


class Outcome(NamedTuple):
    status: int
    folder: Path
    out: str
    data: dict[str, Any]


@pytest.fixture(scope='module')
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """Run the paper's law with few samples."""
    folder = tmp_path_factory.mktemp('discontinuity')
    coarse = functools.partial(
        study.study_antipode, radii_deg=(10.0,), samples=12, rings=2)
    with pytest.MonkeyPatch.context() as patch:
        lines: list[str] = []
        patch.setattr('sys.stdout.write', lines.append, raising=False)
        patch.setattr(study, 'study_antipode', coarse)
        status = main(['discontinuity', '--law', 'paper', '--map-axes', '6',
                       '--axis', '0', '0', '2', '--output', str(folder)])
    text = (folder / 'discontinuity.json').read_text(encoding='utf-8')
    return Outcome(status, folder, ''.join(lines), json.loads(text))


def test_the_papers_law_jumps_by_twice_its_first_torque(outcome: Outcome) -> None:
    assert outcome.status == 0
    assert outcome.data['axis'] == [0.0, 0.0, 1.0]
    across = outcome.data['laws']['paper']['across_180_degrees']
    side = across['side_changes']
    assert side['jump_n_m'] == pytest.approx(2 * FIRST_TORQUE, abs=2e-4)
    assert side['at_deg'] == pytest.approx(180.0, abs=1e-3)
    assert np.allclose(side['below_n_m'], [0.0, 0.0, -FIRST_TORQUE], atol=2e-4)
    assert np.allclose(side['above_n_m'], [0.0, 0.0, FIRST_TORQUE], atol=2e-4)
    assert across['other_jumps'] == []
    # The jump stays while the interval shrinks; the change elsewhere goes with the interval.
    assert side['interval_deg'][-1] < 1e-8
    assert side['difference_n_m'][-1] == pytest.approx(side['difference_n_m'][0], rel=1e-2)
    smooth = across['continuous_at']
    assert smooth['difference_n_m'][5] < 1e-2 * smooth['difference_n_m'][0]


def test_the_jump_is_the_same_about_every_axis_of_a_sphere(outcome: Outcome) -> None:
    over = outcome.data['laws']['paper']['over_axes']
    assert np.array(over['axes']).shape == (6, 3)
    assert np.allclose(over['jump_n_m'], 2 * FIRST_TORQUE, atol=2e-4)
    assert np.allclose(over['at_deg'], 180.0, atol=0.011)


def test_the_torque_winds_once_around_the_antipode(outcome: Outcome) -> None:
    around = outcome.data['laws']['paper']['around_the_antipode']
    [circle] = around['circles']
    assert circle['winding'] == 1
    assert circle['jumps'] == []
    assert circle['least_opposite_n_m'] == pytest.approx(2 * circle['least_across_n_m'], rel=1e-3)
    assert len(around['field']['position_deg']) == len(around['field']['torque_across_n_m']) > 8


def test_the_tables_the_reason_and_the_files_are_printed(outcome: Outcome) -> None:
    text = ' '.join(outcome.out.split())
    for said in ('JUMP [N m]', '2.3576', 'no other jump', 'Euler characteristic', 'degree', '+1'):
        assert said in text
    assert {path.name for path in outcome.folder.iterdir()} == {*PICTURES, 'discontinuity.json'}
    for name in PICTURES:
        assert name in text
        assert (outcome.folder / name).read_bytes().startswith(b'\x89PNG')


def test_only_what_is_asked_for_is_measured(
    command: Callable[..., tuple[int, str, str]], tmp_path: Path, quick_controller: Path,
) -> None:
    status, out, _ = command(
        'discontinuity', '--law', 'configured', '--target', 'attitude', '--map-axes', 0,
        '--controller-config', quick_controller, '--axis', '0', '-1', '0',
        '--span', 5, '--output', tmp_path / 'out')
    assert status == 0
    assert {path.name for path in (tmp_path / 'out').iterdir()} == {
        'discontinuity.json', 'discontinuity_attitude.png'}
    assert str(quick_controller) in out.replace('\n', '')
    [law] = json.loads((tmp_path / 'out' / 'discontinuity.json').read_text())['laws'].values()
    assert law['label'] == 'configured body and limits'
    assert law['over_axes'] is None
    assert law['around_the_antipode'] is None


def test_help_says_what_it_shows(command: Callable[..., tuple[int, str, str]]) -> None:
    status, out, _ = command('discontinuity', '--help')
    assert status == 0
    for said in ('--axis X Y Z', '--target', '--map-axes', 'no continuous law', 'examples:'):
        assert said in out


@pytest.mark.parametrize(('arguments', 'said'), [
    (('--axis', '0', '0', '0'), 'not all three zero'),
    (('--axis', '0', '0'), 'expected 3 arguments'),
    (('--axis', '0', 'nan', '1'), "'nan' is not a finite number"),
    (('--axis', '0', 'up', '1'), "'up' is not a finite number"),
    (('--span', '91'), 'above 90 degrees'),
    (('--span', '0'), 'not a number above 0'),
    (('--map-axes', '-3'), 'not a whole number'),
    (('--law', 'mine'), 'invalid choice'),
])
def test_mistakes_are_one_line_and_nothing_is_written(
    arguments: tuple[str, ...], said: str, command: Callable[..., tuple[int, str, str]],
    tmp_path: Path,
) -> None:
    status, out, err = command('discontinuity', *arguments, '--output', tmp_path / 'out')
    assert (status, out) == (2, '')
    assert said in err
    assert err.count('\n') == 1
    assert not (tmp_path / 'out').exists()
