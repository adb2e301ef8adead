# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the verb ``campaign`` prints and writes: the table, the data, one case's course."""

from __future__ import annotations

import json
import math
import platform
import re
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from manifold_mpc_ros.cli import report
from manifold_mpc_ros.config import AttitudeMpcConfig
from manifold_mpc_ros.sim import campaign_outcome as judging
from manifold_mpc_ros.sim import turning
from manifold_mpc_ros.sim.campaign import KINDS, RANDOM, CaseName, Course, run_case
from manifold_mpc_ros.sim.campaign_outcome import ABSOLUTE, MOST_CHANGES, RELATIVE, Outcome
from manifold_mpc_ros.sim.campaign_summary import broken_cases, finite, solve_times, summarise
from manifold_mpc_ros.sim.stage_cost import stage_costs

if TYPE_CHECKING:
    from rich.console import Console

    from manifold_mpc_ros.cli.campaign import Run
    from manifold_mpc_ros.sim.campaign_workers import Work

# Of the course of one case: time, error, rate, largest torque, value, stage cost, relative
# V+ - (V - L), turn (its side, or where its direction reversed), status, whether it searched.
COURSE_HEADER = ('s', 'deg', 'rad/s', 'N m', 'V', 'L', 'excess', 'turn', 'status', 'search')
# Broken cases that the terminal lists; the JSON file has all.
LISTED = 10


def title_of(kind: str, config: AttitudeMpcConfig) -> str:
    """Return in words what a kind of case is."""
    if kind == RANDOM:
        return 'random attitude and rate'
    return 'exact antipode, at rest' if config.target == 'pointing' else 'exact 180 deg, at rest'


def by_kind(outcomes: Sequence[Outcome]) -> dict[str, list[Outcome]]:
    """Return the outcomes of each kind that there are any of."""
    groups = {kind: [o for o in outcomes if o.name.startswith(f'{kind}-')] for kind in KINDS}
    return {kind: group for kind, group in groups.items() if group}


def show(console: Console, work: Work, done: Run) -> None:
    """Print the table, the cases that broke anything, and the verdict."""
    groups = by_kind(done.outcomes)
    columns = [
        _column({**summarise(group, work.config), **solve_times(group)}, work)
        for group in groups.values()]
    header = ('', *(title_of(kind, work.config) for kind in groups))
    rows = [(name, *(column[name] for column in columns)) for name in columns[0]]
    console.print(report.grid_table(
        f'{len(done.outcomes)} of {done.planned} closed loops of '
        f'{work.settings.steps * work.config.step_s:g} s, target {work.config.target}, '
        f'in {done.elapsed_s:.0f} s with {done.workers} worker(s)', header, rows))
    broken = [outcome for outcome in done.outcomes if outcome.broken]
    for outcome in broken[:LISTED]:
        console.print(f'  {outcome.name}: {", ".join(outcome.broken)}')
    if len(broken) > LISTED:
        console.print(f'  and {len(broken) - LISTED} more, all in the data file')
    if broken:
        console.print(f'FAILED: {len(broken)} of {len(done.outcomes)} loops broke something; run '
                      'one again with --case NAME')
    elif not done.complete:
        console.print('INCOMPLETE: nothing broken in the loops that were run.')
    else:
        console.print('Every loop settled; no decrease was violated, no limit exceeded, no turn '
                      'chattered.')


def _column(figures: dict[str, Any], work: Work) -> dict[str, str]:
    """Return the rows of one kind of case: name to text."""
    config, pointing = work.config, work.config.target == 'pointing'
    settling, changed = figures['settling_s'], figures['loops_with_turn_changes']
    excess, turn = figures['largest_decrease_excess'], 'direction' if pointing else 'side'
    rows = {
        'settled': f'{figures["settled"]} of {figures["loops"]}',
        'settling time, median / p99 / longest [s]': 'none' if settling is None else
            f'{settling["median"]:.4g} / {settling["p99"]:.4g} / {settling["max"]:.4g}',
        f'loops whose {turn} of the turn changes 0 / 1 / more times':
            f'{changed.get("0", 0)} / {changed.get("1", 0)} / {figures["chattering_loops"]}',
        'decrease V+ <= V - L violated': str(figures['decrease_violations']),
        'largest relative V+ - (V - L)': 'not a number' if excess is None else f'{excess:.2g}',
        'infeasible solves / after a feasible one':
            f'{figures["infeasible_solves"]} / {figures["infeasible_after_feasible"]}',
        'not converged, of all solves':
            f'{figures["not_converged_solves"]} of {figures["solves"]}',
        'searches after the first': str(figures['searches_after_the_first']),
        'limits exceeded': str(figures['limits_exceeded']),
        'largest torque / limit': _part(figures['largest_torque_n_m'], config.max_torque_n_m),
        'largest rate / limit': _part(figures['largest_rate_rad_s'], config.max_rate_rad_s),
        'warm solve, median / p99 [us]': _times(figures, 'warm'),
        'cold search, median / p99 [us]': _times(figures, 'cold'),
    }
    if pointing:
        roll = figures['roll_turned_deg']
        rows['roll turned, median / largest [deg]'] = f'{roll["median"]:.3g} / {roll["max"]:.3g}'
    return rows


def _part(largest: list[float], limit: np.ndarray | None) -> str:
    """Return the largest value over its limit, of the axis where that is most."""
    if limit is None or not np.isfinite(limit).any():
        return f'{max(largest):.4g} / none'
    return f'{float(np.max(np.array(largest) / limit)):.6g}'


def _times(figures: dict[str, Any], which: str) -> str:
    """Return a pair of solve times."""
    median, p99 = figures[f'{which}_us_median'], figures[f'{which}_us_p99']
    return 'none' if median is None else f'{median:.0f} / {p99:.0f}'


def write(work: Work, done: Run, data: Path, picture: Path, table: Path | None) -> list[Path]:
    """Write data, picture and table; return where they are."""
    from manifold_mpc_ros.cli.plot_campaign import plot_campaign
    text = json.dumps(as_data(work, done), indent=2, allow_nan=False)
    data.write_text(_with_short_lists(text) + '\n', encoding='utf-8')
    written = [data, plot_campaign(work.config, work.settings, done.outcomes, picture)]
    if table is not None:
        records = [outcome.record() for outcome in done.outcomes]
        written.append(report.write_csv(
            table, {key: [record[key] for record in records] for key in records[0]}))
    return written


def _with_short_lists(text: str) -> str:
    """Put the innermost lists of a JSON text without braces in them on one line each."""
    return re.sub(r'\[[^][{}"]*\]', lambda match: ' '.join(match.group().split()), text)


def as_data(work: Work, done: Run) -> dict[str, Any]:
    """Return every figure as JSON values."""
    config, settings = work.config, work.settings
    described = {field.name: getattr(config, field.name) for field in fields(config)}
    return finite({
        'controller': {name: value.tolist() if isinstance(value, np.ndarray) else value
                       for name, value in described.items()},
        'settings': {
            'seed': settings.seed, 'largest_rate_rad_s': settings.largest_rate_rad_s,
            'steps': settings.steps, 'settled_deg': math.degrees(settings.settled_rad),
            'settled_rad_s': settings.settled_rad_s, 'decrease_relative': RELATIVE,
            'decrease_absolute': ABSOLUTE, 'most_turn_changes': MOST_CHANGES},
        'planned': done.planned, 'complete': done.complete,
        'sets': {kind: {'start': title_of(kind, config), **summarise(group, config)}
                 for kind, group in by_kind(done.outcomes).items()},
        'broken': broken_cases(done.outcomes),
        'this_machine': {
            'machine': platform.machine(), 'python': platform.python_version(),
            'workers': done.workers, 'elapsed_s': round(done.elapsed_s, 1),
            'solve_times': {kind: solve_times(group)
                            for kind, group in by_kind(done.outcomes).items()}},
    })


def show_case(console: Console, work: Work, name: CaseName) -> int:
    """Run one case and print its course; 0 when it broke nothing, otherwise 1."""
    with console.status('Designing the terminal set and building the solver'):
        controller = work.make_controller(work.config, work.backend)
    course = run_case(controller, work.config, work.settings, name)
    outcome = judging.judge(course, work.config, work.settings)
    console.print(report.grid_table(
        f'{name}: {title_of(name.kind, work.config)}, seed {work.settings.seed}',
        COURSE_HEADER, _course_rows(course, work.config)))
    console.print(report.result_table('Outcome', [
        (key.replace('_', ' '), _plain(value)) for key, value in outcome.record().items()]))
    return 1 if outcome.broken else 0


def _course_rows(course: Course, config: AttitudeMpcConfig) -> list[tuple[str, ...]]:
    """Return a row of text for each tick."""
    angle = np.degrees(judging.target_angle(config, course.R_NB))
    paid = stage_costs(config, course.R_NB, course.omega_BN_B, course.torque_B_n_m)
    excess = [*(f'{value:.1e}' for value in judging.decrease_excess(course, config)), '']
    sides = _turns(course, config)
    return [(
        f'{config.step_s * k:g}', f'{angle[k]:.4f}',
        f'{np.linalg.norm(course.omega_BN_B[k]):.5f}',
        f'{np.max(np.abs(course.torque_B_n_m[k])):.4f}', f'{course.value[k]:.1e}',
        f'{paid[k]:.1e}', excess[k], sides[k],
        str(course.status[k]), 'yes' if course.searched[k] else '',
    ) for k in range(len(angle))]


def _turns(course: Course, config: AttitudeMpcConfig) -> list[str]:
    """Return the side of the turn at each tick; for pointing, where its direction reversed."""
    if config.target == 'pointing':
        back = turning.reversals(config.pointing_axis_B, course.R_NB, course.plan_R_NB)
        return ['back' if reversed_here else '' for reversed_here in back]
    return [f'{side:+.0f}' for side in turning.sides_of_turn(course.R_NB, course.plan_R_NB)]


def _plain(value: object) -> str:
    """Return a figure as text."""
    if isinstance(value, tuple):
        return ', '.join(map(_plain, value)) or 'nothing'
    return f'{value:.6g}' if isinstance(value, float) else str(value)
