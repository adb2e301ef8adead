# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What ``bench --constrained`` measures and says: public slews with cones, flown and timed."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np

from manifold_mpc_ros.cli import console as report
from manifold_mpc_ros.lab.benchmark.constrained import bounds, fly, slews, timing
from manifold_mpc_ros.lab.benchmark.peers.worker import take_core

if TYPE_CHECKING:
    from rich.console import Console

FRAMES, QUICK_FRAMES, TIMED_TICKS = 20, 2, 56
STATEMENT = (
    'Slews in inertial frames turned at random, on a plant of its own (Runge-Kutta, at least 100 '
    'steps in one of the predictor), seen at every step of it: with cones at least every 10 ms. '
    'Bounds by IPOPT, 50 intervals. Published times as their papers have them. Solve times: of '
    "each tick the quickest of a few repeats, the solvers' own timers, on one core; the others "
    'solve the quaternion form with one Runge-Kutta step an interval, to 1e-6, we to 1e-8.')
#: A motor or a limit counts as kept up to rounding.
_ROUNDING = 1e-6
_LARGEST = ('energy', 'rate', 'motor', 'momentum', 'torque')


def measure(frames: int, core: int, say: Callable[[str], None], *, peers: bool = True
            ) -> dict[str, Any]:
    """Fly every slew in so many frames, find the bounds, time the solvers."""
    every, context = slews.slews(), multiprocessing.get_context('spawn')
    known = {slew.bound: bounds.time_optimal_s(slew, say) for slew in every
             if slew.within is not None and not slew.profile}
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), context) as pool:
        rows = []
        for row in pool.map(flown, every, [frames] * len(every),
                            [known.get(slew.bound) for slew in every]):
            rows.append(row)
            say(f'{len(rows)} of {len(every)} slews flown')
    with ProcessPoolExecutor(1, context, _prepare, (core,)) as pool:
        say('solve times')
        timed = [pool.submit(timing.measure, slew, TIMED_TICKS, peers=peers).result()
                 for slew in every[:2]]
    return {'statement': STATEMENT, 'rows': rows, 'timing': timed, 'targets': targets(rows, timed)}


def flown(slew: slews.Slew, frames: int, bound_s: float | None) -> dict[str, Any]:
    """Return what became of a slew in so many frames."""
    pilots, seen = fly.fly(slew, fly.frames_of(frames), lambda _: None)
    return {
        'problem': slew.name, 'bound_s': bound_s, 'others_s': list(slew.others_s),
        'allowed_s': None if bound_s is None or slew.within is None else slew.within * bound_s,
        'runs': fly.judged(slew, pilots, seen), 'angles': _angles(seen)}


def _prepare(core: int) -> None:
    """Take a core, and say nothing: acados prints."""
    take_core(core)
    quiet = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(quiet, stream)


def _angles(seen: fly.Seen) -> dict[str, list[float]]:
    """Return the angles to cones over time in the first frame, about 200 of each [deg]."""
    every = max(1, len(seen.time_s) // 200)
    found = {key[5:]: value[::every, 0] for key, value in seen.values.items()
             if key.startswith('cone ')}
    return {key: np.round(value, 3).tolist() for key, value in {
        'time_s': seen.time_s[::every], **found}.items()}


def targets(rows: list[dict[str, Any]], timed: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return what was aimed at, with what was measured."""
    aims: list[tuple[str, float, float]] = []
    for row in rows:
        runs = row['runs']
        settled = [np.inf if run['settled_s'] is None else run['settled_s'] for run in runs]
        if row['allowed_s'] is not None:
            aims.append((f'{row["problem"]}: settled after [s]', max(settled), row['allowed_s']))
        margins = [value for run in runs for value in run['least_margin_deg'].values()]
        if margins:
            aims.append((f'{row["problem"]}: degrees into a cone', -min(margins), 0.0))
        largest = max(run.get(f'largest_{key}', 0.0) for run in runs for key in _LARGEST
                      if key != 'rate' or row['problem'] != 'B3')  # its rate limit is ours
        aims.append((f'{row["problem"]}: part of a limit', largest, 1.0 + _ROUNDING))
    for each in timed:
        ours = each['rows'][0]
        aims += [(f'{each["problem"]}: warm solve, 99 % [ms]', ours['call_ms_p99'], 1.0),
                 (f'{each["problem"]}: first search [ms]', ours['first_ms'], 50.0),
                 (f'{each["problem"]}: warm solves, with cones over without',
                  each['cones_cost']['sum'], 1.5)]
    return [{'aim': aim, 'value': None if value == np.inf else value, 'at_most': bound,
             'met': bool(value <= bound)} for aim, value, bound in aims]


def show(console: Console, data: Mapping[str, Any]) -> None:
    """Print the figures and what was aimed at."""
    console.print(report.grid_table(
        'Public slews', ('problem', 'frames', 'settled after [s]', 'bound [s]', 'published [s]',
                         'least angle to a cone [deg]'), [_line(row) for row in data['rows']]))
    for each in data['timing']:
        console.print(report.grid_table(
            f'{each["problem"]}, N = {each["horizon"]}: solve times [ms]',
            ('solver', 'first', 'warm, median', 'warm, 99 %', 'passes', 'failed'),
            [timed_line(row) for row in each['rows']]))
    console.print(report.grid_table(
        'What it has to show', ('aim', 'value', 'at most', 'met'),
        [(aim['aim'], 'none' if aim['value'] is None else f'{aim["value"]:.4g}',
          f'{aim["at_most"]:.4g}', 'yes' if aim['met'] else 'NO') for aim in data['targets']]))
    console.print(data['statement'])


def _line(row: Mapping[str, Any]) -> tuple[str, ...]:
    """Return a slew as a line of the table."""
    settled = [run['settled_s'] for run in row['runs'] if run['settled_s'] is not None]
    margins = [value for run in row['runs'] for value in run['least_margin_deg'].values()]
    return (row['problem'], str(len(row['runs'])),
            f'{min(settled):.4g} to {max(settled):.4g}' if settled else 'never',
            '-' if row['bound_s'] is None else f'{row["bound_s"]:.1f}',
            ', '.join(f'{other:g}' for other in row['others_s']) or '-',
            f'{min(margins):.2f}' if margins else '-')


def timed_line(row: Mapping[str, Any]) -> tuple[str, ...]:
    """Return a solver's times as a line of the table."""
    if 'why_not' in row:
        return (row['solver'], row['why_not'], '-', '-', '-', '-')
    return (row['solver'], *(f'{row[key]:.3g}' for key in (
        'first_ms', 'warm_ms_median', 'warm_ms_p99', 'passes_median')),
        f'{row["failures"]} of {row["solves"] + 1}')
