# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of the controller's latency over DDS: percentiles by rate, beside the solve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from manifold_mpc_ros.cli.plot_style import AXIS_COLOURS, save_figure, styled
from manifold_mpc_ros.lab.benchmark.tick import LOCKSTEP, PERCENTILES, TIMER

_SHADES = (1.0, 0.6, 0.3)
_FIGURES = {
    LOCKSTEP: (('round trip over DDS', 'latency_us'),
               ('state received to torque published', 'reported_answer_time_us'),
               ('solve', 'reported_solve_time_us')),
    TIMER: (('tick begins late by', 'reported_tick_lateness_us'),
            ('tick to torque out', 'reported_tick_time_us'),
            ('solve', 'reported_solve_time_us')),
}


def plot_ticks(rows: Sequence[Mapping[str, Any]], path: Path) -> Path:
    """Draw both ways of ticking side by side into a PNG."""
    with styled():
        figure = Figure(figsize=(11.0, 5.0), layout='constrained')
        panels = figure.subplots(1, 2, sharey=True)
        for axes, (mode, figures) in zip(panels, _FIGURES.items()):
            _draw(axes, [row for row in rows if row['mode'] == mode], figures)
            axes.set_title('Computes on measurement' if mode == LOCKSTEP else
                           "By the controller's timer")
            axes.set_xlabel('rate [Hz]')
        panels[0].set_ylabel('time [us]: 50, 99 and 99.9 %, dark to light')
        return save_figure(figure, path)


def _draw(axes: Axes, rows: Sequence[Mapping[str, Any]],
          figures: Sequence[tuple[str, str]]) -> None:
    """Draw bars of percentiles, one group for each rate."""
    width = 0.8 / len(figures)
    for place, ((name, key), colour) in enumerate(zip(figures, AXIS_COLOURS)):
        for percentile, shade in reversed(list(zip(PERCENTILES, _SHADES))):
            known = [(index, row[key][f'p{percentile:g}']) for index, row in enumerate(rows)
                     if key in row]
            if known:
                axes.bar([index + (place + 0.5) * width - 0.4 for index, _ in known],
                         [value for _, value in known], width * 0.9, color=colour, alpha=shade,
                         label=name if shade == 1.0 else None)
    axes.set_yscale('log')
    axes.set_xticks(range(len(rows)), [f'{row["rate_hz"]:g}' for row in rows])
    axes.set_xlim(-0.6, len(rows) - 0.4)
    if axes.get_legend_handles_labels()[1]:
        axes.legend(loc='upper center', bbox_to_anchor=(0.5, -0.14))
