# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the final error and the settling time of plants depend on: a column for each spread."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from manifold_mpc_ros.cli.plot_style import LIMIT_COLOUR, save_figure, set_colours, styled
from manifold_mpc_ros.lab.campaign.keys import PLANT
from manifold_mpc_ros.lab.campaign.outcome import Outcome
from manifold_mpc_ros.lab.campaign.output.text_report import Groups, by_set, titles
from manifold_mpc_ros.lab.campaign.plan import CampaignPlan

FLOOR_DEG = 1e-6


def plot_spread(plan: CampaignPlan, outcomes: Sequence[Outcome], path: Path) -> Path | None:
    """Draw final error and settling time over what the plants drew; None without a spread."""
    plants = {one.name for one in plan.sets if one.body == PLANT}
    groups = {name: group for name, group in by_set(plan, outcomes).items() if name in plants}
    spreads = [(label, of) for label, of in _spreads(plan)
               if np.ptp([of(o) for group in groups.values() for o in group] or [0.0]) > 0.0]
    if not spreads:
        return None
    never = any(o.settled_s is None for group in groups.values() for o in group)
    with styled():
        figure = Figure(figsize=(1.0 + 3.6 * len(spreads), 7.2), layout='constrained')
        panels = figure.subplots(2, len(spreads), squeeze=False, sharey='row', sharex='col')
        for column, (label, of) in enumerate(spreads):
            error, settling = panels[:, column]
            _draw(error, groups, of, lambda o: max(o.final_angle_deg, FLOOR_DEG))
            error.set_yscale('log')
            _draw(settling, groups, of, lambda o: _settled(plan, o))
            if never:
                settling.axhline(plan.duration_s + plan.config.step_s, color=LIMIT_COLOUR,
                                 linestyle='--', linewidth=1.2)
            settling.locator_params('x', nbins=4)
            settling.set_xlabel(label)
        panels[0, 0].set_ylabel(f'final {plan.config.target} error [deg]')
        panels[1, 0].set_ylabel(
            'settled at [s], never above the line' if never else 'settled at [s]')
        figure.legend(
            panels[0, 0].lines, titles(plan, groups), loc='outside upper left', markerscale=3.0)
        return save_figure(figure, path)


def _spreads(plan: CampaignPlan) -> list[tuple[str, Callable[[Outcome], float]]]:
    """Return what may have been drawn: how to call it, and its size for an outcome."""
    return [
        ('inertia apart from the model [%]', lambda o: _inertia_apart(plan, o)),
        ('disturbance [N m]', lambda o: float(np.linalg.norm(o.disturbance_n_m))),
        ('attitude noise [rad]', lambda o: o.attitude_noise_std_rad),
        ('rate noise [rad/s]', lambda o: o.rate_noise_std_rad_s),
    ]


def _inertia_apart(plan: CampaignPlan, outcome: Outcome) -> float:
    """Return |J_body - J_model| over |J_model| in the spectral norm [%]."""
    xx, yy, zz, xy, xz, yz = outcome.inertia_kg_m2
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    model = plan.config.inertia_kg_m2
    return float(100.0 * np.linalg.norm(J - model, 2) / np.linalg.norm(model, 2))


def _settled(plan: CampaignPlan, outcome: Outcome) -> float:
    """Return the settling time [s]; beyond the loop when it never did."""
    if outcome.settled_s is None:
        return plan.duration_s + 3.0 * plan.config.step_s
    return outcome.settled_s


def _draw(axes: Axes, groups: Groups, across: Callable[[Outcome], float],
          up: Callable[[Outcome], float]) -> None:
    """Draw a point for each loop."""
    for group, colour in zip(groups.values(), set_colours(len(groups)), strict=True):
        axes.plot([across(o) for o in group], [up(o) for o in group], '.', color=colour,
                  markersize=3.0, alpha=0.5, rasterized=True)
