# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb bench: a tiny comparison, its files, and what it says of mistakes."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from manifold_mpc_ros.lab.benchmark import batch, tick
from manifold_mpc_ros.lab.benchmark.peers import instances

Command = Callable[..., tuple[int, str, str]]


def test_a_tiny_comparison(command: Command, tmp_path: Path) -> None:
    output = tmp_path / 'new' / 'bench.json'
    status, out, err = command('bench', '--quick', '--horizons', 5, '--instances', 1,
                               '--solvers', 'ours, local', 'fatrop in', '--output', output)
    assert (status, err) == (0, '')
    data = json.loads(output.read_text(encoding='utf-8'))
    assert {(row['solver'], row['start']) for row in data['rows']} == {
        ('ours, local', 'cold'), ('fatrop in the VM', 'cold'),
        ('fatrop in the VM', 'warm')}
    assert len(instances.read(tmp_path / 'new' / 'bench_instances.json')) == 13
    assert (tmp_path / 'new' / 'bench.png').read_bytes()[:4] == b'\x89PNG'
    assert 'fatrop in the VM' in out
    assert str(output) in out


@pytest.mark.parametrize(('arguments', 'named'), [
    (['--solvers', 'nobody'], 'nobody'),
    (['--core', '4096'], '4096'),
    (['--horizons', '0'], "'0'"),
    (['--instances', 'many'], "'many'"),
    (['--tick', '--instructions'], '--instructions'),
    (['--tick', '--batch'], '--batch'),
    (['--seconds', '-1'], '--seconds'),
])
def test_mistakes_are_one_line(command: Command, arguments: list[str], named: str) -> None:
    status, out, err = command('bench', *arguments)
    assert (status, out) == (2, '')
    assert named in err
    assert len(err.splitlines()) == 1


def test_latency_over_dds() -> None:
    """Figures of one clock are compared with each other; how large they are is the machine's."""
    rows = tick.measure(tick.TickSettings((4.0,), 2.5, (0, 0)), lambda _: None)
    assert [row['mode'] for row in rows] == ['lockstep', 'timer']
    lockstep, timer = rows
    assert lockstep['ticks'] == 10
    assert lockstep['missed'] < 10
    for figures in (lockstep['latency_us'], lockstep['reported_answer_time_us']):
        assert 0 < figures['p50'] <= figures['p99'] <= figures['max']
    solve, answer = lockstep['reported_solve_time_us'], lockstep['reported_answer_time_us']
    assert all(0 < solve[key] <= answer[key] for key in solve)  # of the same ticks, so in order
    assert timer['ticks'] >= 1
    assert timer['reported_solve_time_us']['p50'] > 0


def test_the_aims_of_the_latency() -> None:
    row = {'mode': 'lockstep', 'rate_hz': 100.0, 'ticks': 9, 'missed': 1,
           'reported_answer_time_us': tick.percentiles([100.0] * 99 + [5000.0])}
    timer = {'mode': 'timer', 'rate_hz': 100.0, 'ticks': 9, 'reported_missed_ticks': 0.0}
    assert [aim['met'] for aim in tick.targets([row, timer])] == [True, False, True, True]
    fast = {**row, 'rate_hz': 200.0}
    assert [aim['met'] for aim in tick.targets([fast])] == [True]
    fast['reported_answer_time_us'] = tick.percentiles([5001.0])
    assert [aim['met'] for aim in tick.targets([fast])] == [False]
    assert tick.targets([{**row, 'rate_hz': 50.0}]) == []


def test_many_loops(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch, 'QUICK_LOOPS', 3)
    output = tmp_path / 'batch.json'
    status, out, err = command('bench', '--batch', '--quick', '--output', output)
    assert (status, err) == (0, '')
    data = json.loads(output.read_text(encoding='utf-8'))
    assert data['row']['loops'] == 3
    assert data['row']['passes'] > 3 * 200
    assert [aim['met'] for aim in data['targets']] == [True] * 4
    assert '3 loops of 200 steps' in out


def test_the_aims_of_many_loops() -> None:
    row = {'loops': batch.LOOPS, 'elapsed_s': 61.0, 'not_settled': 1,
           'solves_without_a_feasible_plan': 2, 'most_over_torque_limit_n_m': 1e-3,
           'most_over_rate_limit_rad_s': -0.1}
    assert [aim['met'] for aim in batch.targets(row)] == [False] * 4 + [True]
    assert len(batch.targets({**row, 'loops': 7})) == 4
