# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What ``bench --batch`` says: how long many closed loops take on all cores, and how they end."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from manifold_mpc_ros.cli import console as report

if TYPE_CHECKING:
    from rich.console import Console

LOOPS, QUICK_LOOPS, TICKS, HORIZON = 10_000, 200, 200, 20
STATEMENT = (
    'Loops from random attitudes (uniform on SO(3)) and rates within 0.2 rad/s on each axis, '
    'torque and rate limits, no terminal set; the LGVI as plant; wall clock of all loops '
    'together. Building is not part of it.')
#: All loops take at most this long [s].
LONGEST_S = 60.0
#: A limit may be exceeded by so much [its unit]: rounding, and the tolerance of a plan.
_OVER = 1e-6


def targets(row: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return what was aimed at, with what was measured; time counts for a whole run only."""
    aims = [('loops that have not settled', row['not_settled'], 0),
            ('solves without a feasible plan', row['solves_without_a_feasible_plan'], 0),
            ('torque over its limit [N m]', row['most_over_torque_limit_n_m'], _OVER),
            ('rate over its limit [rad/s]', row['most_over_rate_limit_rad_s'], _OVER)]
    if row['loops'] == LOOPS:
        aims.insert(0, ('time of all loops [s]', row['elapsed_s'], LONGEST_S))
    return [{'aim': aim, 'value': value, 'at_most': bound, 'met': value <= bound}
            for aim, value, bound in aims]


def show(console: Console, data: Mapping[str, Any]) -> None:
    """Print the figures and what was aimed at."""
    row = data['row']
    console.print(f'{row["loops"]} loops of {row["ticks"]} steps, N = {row["horizon"]}, on '
                  f'{row["threads"]} threads ({row["backend"]}): {row["elapsed_s"]:.1f} s, '
                  f'{row["solves_per_s"]:.0f} solves a second, {row["passes"]} passes, '
                  f'{row["searches"]} searches.', soft_wrap=True, markup=False)
    console.print(report.grid_table(
        'What it has to show', ('aim', 'value', 'at most', 'met'),
        [(aim['aim'], f'{aim["value"]:.3g}', f'{aim["at_most"]:g}',
          'yes' if aim['met'] else 'NO') for aim in data['targets']]))
    console.print(data['statement'])
