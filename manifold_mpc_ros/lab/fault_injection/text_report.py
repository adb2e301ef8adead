# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the verb ``chaos`` prints and writes: the survival table."""

from __future__ import annotations

import argparse
import json
import platform
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from manifold_mpc_ros.cli import console as report
from manifold_mpc_ros.cli import provenance
from manifold_mpc_ros.lab.fault_injection import summary
from manifold_mpc_ros.lab.fault_injection.fault import Fault

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from manifold_mpc_ros.lab.fault_injection.run import Done

_HEADER = ('fault', 'survived', 'detection [s]', 'recovery [s]', 'gap [s]')
#: Verdicts that the terminal lists; the JSON file has all.
LISTED = 20


def fault_list(faults: Sequence[Fault]) -> Table:
    """Return the names of faults and what they do."""
    return report.result_table('Faults', [(fault.name, fault.does) for fault in faults])


def show(console: Console, done: Done) -> None:
    """Print the survival table and the verdict."""
    console.print(report.grid_table('Survival by kind of fault', _HEADER, [
        (row, f'{group["survived"]} of {group["injected"]}', _spread(group['detection_s']),
         _spread(group['recovery_s']), f'{group["longest_gap_s"]:.3f}')
        for row, group in summary.grouped(done.verdicts, lambda v: v.row).items()]))
    console.print(report.result_table(
        f'{len(done.verdicts)} of {done.planned} faults in {done.elapsed_s:.0f} s, '
        f'{done.pairs} pair(s) of nodes', _rows(done)))
    failed = [verdict for verdict in done.verdicts if not verdict.survived]
    for verdict in failed[:LISTED]:
        console.print(f'  {verdict.fault} ({verdict.phase}, seed {verdict.seed}): '
                      + '; '.join(verdict.reasons), soft_wrap=True, markup=False)
    if done.failure:
        console.print(f'ENDED EARLY: {done.failure}', soft_wrap=True, markup=False)
    elif failed:
        console.print(f'FAILED: {len(failed)} of {len(done.verdicts)} faults not survived')
    elif len(done.verdicts) < done.planned:
        console.print('INCOMPLETE: all survived of those that were injected')
    else:
        console.print('Every fault survived.')


def _rows(done: Done) -> list[tuple[str, str]]:
    """Return the figures of the whole run as text."""
    figures = summary.totals(done.verdicts)
    gap = figures['longest_gap_s']
    rows = [
        ('faults injected / survived',
         f'{figures["faults_injected"]} / {figures["faults_survived"]}'),
        ('rate of control, and slower where the machine had no time for it (Hz)',
         ', '.join(f'{rate_hz:g}' for rate_hz in sorted(set(done.rates_hz), reverse=True))),
        ('of these late by the machine alone', f'{figures["excused_by_the_machine"]}'),
        ('trials void and repeated, the machine being too slow', f'{len(done.voided)}'),
        ('detection, median / longest (s)', _spread(figures['detection_s'])),
        ('recovery, median / longest (s)', _spread(figures['recovery_s'])),
        ('longest gap between commands (s)', 'none' if gap is None else
            f'{gap:.3f} (unless their source was dead, stopped or starved)'),
        ('commands / most within a step', f'{figures["commands"]} / {figures["largest_burst"]}'),
        ("ticks missed, by the controller's own account", f'{figures["missed_ticks"]}'),
        ('not finite / over limit',
         f'{figures["non_finite_commands"]} / {figures["over_limit_commands"]}'),
        ('beyond one per tick', f'{figures["commands_beyond_one_per_tick"]}'),
        ('unhandled exceptions', f'{figures["unhandled_exceptions"]}'),
        ('observer late by, median / most (s)', _spread(figures['observer_late_s'])),
        ('nodes kept from a processor, median / most (s)',
         _spread(figures['nodes_waited_for_a_processor_s'])),
    ]
    for memory in summary.longest_lives(done.memory):
        slope = memory.slope_kib_per_min
        rows.append((f'memory of the {memory.node}', (
            f'{memory.end_kib / 1024:.0f} MiB after {memory.life_s:.0f} s, '
            + ('lived too short for a slope' if slope is None else f'{slope:+.1f} KiB/min'))))
    return rows


def _spread(spread: dict[str, float] | None) -> str:
    """Return median and largest as text."""
    return 'none' if spread is None else f'{spread["median"]:.3f} / {spread["max"]:.3f}'


def write(path: Path, kind: str, arguments: argparse.Namespace, done: Done) -> Path:
    """Write every figure as JSON; return where."""
    asked = {name: str(value) if isinstance(value, Path) else value
             for name, value in sorted(vars(arguments).items())
             if name not in ('run', 'verb', 'list', 'output') and value not in (None, False)}
    data: dict[str, Any] = {
        'kind': kind,
        'asked': asked,
        'planned': done.planned,
        'complete': len(done.verdicts) == done.planned and not done.failure,
        'failure': done.failure,
        'totals': summary.totals(done.verdicts),
        'memory': [asdict(memory) for memory in done.memory],
        'by_row': summary.grouped(done.verdicts, lambda v: v.row),
        'by_fault': summary.grouped(done.verdicts, lambda v: v.fault),
        'by_phase': summary.grouped(done.verdicts, lambda v: v.phase),
        'voided': [asdict(verdict) for verdict in done.voided],
        'excused': summary.excused(done.verdicts),
        'not_survived': summary.not_survived(done.verdicts),
        'versions': provenance.versions(done.middleware),
        'this_machine': {
            'machine': platform.machine(), 'pairs': done.pairs,
            'elapsed_s': done.elapsed_s, 'start_of_a_pair_s': done.start_s,
            'rates_hz': done.rates_hz},
    }
    path.write_text(json.dumps(_rounded(data), indent=2, allow_nan=False) + '\n',
                    encoding='utf-8')
    return path


def _rounded(value: Any) -> Any:
    """Return a figure with four digits behind the point, wherever it is."""
    if isinstance(value, float):
        return round(value, 4)
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(item) for item in value]
    return value
