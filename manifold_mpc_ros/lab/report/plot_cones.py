# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of the cones of a run: margins over time, and the axes' paths on the sphere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from manifold_mpc_ros.cli.plot_style import (
    INK,
    LIMIT_COLOUR,
    legend_right,
    save_figure,
    set_colours,
    styled,
)
from manifold_mpc_ros.config.cones import joined
from manifold_mpc_ros.lab.reference.cone_history import ConeHistory
from manifold_mpc_ros.lie.arrays import Array

_GRID = np.linspace(-np.pi, np.pi, 721), np.linspace(-np.pi / 2.0, np.pi / 2.0, 361)


def margins_deg(cones: Sequence[ConeHistory]) -> dict[str, Array]:
    """Return by what angle each cone or group is kept at each state (n,) [deg]."""
    margins = np.array([np.degrees(each.cone.sign * (each.angle_rad - each.cone.half_angle_rad))
                        for each in cones])
    return joined([each.cone for each in cones], margins)


def plot_cones(title: str, time_s: Array, cones: Sequence[ConeHistory], path: Path) -> Path:
    """Draw n states' margins above a map of inertial directions (Mollweide) into a PNG.

    Filled is where an axis must not be at the end of the run; a dashed edge is that of a cone to
    stay in, a dotted one where a cone was at the start.
    """
    with styled():
        figure = Figure(figsize=(9.0, 8.5), layout='constrained')
        figure.suptitle(title, fontsize=13)
        upper, lower = figure.subfigures(2, 1, height_ratios=(1.0, 1.9))
        _draw_margins(upper.subplots(), time_s, margins_deg(cones))
        axes = lower.add_subplot(projection='mollweide')
        for cone, colour in zip(cones, set_colours(len(cones)), strict=True):
            _draw_cone(axes, cone, colour)
        axes.tick_params(labelsize=9, labelcolor=LIMIT_COLOUR)
        axes.legend(loc='upper center', bbox_to_anchor=(0.5, -0.04), ncols=min(3, len(cones)))
        return save_figure(figure, path)


def _draw_margins(axes: Axes, time_s: Array, margins: Mapping[str, Array]) -> None:
    """Draw by what angle each cone or group is kept."""
    for (name, values), colour in zip(margins.items(), set_colours(len(margins)), strict=True):
        axes.plot(time_s, values, color=colour, label=name)
    axes.axhline(0.0, color=LIMIT_COLOUR, linestyle='--', linewidth=1.2, label='limit')
    axes.set_xlim(float(time_s[0]), float(time_s[-1]))
    axes.set_ylabel('margin [deg]')
    axes.set_xlabel('time [s]')
    legend_right(axes)


def _draw_cone(axes: Axes, history: ConeHistory, colour: str) -> None:
    """Draw one cone on the map, and the path of its axis."""
    longitude, latitude = np.meshgrid(*_GRID)
    grid = np.stack([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude),
                     np.sin(latitude)], axis=-1)
    first, last = history.direction_N[0], history.direction_N[-1]
    edge = float(np.cos(history.cone.half_angle_rad))
    keep_out = history.cone.kind == 'keep_out'
    if keep_out:
        axes.contourf(longitude, latitude, grid @ last, levels=[edge, 2.0], colors=[colour],
                      alpha=0.18)
    axes.contour(longitude, latitude, grid @ last, levels=[edge], colors=[colour],
                 linewidths=1.3, linestyles='solid' if keep_out else 'dashed')
    if not np.array_equal(first, last):
        axes.contour(longitude, latitude, grid @ first, levels=[edge], colors=[colour],
                     linewidths=1.0, linestyles='dotted')
    x, y, z = history.axis_N.T
    east, north = np.arctan2(y, x), np.arcsin(np.clip(z, -1.0, 1.0))
    for part in np.split(np.arange(len(east)), np.flatnonzero(np.abs(np.diff(east)) > np.pi) + 1):
        axes.plot(east[part], north[part], color=colour, linewidth=2.0,
                  label=f'{history.cone.name}: path of its axis' if part[0] == 0 else None)
    axes.plot(east[0], north[0], 'o', color=colour, markeredgecolor=INK, markersize=7)
    axes.plot(east[-1], north[-1], 's', color=colour, markeredgecolor=INK, markersize=7)
