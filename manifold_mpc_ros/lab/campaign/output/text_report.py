# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the verb ``campaign`` says: the table of figures by set, the broken cases, the verdict."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from manifold_mpc_ros.cli import console as report
from manifold_mpc_ros.lab.campaign.case import CaseName
from manifold_mpc_ros.lab.campaign.keys import MODEL
from manifold_mpc_ros.lab.campaign.outcome import Outcome
from manifold_mpc_ros.lab.campaign.plan import CampaignPlan
from manifold_mpc_ros.lab.campaign.sets import CaseSet
from manifold_mpc_ros.lab.campaign.summary import solve_times, summarise

if TYPE_CHECKING:
    from rich.console import Console

    from manifold_mpc_ros.lab.campaign.run import Run

Groups = dict[str, list[Outcome]]

# Broken cases that the terminal lists; the files have all.
LISTED = 10


def title_of(one: CaseSet, plan: CampaignPlan) -> str:
    """Return in words what the cases of a set are."""
    pointing = plan.config.target == 'pointing'
    low, high = (one.attitude.angle_deg or (0.0, 0.0))
    attitude = {
        'uniform': 'random attitude', 'angle': f'{low:g} to {high:g} deg',
        'half_turn': 'exact antipode' if pointing else 'exact 180 deg', 'fixed': 'one attitude',
    }[one.attitude.kind]
    rate = {'rest': 'at rest', 'ball': 'random rate', 'normal': 'random rate',
            'fixed': 'one rate'}[one.rate.kind]
    body = '' if one.body == MODEL else ', plant'
    return f'{one.name}: {attitude}, {rate}{body}'


def by_set(plan: CampaignPlan, outcomes: Sequence[Outcome]) -> Groups:
    """Return the outcomes of each set that there are any of."""
    groups: Groups = {one.name: [] for one in plan.sets}
    for outcome in outcomes:
        groups[CaseName.parse(outcome.name).set_name].append(outcome)
    return {name: group for name, group in groups.items() if group}


def titles(plan: CampaignPlan, groups: Groups) -> list[str]:
    """Return the titles of the sets that there are outcomes of."""
    return [title_of(plan.sets[plan.place_of(name)], plan) for name in groups]


def caption(plan: CampaignPlan, done: Run) -> str:
    """Say how many loops of what length ran where."""
    new = f', {done.new} of them now on {done.where} in {done.elapsed_s:.0f} s'
    return (f'{len(done.outcomes)} of {done.planned} closed loops of {plan.duration_s:g} s, '
            f'target {plan.config.target}{new}')


def verdict(done: Run) -> str:
    """Return the verdict in one sentence."""
    if done.broken:
        return f'FAILED: {len(done.broken)} of {len(done.outcomes)} loops broke something.'
    if not done.complete:
        return 'INCOMPLETE: nothing broken in the loops that were run.'
    return 'Every loop kept every limit of the campaign.'


def again(folder: Path, name: str) -> str:
    """Return the command that runs one case again."""
    return f'manifold-mpc campaign {shlex.quote(str(folder / "campaign.yaml"))} --case {name}'


def figures_by_set(plan: CampaignPlan, groups: Groups) -> list[tuple[str, ...]]:
    """Return rows of text: the name of a figure, then its value in each set."""
    columns = [_column({**summarise(group, plan.config), **solve_times(group)}, plan)
               for group in groups.values()]
    return [(name, *(column[name] for column in columns)) for name in columns[0]]


def show(console: Console, plan: CampaignPlan, done: Run, folder: Path) -> None:
    """Print the table, the cases that broke anything, and the verdict."""
    groups = by_set(plan, done.outcomes)
    console.print(report.grid_table(
        caption(plan, done), ('', *titles(plan, groups)), figures_by_set(plan, groups)))
    for outcome in done.broken[:LISTED]:
        console.print(f'  {outcome.name}: {", ".join(outcome.broken)}')
    if len(done.broken) > LISTED:
        console.print(f'  and {len(done.broken) - LISTED} more, all in the report')
    console.print(verdict(done))
    if done.broken:
        console.print(f'Run one again: {again(folder, done.broken[0].name)}', soft_wrap=True,
                      markup=False)


def _column(figures: dict[str, Any], plan: CampaignPlan) -> dict[str, str]:
    """Return the rows of one set: name to text."""
    config, pointing = plan.config, plan.config.target == 'pointing'
    final = figures['final_angle_deg']
    settling, changed = figures['settling_s'], figures['loops_with_turn_changes']
    excess, turn = figures['largest_decrease_excess'], 'direction' if pointing else 'side'
    rows = {
        'settled': f'{figures["settled"]} of {figures["loops"]}',
        'settling time, median / p99 / longest [s]': 'none' if settling is None else
            f'{settling["median"]:.4g} / {settling["p99"]:.4g} / {settling["max"]:.4g}',
        'final error, median / p99 / largest [deg]':
            f'{final["median"]:.2g} / {final["p99"]:.2g} / {final["max"]:.2g}',
        f'loops whose {turn} of the turn changes 0 / 1 / more times':
            f'{changed.get("0", 0)} / {changed.get("1", 0)} / {figures["chattering_loops"]}',
        'decrease V+ <= V - L violated': str(figures['decrease_violations']),
        'largest relative V+ - (V - L)': 'not a number' if excess is None else f'{excess:.2g}',
        'infeasible solves / after a feasible one':
            f'{figures["infeasible_solves"]} / {figures["infeasible_after_feasible"]}',
        'not converged, of all solves':
            f'{figures["not_converged_solves"]} of {figures["solves"]}',
        'loops that broke something': f'{figures["broken_loops"]} of {figures["loops"]}',
        'searches after the first': str(figures['searches_after_the_first']),
        'limits exceeded': str(figures['limits_exceeded']),
        'largest torque / limit': _part(figures['largest_torque_n_m'], config.max_torque_n_m),
        'largest rate / limit': _part(figures['largest_rate_rad_s'], config.max_rate_rad_s),
        'warm solve, median / p99 [us]': _times(figures, 'warm'),
        'cold search, median / p99 [us]': _times(figures, 'cold'),
    }
    cones = figures.get('cones')
    if any(one.cones is not None for one in plan.sets) or config.cones:
        rows['straight ways that cross a cone'] = 'no cones' if cones is None else str(
            cones['loops_whose_straight_way_crosses_one'])
        rows['cones: ticks that violate one / time not kept for sure [s] / least margin [deg]'] = (
            'no cones' if cones is None else f'{cones["ticks_that_violate_one"]} / '
            f'{cones["time_not_kept_for_sure_s"]:g} / '
            f'{cones["least_margin_between_ticks_deg"]:.2g}')
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
