# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What time costs: settling over torque effort and over the horizon, measured and drawn."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from manifold_mpc_ros.cli.plot_style import (
    AXIS_COLOURS,
    INK,
    LIMIT_COLOUR,
    save_figure,
    styled,
)
from manifold_mpc_ros.config.parameter import Value
from manifold_mpc_ros.lab.tune import choice, rule, trial
from manifold_mpc_ros.lab.tune.choice import Trial
from manifold_mpc_ros.lab.tune.rule import Timing
from manifold_mpc_ros.lab.tune.trial import Outcome

# Parts of the limits, and horizons over that of the rule.
FRACTIONS, HORIZONS = (0.3, 0.4, 0.5, 0.7, 0.85, 0.97), (0.1, 0.2, 0.4, 0.7, 1.0)


def plot_trade(values: Mapping[str, Value], best: Trial, accuracy_rad: float, path: Path) -> Path:
    """Fly the hardest slew of a trial with other torques and horizons; draw both into a PNG."""
    config, slew = best.flyer.mpc.config, best.hardest.slew
    timing, half_turn = Timing(config.step_s, config.horizon), rule.half_turn_s(config)

    def flown(fraction: float, horizon: int) -> Outcome:
        _, flyer = choice.built(values, timing._replace(horizon=horizon), best.weights._replace(
            torque_fraction=fraction), half_turn)
        return trial.fly(flyer, [slew], accuracy_rad)[0]

    efforts = [choice.fly(values, timing, best.weights._replace(torque_fraction=fraction),
                          half_turn, [slew], accuracy_rad) for fraction in FRACTIONS]
    horizons = [math.ceil(part * config.horizon) for part in HORIZONS]
    ways = {f'profile of {FRACTIONS[-1]:g}': FRACTIONS[-1], 'setpoint': 0.0}
    seen = {name: [flown(fraction, horizon) for horizon in horizons]
            for name, fraction in ways.items()}
    with styled():
        figure = Figure(figsize=(11.0, 4.6), layout='constrained')
        left, right = figure.subplots(1, 2)
        figure.suptitle(f'{slew.text}: bang-bang {best.hardest.bound_s:.4g} s')
        _draw_efforts(left, efforts)
        _draw_horizons(right, np.array(horizons) * config.step_s / half_turn, seen)
        return save_figure(figure, path)


def _draw_efforts(axes: Axes, efforts: Sequence[Trial]) -> None:
    """Draw settling over the mean torque, on the model and off it."""
    x = [100.0 * each.outcomes[0].effort for each in efforts]
    axes.plot(x, [each.outcomes[0].ratio for each in efforts], 'o-', color=AXIS_COLOURS[0],
              label='the model')
    for (name, _, _), colour, marker, k in zip(
            choice.MARGINS, (*AXIS_COLOURS[1:], LIMIT_COLOUR), 'sv^', range(3)):
        axes.plot(x, [each.margins[k].ratio for each in efforts], marker, color=colour,
                  markersize=5, label=name)
    for each, fraction, place in zip(efforts, FRACTIONS, x):
        axes.annotate(f'{fraction:g}', (place, each.outcomes[0].ratio), (4, 6),
                      textcoords='offset points', fontsize=9)
    axes.axhline(1.0, color=INK, linewidth=1.0)
    axes.set_xlabel('mean torque until settled, over the limit [%]')
    axes.set_ylabel('settling over bang-bang time')
    axes.set_title('By the fraction of the profile')
    axes.legend(fontsize=9)


def _draw_horizons(axes: Axes, view: np.ndarray, seen: Mapping[str, Sequence[Outcome]]) -> None:
    """Draw settling over the horizon, hollow where ticks had no plan into the terminal set."""
    for (name, outcomes), colour in zip(seen.items(), AXIS_COLOURS):
        axes.plot(view, [each.ratio for each in outcomes], '-', color=colour, label=name)
        for place, each in zip(view, outcomes):
            axes.plot(place, each.ratio, 'o', color=colour, markersize=7,
                      fillstyle='none' if each.infeasible else 'full')
    axes.axhline(1.0, color=INK, linewidth=1.0)
    axes.set_xlabel('horizon over the time of a half turn')
    axes.set_ylabel('settling over bang-bang time')
    axes.set_title('By the horizon (hollow: ticks infeasible)')
    axes.legend(fontsize=9)
