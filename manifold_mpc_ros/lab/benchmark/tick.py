# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Controller latency over DDS: the real controller in one process, a probe in another.

Two definitions. In lockstep the controller computes on measurement: from the state's arrival to
the torque's publication, both in the controller (the round trip, both in the probe, stands beside
it: transport both ways and the probe's own executor are in it). By its own timer a
state waits for the tick, which is no latency; there the controller's own figures count: how late
a tick begins, and how long after that its torque is out.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from manifold_mpc_ros.cli import console as report
from manifold_mpc_ros.cli.arguments import shipped_config
from manifold_mpc_ros.cli.processes import NodeProcesses, node_environment, reserved_domain
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.benchmark.peers.problem import INERTIA_KG_M2

if TYPE_CHECKING:
    from rich.console import Console

RATES_HZ = (10.0, 50.0, 100.0, 200.0)
PERCENTILES = (50.0, 99.0, 99.9)
LOCKSTEP, TIMER = 'lockstep', 'timer'
#: The controller's, as where it flies.
PRIORITY = 50
STATEMENT = (
    'Lockstep: from a state received to its torque published, both by the controller, its '
    'executor included; the round trip is from the state published to the torque received by the '
    'other process, late when the next state was due before. Timer: what the controller says of '
    'its ticks on '
    '/diagnostics. Two processes on two cores; N as shipped, no terminal set (at these periods '
    'it is out of reach from the start), closed loop from 50 degrees. The controller has '
    f'realtime.scheduler_priority {PRIORITY} and realtime.lock_memory, where the user may.')
#: At this rate percentiles of the latency are at most these [us].
TARGET_HZ, TARGET_US = 100.0, {'p99': 1200.0, 'p99.9': 2000.0}
#: At these no answer takes longer than a period and no tick is missed.
TIMELY_HZ = (100.0, 200.0)
#: Longer than any first start and both waits of the probe [s].
_PATIENCE_S = 240.0


@dataclass(frozen=True)
class TickSettings:
    """Rates [Hz], the length of each run [s], and the cores of controller and probe."""

    rates_hz: Sequence[float]
    seconds: float
    cores: tuple[int, int]


def measure(settings: TickSettings, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """Return one row for each rate and way of ticking; raises ManifoldMpcError."""
    rows = []
    for mode in (LOCKSTEP, TIMER):
        for rate_hz in settings.rates_hz:
            say(f'{mode}, {rate_hz:g} Hz: {settings.seconds:g} s')
            rows.append(_row(mode, rate_hz, _run(settings, rate_hz, mode == LOCKSTEP)))
    return rows


def _run(settings: TickSettings, rate_hz: float, lockstep: bool) -> dict[str, Any]:
    """Run the controller and the probe; return what the probe saw."""
    parameters = {'mpc.step_s': repr(1.0 / rate_hz), 'mpc.terminal_constraint': 'false',
                  'lockstep': str(lockstep).lower(),
                  'realtime.scheduler_priority': str(PRIORITY), 'realtime.lock_memory': 'true'}
    arguments = ['--params-file', str(shipped_config('controller.yaml'))]
    for name, value in parameters.items():
        arguments += ['-p', f'{name}:={value}']
    task = {'rate_hz': rate_hz, 'seconds': settings.seconds, 'lockstep': lockstep,
            'inertia_kg_m2': INERTIA_KG_M2.tolist()}
    probe = [sys.executable, '-m', 'manifold_mpc_ros.lab.benchmark.latency_probe',
             json.dumps(task)]
    with tempfile.TemporaryDirectory(prefix='tick_') as folder, reserved_domain() as domain, (
            NodeProcesses()) as processes:
        environment = node_environment(domain)
        allowed = os.sched_getaffinity(0)
        try:  # a child takes over the cores of its parent
            os.sched_setaffinity(0, {settings.cores[0]})
            processes.start('controller', arguments, environment, Path(folder, 'controller.log'))
            os.sched_setaffinity(0, {settings.cores[1]})
            done = subprocess.run(probe, env=environment, text=True, capture_output=True,
                                  check=False, timeout=_PATIENCE_S + settings.seconds)
        except subprocess.TimeoutExpired:
            raise ManifoldMpcError('the probe did not end') from None
        finally:
            os.sched_setaffinity(0, allowed)
        if done.returncode != 0:
            raise ManifoldMpcError(
                f'{(done.stderr.strip().splitlines() or ["the probe failed"])[-1]}; '
                f'the controller: {processes.nodes[0].last_words()}')
    seen: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return seen


def _row(mode: str, rate_hz: float, seen: Mapping[str, Any]) -> dict[str, Any]:
    """Return one row: percentiles of everything, and the ticks missed."""
    row: dict[str, Any] = {
        'mode': mode, 'rate_hz': rate_hz, 'ticks': seen['ticks'], 'missed': seen['missed']}
    for name in ('latencies_us', 'intervals_us'):
        if seen.get(name):
            row[name.replace('ies_us', 'y_us').replace('s_us', '_us')] = percentiles(seen[name])
    for key, values in seen['reported'].items():
        if values:
            row[f'reported_{key}'] = values[-1] if key == 'missed_ticks' else percentiles(values)
    return row


def percentiles(values: Sequence[float]) -> dict[str, float]:
    """Return the percentiles and the largest value."""
    found = {f'p{each:g}': float(np.percentile(values, each)) for each in PERCENTILES}
    return {key: round(value, 1) for key, value in {**found, 'max': max(values)}.items()}


def targets(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return what latency and ticks have to be, with what they are."""
    aims: list[tuple[str, float, float]] = []
    for row in rows:
        rate_hz = row['rate_hz']
        if rate_hz == TARGET_HZ and 'reported_answer_time_us' in row:
            aims += [(f'{name} latency at {rate_hz:g} Hz [us]',
                      row['reported_answer_time_us'][name], bound)
                     for name, bound in TARGET_US.items()]
        if rate_hz in TIMELY_HZ and 'reported_answer_time_us' in row:
            aims.append((f'longest latency at {rate_hz:g} Hz [us]',
                         row['reported_answer_time_us']['max'], 1e6 / rate_hz))
        if rate_hz in TIMELY_HZ and 'reported_missed_ticks' in row:
            aims.append((f'ticks missed by the controller at {rate_hz:g} Hz',
                         row['reported_missed_ticks'], 0))
    return [{'aim': aim, 'value': value, 'at_most': bound, 'met': value <= bound}
            for aim, value, bound in aims]


def show(console: Console, data: Mapping[str, Any]) -> None:
    """Print both ways of ticking, and what was aimed at."""
    ways = ((LOCKSTEP, 'state received to torque published',
             ('latency', 'reported_answer_time_us'), ('round trip', 'latency_us')),
            (TIMER, 'tick due to torque out',
             ('late', 'reported_tick_lateness_us'), ('tick', 'reported_tick_time_us')))
    for mode, what, *columns in ways:
        rows = [row for row in data['rows'] if row['mode'] == mode]
        console.print(report.grid_table(
            f'{mode.capitalize()}: {what}; microseconds, 50 / 99 / 99.9 %',
            ('Hz', *(title for title, _ in columns), 'solve', 'ticks', 'late at the probe',
             'missed'),
            [(f'{row["rate_hz"]:g}', *(_three(row, key) for _, key in columns),
              _three(row, 'reported_solve_time_us'), str(row['ticks']), str(row['missed']),
              f'{row["reported_missed_ticks"]:g}' if 'reported_missed_ticks' in row else '-')
             for row in rows]))
    for aim in data['targets']:
        console.print(f'{aim["aim"]}: {aim["value"]:g}, at most {aim["at_most"]:g}: '
                      f'{"met" if aim["met"] else "NOT met"}', markup=False)
    console.print(data['statement'])


def _three(row: Mapping[str, Any], key: str) -> str:
    """Return the percentiles of a figure, a dash where the controller does not report it."""
    if key not in row:
        return '-'
    return ' / '.join(f'{row[key][f"p{each:g}"]:.0f}' for each in PERCENTILES)
