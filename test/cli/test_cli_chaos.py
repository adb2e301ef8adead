# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Faults over DDS by the command: the short selection survived, Ctrl-C, mistakes in one line."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from interruptible import take_interrupts

from manifold_mpc_ros.cli.processes import node_environment
from manifold_mpc_ros.lab.fault_injection.table import FAULTS, QUICK

Command = Callable[..., tuple[int, str, str]]
TOP = Path(__file__).parents[2]
CHAOS = [sys.executable, '-m', 'manifold_mpc_ros.cli.main', 'chaos']
#: Beside other tests, two pairs have too little of two cores.
ONE = ['--pairs', '1']


def environment() -> dict[str, str]:
    path = os.pathsep.join([str(TOP), *filter(None, [os.environ.get('PYTHONPATH')])])
    return dict(node_environment(0), PYTHONPATH=path)


def written(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text(encoding='utf-8'))


@pytest.mark.timeout(900)
def test_the_short_selection_is_survived(tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    output = tmp_path / 'chaos.json'
    done = subprocess.run([*CHAOS, *ONE, '--output', str(output)], env=environment(), text=True,
                          capture_output=True, check=False, timeout=850)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stderr == ''
    assert 'Every fault survived.' in done.stdout
    data = written(output)
    assert set(data['by_fault']) == set(QUICK)
    totals = data['totals']
    assert totals['faults_injected'] == totals['faults_survived'] == len(QUICK)
    assert totals['commands'] > 200
    for name in ('non_finite_commands', 'over_limit_commands', 'unhandled_exceptions',
                 'commands_beyond_one_per_tick'):
        assert totals[name] == 0, name
    assert data['complete'] is True
    assert data['not_survived'] == []
    assert data['versions']['rmw']
    assert {memory['node'] for memory in data['memory']} == {'controller', 'simulator'}
    assert 0.0 < totals['detection_s']['median'] < totals['detection_s']['max'] < 20.0


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_the_nodes_and_keeps_what_was_measured(
        tmp_path: Path, number: signal.Signals) -> None:
    pytest.importorskip('rclpy')
    output = tmp_path / 'chaos.json'
    process = subprocess.Popen(
        [*CHAOS, *ONE, '--matrix', '--output', str(output)], env=environment(),
        text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, preexec_fn=take_interrupts)
    assert process.stdout is not None
    lines = iter(process.stdout.readline, '')
    assert any(' injected, ' in line for line in lines)
    children = Path(f'/proc/{process.pid}/task/{process.pid}/children')
    nodes = [int(pid) for task in Path(f'/proc/{process.pid}/task').glob('*')
             for pid in (task / 'children').read_text().split()] or [
                 int(pid) for pid in children.read_text().split()]
    assert len(nodes) == 2
    process.send_signal(number)
    out, err = process.communicate(timeout=200)
    assert process.returncode == 130, out + err
    assert err == ''
    assert 'INCOMPLETE' in out
    assert not any(Path(f'/proc/{pid}').exists() for pid in nodes)
    data = written(output)
    assert data['complete'] is False
    assert data['planned'] == 3 * len(FAULTS)
    assert 0 < data['totals']['faults_injected'] < data['planned']


def test_mistakes_are_one_line(command: Command, tmp_path: Path) -> None:
    broken = tmp_path / 'controller.yaml'
    shipped = (TOP / 'config' / 'chaos' / 'controller.yaml').read_text(encoding='utf-8')
    broken.write_text(shipped.replace('horizon: 20', 'horizon: many'), encoding='utf-8')
    for arguments, words in (
        (('--fault', 'no-such'), 'one of none, state-nan-attitude'),
        (('--soak', '5x'), 'not a time such as 90s, 20min or 1h'),
        (('--soak', '0s'), 'not a number above 0'),
        (('--drills', '0'), 'not a whole number'),
        (('--matrix', '--soak', '1h'), 'not allowed with argument'),
        (('--drills', '2', '--fault', 'hogs'), 'a fault that this run can inject'),
        (('--output', tmp_path), 'a file that can be written'),
        (('--controller-config', broken, '--output', tmp_path / 'x.json'), 'mpc.horizon'),
        (('--controller-config', tmp_path / 'absent.yaml', '--output', tmp_path / 'x.json'),
         'absent.yaml'),
    ):
        status, out, err = command('chaos', *arguments)
        assert (status, out) == (2, ''), (arguments, out, err)
        assert err.count('\n') == 1
        assert words in err


def test_the_list_has_every_fault(command: Command) -> None:
    status, out, _ = command('chaos', '--list')
    assert status == 0
    for fault in FAULTS:
        assert fault.name in out
