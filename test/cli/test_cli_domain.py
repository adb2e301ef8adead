# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The domain of attraction: what is printed, written and drawn, and how it ends."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from interruptible import take_interrupts
from matplotlib.image import imread

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lab.domain.domain import NONE, Domain, Progress, Round, Settings
from manifold_mpc_ros.lab.domain.states import States, half_turns, moving_states
from manifold_mpc_ros.terminal.design import TerminalDesign

Command = Callable[..., tuple[int, str, str]]
TOP = Path(__file__).parents[2]
COARSE = ('--states', '60', '--half-turns', '12', '--resolution', '9', '--workers', '1')


@pytest.fixture
def quick(write_config: Callable[..., Path]) -> Path:
    """A controller whose states at rest need three steps at most; its solvers build quickly."""
    return write_config('controller', **{
        'mpc.horizon': 3, 'mpc.torque_weight': [20.0] * 3,
        'limits.max_torque_n_m': [0.8] * 3, 'limits.max_rate_rad_s': [float('inf')] * 3})


@pytest.fixture
def by_angle(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Replace the search: N is one for each 20 degrees, and 12 above 'most' does not exist."""
    seen: dict[str, Any] = {'most': 9}

    def search(
        _config: AttitudeMpcConfig, _terminal: TerminalDesign, states: Sequence[States], *,
        settings: Settings, progress: Progress,
    ) -> list[Domain]:
        seen.update(settings=settings, names=[group.name for group in states])
        found = []
        for group in states:
            needed = np.ceil(np.linalg.norm(group.vectors, axis=1) / np.radians(20) - 1e-9)
            found.append(Domain(group, np.where(needed > seen['most'], NONE, needed).astype(int)))
        total = sum(map(len, states))
        progress(Round(1, (20,), total, total, total, total, total))
        return found

    monkeypatch.setattr('manifold_mpc_ros.lab.domain.domain.smallest_horizons', search)
    return seen


def test_a_real_run(command: Command, quick: Path, tmp_path: Path) -> None:
    status, out, err = command(
        'domain', '--controller-config', quick, '--states', '12', '--half-turns', '1',
        '--resolution', '5', '--workers', '1', '--output', tmp_path / 'out')
    assert (status, err) == (0, '')
    data = json.loads((tmp_path / 'out' / 'domain.json').read_text(encoding='utf-8'))
    grid, turns = data['groups']
    assert (grid['states'], turns['states']) == (12, 4)
    assert turns['smallest_horizon_for_all'] == 3
    assert grid['all_inside_configured']
    assert sum(grid['histogram'].values()) == 12
    assert [len(plane['smallest_horizons']) for plane in data['planes']] == [25, 25, 25]
    assert 'round 1: N = 3; ' in out
    assert imread(tmp_path / 'out' / 'domain.png').std() > 0.05


def test_what_is_printed_and_written(
    command: Command, by_angle: dict[str, Any], tmp_path: Path,
) -> None:
    status, out, err = command('domain', *COARSE, '--largest-rate', '0.3', '--output', tmp_path)
    assert (status, err) == (0, '')
    assert by_angle['names'][:3] == [
        'grid at rest', 'half turns at rest', 'grid at rates up to 0.3 rad/s']
    assert by_angle['settings'].workers == 1
    text = ' '.join(out.replace('│', ' ').split())
    assert text.count('9 (4.5 s) is enough for each of') == 3
    assert '20 (enough: all 60 sampled states are inside)' in text
    assert '180 deg about (1, 0, 0) (15 in the group need as many steps)' in text
    assert 'covering radius' in text
    assert out.count('sampled') >= 6
    assert re.findall(r'\w+ certified', text) == ['is certified']
    assert 'nothing is certified between them' in text
    data = json.loads((tmp_path / 'domain.json').read_text(encoding='utf-8'))
    assert 'nothing is certified' in data['statement']
    assert data['configured_horizon'] == 20
    for group, size in zip(data['groups'], (60, 15, 60)):
        smallest = np.array(group['smallest_horizons'])
        assert len(smallest) == size
        for n, share in group['fraction_inside'].items():
            assert share == np.mean(smallest <= int(n))
    hardest = np.array(data['groups'][1]['hardest_rotation_vector_rad'])
    assert np.allclose(hardest, [np.pi, 0, 0])
    assert (tmp_path / 'domain.png').is_file()


def test_a_horizon_that_is_too_short_is_said(
    command: Command, by_angle: dict[str, Any], write_config: Callable[..., Path],
    tmp_path: Path,
) -> None:
    by_angle['most'] = 8
    short = write_config('controller', **{'mpc.horizon': 5})
    status, out, _ = command('domain', *COARSE, '--no-picture', '--controller-config', short,
                             '--output', tmp_path)
    text = ' '.join(out.replace('│', ' ').split())
    assert status == 0
    assert '15 states without a plan at any N tried' in text
    assert '5 (NOT enough: from 15 of 15 sampled states no plan was found' in text
    assert [path.name for path in tmp_path.iterdir() if path.suffix != '.yaml'] == ['domain.json']
    turns = json.loads((tmp_path / 'domain.json').read_text(encoding='utf-8'))['groups'][1]
    assert turns['smallest_horizon_for_all'] is None
    assert turns['no_plan_found'] == 15
    assert turns['smallest_horizons'] == [None] * 15


def test_pointing_is_drawn_on_its_own_manifold(
    command: Command, by_angle: dict[str, Any], write_config: Callable[..., Path],
    tmp_path: Path,
) -> None:
    path = write_config('controller', target='pointing')
    status, out, _ = command('domain', *COARSE, '--controller-config', path,
                             '--output', tmp_path)
    assert status == 0
    assert by_angle['names'] == ['grid at rest', 'antipode at rest', 'plane of 1 and 2']
    assert 'no direction is farther' in ' '.join(out.split())
    assert imread(tmp_path / 'domain.png').std() > 0.05


@pytest.mark.parametrize(('arguments', 'words'), [
    (('--states', '9'), ("'9' is not a whole number from 10",)),
    (('--states', 'many'), ('--states', "'many'")),
    (('--workers', '0'), ('--workers', 'from 1')),
    (('--resolution', '4'), ('--resolution', 'from 5')),
    (('--largest-rate', '-0.1'), ('--largest-rate', 'above 0')),
    (('--largest-rate', '5'), ('largest rate', 'below 1.2', 'step exists')),
    (('--controller-config', 'nowhere.yaml'), ('nowhere.yaml',)),
])
def test_mistakes_are_one_line(
    command: Command, by_angle: dict[str, Any], tmp_path: Path, arguments: tuple[str, ...],
    words: tuple[str, ...],
) -> None:
    status, out, err = command('domain', *COARSE, '--output', tmp_path / 'out', *arguments)
    assert (status, out) == (2, '')
    assert err.count('\n') == 1
    for word in words:
        assert word in err
    assert 'names' not in by_angle
    assert not (tmp_path / 'out').exists()


def test_an_interrupt_ends_it(quick: Path, tmp_path: Path) -> None:
    """With workers: exit status 130, one line, and no process that holds our pipes is left."""
    path = os.pathsep.join([str(TOP), *filter(None, [os.environ.get('PYTHONPATH')])])
    process = subprocess.Popen(
        [sys.executable, '-m', 'manifold_mpc_ros.cli.main', 'domain', '--controller-config',
         str(quick), '--states', '30000', '--no-picture', '--workers', '2', '--output',
         str(tmp_path)], env=dict(os.environ, PYTHONPATH=path), text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
        preexec_fn=take_interrupts)
    assert process.stdout is not None
    for line in process.stdout:
        if 'round 2: ' in line:
            break
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err == 'manifold-mpc: interrupted\n'
    assert list(tmp_path.glob('domain.*')) == []


def test_groups_of_states_have_the_sizes_that_were_asked() -> None:
    config = AttitudeMpcConfig.from_yaml(TOP / 'config' / 'controller.yaml')
    assert len(half_turns(config, 12)) == 15
    assert len(moving_states(config, 60, 0.3)) == 60
