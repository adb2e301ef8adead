# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the comparison has to show, worked out from its rows; and where we are behind.

Ratios are of solvers' own clocks only, and of runs at the same horizon.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from manifold_mpc_ros.lab.benchmark.peers import solver

Rows = Sequence[Mapping[str, Any]]
CLOCKS = ('solver_us_median', 'solver_us_p99')
SHORT, LONG = 10, 160
LARGEST_GROWTH = 20.0
LONGEST_FIRST_START_S, LONGEST_CACHED_START_S = 5.0, 0.5


def targets(rows: Rows, startup: Rows) -> list[dict[str, Any]]:
    """Return each aim with its value, its bound and whether it is met, of what was run."""
    found: list[dict[str, Any]] = []
    for horizon in dict.fromkeys(row['horizon'] for row in rows):
        here = [row for row in rows if row['horizon'] == horizon]
        found += ({'horizon': horizon, **aim} for aim in _of_one_horizon(here))
    return found + list(_growth(rows)) + list(_startup(startup))


def _of_one_horizon(rows: Rows) -> Iterator[dict[str, Any]]:
    """Yield the aims that compare rows of one horizon."""
    acados = [solver.ACADOS_SQP.name, solver.ACADOS_DAQP.name]
    warm, local = _row(rows, solver.OUR_SEARCH, 'warm'), _row(rows, solver.OUR_LOCAL, 'cold')
    search = _row(rows, solver.OUR_SEARCH, 'cold')
    for clock in CLOCKS:
        which = clock.removeprefix('solver_us_')
        yield from _ratio(f'warm {which} over acados SQP', clock, warm,
                          _fastest(rows, acados, 'warm', clock), 0.5)
        yield from _ratio(f'cold local {which} over acados SQP', clock, local,
                          _fastest(rows, acados, 'cold', clock), 0.5)
        yield from _ratio(f'cold search {which} over acados SQP', clock, search,
                          _fastest(rows, acados, 'cold', clock), 1.0)
    yield from _ratio('warm median over one acados RTI iteration', CLOCKS[0], warm,
                      _row(rows, solver.ACADOS_RTI, 'warm'), 1.0)
    for name, row in (('warm', warm), ('local', local), ('search', search)):
        if row:
            yield _aim(f'failures, {name}', row['failures'], 0)
    if search:
        yield _aim('excess of the search over the best known cost', search['largest_excess'], 1e-6)


def _growth(rows: Rows) -> Iterator[dict[str, Any]]:
    """Yield how our times grow from the short to the long horizon."""
    for entry, start in ((solver.OUR_LOCAL, 'cold'), (solver.OUR_SEARCH, 'cold'),
                         (solver.OUR_SEARCH, 'warm')):
        ends = [_row([row for row in rows if row['horizon'] == n], entry, start)
                for n in (LONG, SHORT)]
        yield from _ratio(f'N = {LONG} over N = {SHORT}, {entry.name}, {start} median', CLOCKS[0],
                          ends[0], ends[1], LARGEST_GROWTH)


def _startup(rows: Rows) -> Iterator[dict[str, Any]]:
    """Yield how long our solver takes to be there."""
    ours = next((row for row in rows if row['solver'] == solver.OUR_SEARCH.name), None)
    if ours and 'first_build_s' in ours:
        yield _aim('first start [s]', ours['first_build_s'], LONGEST_FIRST_START_S)
        yield _aim('cached start beyond imports [s]', ours['cached_build_s'],
                   LONGEST_CACHED_START_S)


def losses(rows: Rows) -> list[str]:
    """Say, line by line, who is ahead of us where; nobody is left out."""
    lines = []
    for row in rows:
        if row['ours'] or row['start'] == 'none':
            continue
        here = [each for each in rows if each['horizon'] == row['horizon']]
        entry = solver.OUR_LOCAL if row['start'] == 'cold' else solver.OUR_SEARCH
        ours = _row(here, entry, row['start'])
        for clock in CLOCKS if ours else ():
            if row[clock] < ours[clock]:
                lines.append(
                    f"N = {row['horizon']}, {row['start']} {clock.removeprefix('solver_us_')}: "
                    f"{row['solver']} {row[clock]:.3g} us, {entry.name} {ours[clock]:.3g} us")
    return lines


def _row(rows: Rows, entry: solver.Entry, start: str) -> Mapping[str, Any]:
    """Return the row of a solver; empty when it was not run."""
    return next((row for row in rows
                 if row['solver'] == entry.name and row['start'] == start), {})


def _fastest(rows: Rows, names: Sequence[str], start: str, clock: str) -> Mapping[str, Any]:
    """Return the fastest of several solvers; empty when none was run."""
    found = [row for row in rows if row['solver'] in names and row['start'] == start]
    return min(found, key=lambda row: row[clock], default={})


def _ratio(name: str, clock: str, ours: Mapping[str, Any], theirs: Mapping[str, Any],
           bound: float) -> Iterator[dict[str, Any]]:
    """Yield the aim that a time is at most so much of another one, where both were run."""
    if ours and theirs:
        yield {**_aim(name, ours[clock] / theirs[clock], bound), 'against': theirs['solver']}


def _aim(name: str, value: float, bound: float) -> dict[str, Any]:
    """Return one aim."""
    return {'aim': name, 'value': float(f'{value:.4g}'), 'at_most': bound,
            'met': bool(value <= bound)}
