# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of a campaign: settling time over the start, its distribution, the decrease."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from manifold_mpc_ros.cli.plot_style import LIMIT_COLOUR, save_figure, set_colours, styled
from manifold_mpc_ros.lab.campaign.keys import PLANT
from manifold_mpc_ros.lab.campaign.outcome import RELATIVE, Outcome
from manifold_mpc_ros.lab.campaign.output.text_report import Groups, by_set, titles
from manifold_mpc_ros.lab.campaign.plan import CampaignPlan

# Columns of the map of settling times [deg]; exact starts have one of their own, beyond 180.
ANGLES_DEG = np.linspace(0.0, 180.0, 46)
EXACT_DEG = (186.0, 194.0)
# The axis of the excess, on the model and with plants; what is beyond is drawn at its ends, what
# is not a number at the top.
EXCESS_RANGE, EXCESS_RANGE_OF_PLANTS = (1e-15, 1e-4), (1e-15, 1e3)


def plot_campaign(plan: CampaignPlan, outcomes: Sequence[Outcome], path: Path) -> Path:
    """Draw the three panels into a PNG."""
    groups = by_set(plan, outcomes)
    with styled():
        figure = Figure(figsize=(9.0, 10.0), layout='constrained')
        figure.suptitle(_title(outcomes), fontsize=13)
        spread, histogram, decrease = figure.subplots(3, 1, height_ratios=(4, 3, 3))
        _draw_map(figure, spread, groups, plan)
        _draw_histogram(histogram, groups, plan)
        _draw_decrease(decrease, groups, plan)
        return save_figure(figure, path)


def _title(outcomes: Sequence[Outcome]) -> str:
    """Say what came of the campaign."""
    settled = sum(outcome.settled_s is not None for outcome in outcomes)
    broken = sum(bool(outcome.broken) for outcome in outcomes)
    return (f'{len(outcomes):,} closed loops: {settled:,} settled, '
            f'{broken:,} broke a limit of the campaign')


def _draw_map(figure: Figure, axes: Axes, groups: Groups, plan: CampaignPlan) -> None:
    """Draw how many loops settle when, by initial angle; never ones in a row at the top."""
    h = plan.config.step_s
    never = (plan.steps + 3) * h
    latest = max((o.settled_s for group in groups.values() for o in group
                  if o.settled_s is not None), default=0.0)
    all_settle = all(o.settled_s is not None for group in groups.values() for o in group)
    top = latest + 2 * h if all_settle else never + h
    rows = np.arange(-h / 2, top + h, h)
    exact = [plan.sets[plan.place_of(name)].attitude.kind == 'half_turn' for name in groups]
    counts = []
    for columns, is_exact in ((ANGLES_DEG, False), (np.array(EXACT_DEG), True)):
        chosen = [o for group, here in zip(groups.values(), exact, strict=True)
                  if here == is_exact for o in group]
        settled = [never if o.settled_s is None else o.settled_s for o in chosen]
        at = [np.mean(EXACT_DEG) if is_exact else o.initial_angle_deg for o in chosen]
        counts.append((columns, np.histogram2d(at, settled, (columns, rows))[0]))
    norm = LogNorm(1.0, max(2.0, *(float(count.max()) for _, count in counts)))
    for columns, count in counts:
        mesh = axes.pcolormesh(columns, rows, np.where(count > 0, count, np.nan).T, norm=norm,
                               cmap='viridis_r')
    bar = figure.colorbar(mesh, ax=axes, pad=0.02)
    bar.set_label('loops')
    bar.ax.yaxis.set_major_formatter(lambda value, _: f'{value:g}')
    few = norm.vmax < 10.0
    bar.ax.yaxis.set_minor_formatter(lambda value, _: f'{value:g}' if few else '')
    ticks: list[float] = list(range(0, 181, 30))
    labels = [str(tick) for tick in ticks]
    if any(exact):
        ticks[-1:], labels[-1:] = [float(np.mean(EXACT_DEG))], ['180\nexact']
    axes.set_xticks(ticks, labels)
    axes.set_xlim(0.0, EXACT_DEG[1] + 4.0)
    axes.set_ylim(0.0, top)
    if not all_settle:
        axes.axhline(never - h, color=LIMIT_COLOUR, linestyle='--', linewidth=1.2)
        axes.text(2.0, never - h / 2, 'never', va='center', color=LIMIT_COLOUR)
    axes.set_xlabel(f'initial {plan.config.target} error [deg]')
    axes.set_ylabel('settled at [s]')


def _draw_histogram(axes: Axes, groups: Groups, plan: CampaignPlan) -> None:
    """Draw the share of each set that settles at each step."""
    width = plan.config.step_s / (len(groups) + 0.5)
    labels = titles(plan, groups)
    for place, (group, colour) in enumerate(
            zip(groups.values(), set_colours(len(groups)), strict=True)):
        times, counts = np.unique(
            [o.settled_s for o in group if o.settled_s is not None], return_counts=True)
        shift = (place - (len(groups) - 1) / 2) * width
        axes.bar(times + shift, 100.0 * counts / len(group), width, color=colour,
                 label=f'{labels[place]} ({len(group):,})')
    axes.set_xlabel('settled at [s]')
    axes.set_ylabel('loops [%]')
    axes.legend(loc='lower left', bbox_to_anchor=(0.0, 1.0))


def _draw_decrease(axes: Axes, groups: Groups, plan: CampaignPlan) -> None:
    """Draw the worst decrease of each loop against what counts as a violation."""
    plants = any(one.body == PLANT for one in plan.sets if one.name in groups)
    ends = EXCESS_RANGE_OF_PLANTS if plants else EXCESS_RANGE
    for group, colour in zip(groups.values(), set_colours(len(groups)), strict=True):
        excess = np.clip(np.nan_to_num([o.largest_excess for o in group], nan=np.inf), *ends)
        axes.plot([o.initial_angle_deg for o in group], excess, '.', color=colour,
                  markersize=3.0, alpha=0.5, clip_on=False, rasterized=True)
    axes.axhline(RELATIVE, color=LIMIT_COLOUR, linestyle='--', linewidth=1.2)
    axes.text(2.0, 1.6 * RELATIVE, 'counts as a violation above', va='bottom',
              color=LIMIT_COLOUR)
    axes.set_yscale('log')
    axes.set_ylim(*ends)
    axes.set_xlim(0.0, 182.0)
    axes.set_xticks(range(0, 181, 30))
    axes.set_xlabel(f'initial {plan.config.target} error [deg]')
    axes.set_ylabel('largest  V⁺ − (V − L), relative')
