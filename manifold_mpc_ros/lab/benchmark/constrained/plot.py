# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of the public slews: settling times beside others', and angles to cones."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from manifold_mpc_ros.cli.plot_style import (
    AXIS_COLOURS,
    INK,
    LIMIT_COLOUR,
    save_figure,
    set_colours,
    styled,
)


def plot_slews(data: Mapping[str, Any], path: Path) -> Path:
    """Draw a panel of times, and one of angles for each slew with cones, into a PNG."""
    coned = [row for row in data['rows'] if len(row['angles']) > 1]
    with styled():
        figure = Figure(figsize=(13.0, 7.5), layout='constrained')
        columns = (len(coned) + 1) // 2
        grid = figure.add_gridspec(2, 2 + columns)
        _draw_times(figure.add_subplot(grid[:, :2]),
                    [row for row in data['rows'] if row['bound_s'] is not None])
        for i, row in enumerate(coned):
            _draw_angles(figure.add_subplot(grid[i // columns, 2 + i % columns]), row)
        return save_figure(figure, path)


def _draw_times(axes: Axes, rows: list[Mapping[str, Any]]) -> None:
    """Draw settling times, bounds and published times, a line a problem."""
    for place, row in enumerate(rows):
        settled = [run['settled_s'] for run in row['runs'] if run['settled_s'] is not None]
        first = place == 0
        axes.plot([row['bound_s']], [place], '|', color=INK, markersize=22, markeredgewidth=2,
                  label='time-optimal bound' if first else None)
        axes.plot(settled, [place] * len(settled), 'o', color=AXIS_COLOURS[0], markersize=5,
                  label='ours, every frame' if first else None)
        axes.plot(row['others_s'], [place] * len(row['others_s']), 's', color=AXIS_COLOURS[1],
                  label='published' if first else None)
    axes.set_yticks(range(len(rows)), [row['problem'] for row in rows])
    axes.invert_yaxis()
    axes.set_xscale('log')
    axes.set_xlabel('settled after [s]')
    axes.legend(loc='upper center', bbox_to_anchor=(0.5, -0.08), ncols=3, fontsize=9)


def _draw_angles(axes: Axes, row: Mapping[str, Any]) -> None:
    """Draw by how much each cone or group is kept over time, in the first frame."""
    names = [name for name in row['angles'] if name != 'time_s']
    for name, colour in zip(names, set_colours(len(names))):
        axes.plot(row['angles']['time_s'], row['angles'][name], color=colour, label=name)
    axes.axhline(0.0, color=LIMIT_COLOUR, linestyle='--', linewidth=1.2)
    axes.set_title(row['problem'])
    axes.set_xlabel('time [s]')
    axes.set_ylabel('outside the cone by [deg]')
    axes.legend(fontsize=8)
