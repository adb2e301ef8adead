# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the verb ``bench`` says: tables of one horizon each, the aims, and where we are behind."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from manifold_mpc_ros.cli import console as report
from manifold_mpc_ros.cli import provenance
from manifold_mpc_ros.lab.benchmark import flops

if TYPE_CHECKING:
    from rich.console import Console

# Where the output is no terminal, a line as often as this.
PLAIN_LINE_PERIOD_S = 10.0
# The run itself is a load of one.
_BUSY = 1.5
STATEMENT = (
    'Times are the least of a few repeats of each solve, so that what else the machine does '
    'counts little; median and 99th percentile are over instances, or steps of closed loops. '
    "'solver' is the solver's own timer, 'call' all Python calls from a state to a torque, the "
    'starting guess of a cold solve given. Compiled C unless a name says VM. The peers solve the '
    'quaternion form with one Runge-Kutta step per interval, ours is the LGVI on SO(3): costs are '
    'compared with the best known of the same form. Everybody stops at 1e-6 but us (1e-8).')


def machine(core: int | None, rate_flop_s: float | None) -> dict[str, Any]:
    """Return what was measured on, with which software and under which load."""
    return {
        'processor': _processor(), 'cores': os.cpu_count(), 'core': core,
        'rate_gflop_s': None if rate_flop_s is None else round(rate_flop_s / 1e9, 2),
        'load_average': [round(value, 2) for value in os.getloadavg()],
        'versions': provenance.versions(rmw=''),
    }


def limits(where: Mapping[str, Any], horizons: Sequence[int]) -> list[dict[str, Any]]:
    """Return the least time of one pass on this core, for each horizon."""
    rate = where['rate_gflop_s']
    return [flops.bound(horizon, 1e9 * rate) for horizon in horizons] if rate else []


def _processor() -> str:
    """Return the processor's name."""
    try:
        lines = Path('/proc/cpuinfo').read_text(encoding='ascii', errors='replace').splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(':')[2].strip() for line in lines if line.startswith('model name')]
    return names[0] if names else platform.processor()


def show(console: Console, data: Mapping[str, Any]) -> None:
    """Print everything that was measured."""
    for horizon in data['settings']['horizons']:
        rows = [row for row in data['rows'] if row['horizon'] == horizon]
        for start in ('cold', 'warm'):
            here = [row for row in rows if row['start'] == start]
            if here:
                console.print(report.grid_table(
                    f'N = {horizon}, {start}: microseconds, median / 99 %', *_table(here, start)))
    _show_missing(console, data['rows'])
    console.print(report.grid_table(
        'Start-up at N = 20 in s, peak memory in MB',
        ('solver', 'imports', 'first build', 'cached build', 'memory'),
        [(row['solver'], *(f'{row[key]:.2f}' if key in row else '-' for key in (
            'imports_s', 'first_build_s', 'cached_build_s', 'peak_memory_mb')))
         for row in data['startup'] if 'why_not' not in row]))
    console.print(report.grid_table(
        'What it has to show', ('aim', 'N', 'value', 'at most', 'met'),
        [(aim['aim'], str(aim.get('horizon', '')), f'{aim["value"]:.3g}',
          f'{aim["at_most"]:g}', 'yes' if aim['met'] else 'NO') for aim in data['targets']]))
    if any(row.get('ahead_of_other_processes') is False for row in data['rows']) and (
            data['machine']['load_average'][0] > _BUSY):
        console.print('The machine was busy and this user may not go ahead of other processes: '
                      'slow solvers look slower than they are.', style='bold')
    for line in data['behind']:
        console.print(f'Behind: {line}', soft_wrap=True, markup=False)
    if not data['behind']:
        console.print('No other solver was faster anywhere in this run.')
    console.print(STATEMENT)


def _table(rows: Sequence[Mapping[str, Any]], start: str
           ) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return header and cells of one table."""
    header: tuple[str, ...] = ('', 'solver', 'call', 'passes', 'solves', 'failed')
    lines: list[tuple[str, ...]] = [
        (row['solver'], f'{row["solver_us_median"]:.0f} / {row["solver_us_p99"]:.0f}',
         f'{row["call_us_median"]:.0f} / {row["call_us_p99"]:.0f}',
         f'{row["iterations_median"]:.0f}', str(row['solves']), str(row['failures']))
        for row in rows]
    if start == 'warm':
        return header, lines
    return (*header, 'dearer', 'worst'), [
        (*line, str(row['dearer_than_best_known']), f'{100 * row["largest_excess"]:.2g} %')
        for line, row in zip(lines, rows)]


def _show_missing(console: Console, rows: Sequence[Mapping[str, Any]]) -> None:
    """Say which solvers were not run, each reason once."""
    reasons = {(row['solver'], row['why_not']) for row in rows if row['start'] == 'none'}
    for name, why_not in sorted(reasons):
        console.print(f'Not run: {name}: {why_not}', soft_wrap=True, markup=False)


def show_instructions(console: Console, rows: Sequence[Mapping[str, Any]]) -> None:
    """Print instructions per solve."""
    console.print(report.grid_table(
        "Instructions per solve in the solver's libraries (callgrind)",
        ('solver', 'N', 'solves', 'instructions'),
        [(row['solver'], str(row['horizon']),
          f'{row["cold"]} cold' + (f', {row["cold"] * row["warm_steps"]} warm'
                                   if row['warm_steps'] else ''),
          f'{row["instructions_per_solve"]:,}') for row in rows]))
