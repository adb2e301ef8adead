# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of the law across 180 degrees: torque, value, and what refinement does to both."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from manifold_mpc_ros.cli.plot_style import AXIS_COLOURS, AXIS_NAMES, INK, save_figure, styled

if TYPE_CHECKING:
    from manifold_mpc_ros.lab.discontinuity.findings import Findings
    from manifold_mpc_ros.lab.discontinuity.study import AxisStudy

JUMP_COLOUR, SMOOTH_COLOUR, GUIDE_COLOUR = '#CC3311', '#33608C', '#999999'
COLUMN_INCHES, HEIGHT_INCHES = 4.1, 8.6
_LINES: tuple[Any, ...] = ('-', (0, (5.0, 2.0)), (0, (1.5, 1.5)))


def plot_turn(found: Sequence[Findings], path: Path) -> Path:
    """Draw one column for each law that was followed about the axis."""
    shown = [(one.label, one.axis) for one in found if one.axis is not None]
    with styled():
        figure = Figure(figsize=(COLUMN_INCHES * len(shown) + 0.6, HEIGHT_INCHES),
                        layout='constrained')
        axis = ', '.join(f'{value:.3g}' for value in shown[0][1].axis)
        figure.suptitle(
            f'MPC law at rest, attitude exp(θ n) with n = ({axis})', fontsize=14)
        grid = figure.subplots(3, len(shown), squeeze=False)
        for column, (label, study) in enumerate(shown):
            _draw_torque(grid[0][column], study)
            _draw_value(grid[1][column], study)
            _draw_refinement(grid[2][column], study)
            grid[0][column].set_title(label)
        for row in grid[1:2]:
            for axes in row:
                axes.set_xlabel('angle θ from the target [deg]')
        grid[0][0].set_ylabel('first torque [N m]')
        grid[1][0].set_ylabel('optimal cost V [1]')
        grid[2][0].set_ylabel('change of the torque [N m]')
        figure.align_ylabels()
        return save_figure(figure, path)


def _draw_torque(axes: Axes, study: AxisStudy) -> None:
    """Draw the three components, broken at the jumps, with their one-sided limits."""
    places = np.array([jump.at_deg for jump in study.jumps])
    for place in places:
        axes.axvline(place, color=GUIDE_COLOUR, linewidth=0.9, linestyle='--', zorder=1)
    theta = np.concatenate([study.theta_deg, places, places, places])
    order = np.argsort(theta, kind='stable')
    for i, (name, colour, style) in enumerate(zip(AXIS_NAMES, AXIS_COLOURS, _LINES)):
        below = np.array([jump.below_n_m[i] for jump in study.jumps])
        above = np.array([jump.above_n_m[i] for jump in study.jumps])
        torque = np.concatenate(
            [study.torque_B_n_m[:, i], below, np.full(len(places), np.nan), above])
        axes.plot(theta[order], torque[order], color=colour, linestyle=style,
                  label=f'τ$_{name}$')
        axes.plot(places, below, 'o', color=colour, markersize=5.0, zorder=3)
        axes.plot(places, above, 'o', color=colour, markersize=5.0, zorder=3,
                  markerfacecolor='white', markeredgewidth=1.5)
    jump = study.side_jump
    if jump is not None:
        axes.text(0.98, 0.96, f'|Δτ| = {jump.size_n_m:.3f} N m\nat θ = {jump.at_deg:.3f}°',
                  transform=axes.transAxes, ha='right', va='top', fontsize=10)
    largest = float(np.abs(study.torque_B_n_m).max())
    axes.set_ylim(-1.25 * largest, 1.75 * largest)
    axes.legend(loc='upper left', ncols=3, handlelength=2.2, columnspacing=1.0, fontsize=10)


def _draw_value(axes: Axes, study: AxisStudy) -> None:
    """Draw the value, which is continuous and has a kink where the law jumps."""
    for jump in study.jumps:
        axes.axvline(jump.at_deg, color=GUIDE_COLOUR, linewidth=0.9, linestyle='--', zorder=1)
    places = [jump.at_deg for jump in study.jumps]
    theta = np.concatenate([study.theta_deg, places])
    order = np.argsort(theta, kind='stable')
    axes.plot(theta[order], np.concatenate([study.cost, study.jump_costs])[order], color=INK)
    axes.text(0.03, 0.95, 'continuous, with a kink' if study.jumps else 'continuous',
              transform=axes.transAxes, va='top', fontsize=10)
    axes.margins(y=0.25)


def _draw_refinement(axes: Axes, study: AxisStudy) -> None:
    """Draw what the torques at the ends of an interval differ by, as the interval shrinks."""
    jump = study.side_jump
    if jump is not None:
        axes.loglog(jump.widths_deg, jump.differences_n_m, 'o-', color=JUMP_COLOUR,
                    markersize=3.0, label=f'around θ = {jump.at_deg:.3f}°: a jump')
    axes.loglog(study.smooth_widths_deg, np.maximum(study.smooth_differences_n_m, 1e-16), 's-',
                color=SMOOTH_COLOUR, markersize=3.0,
                label=f'around θ = {study.smooth_at_deg:g}°: continuous')
    axes.invert_xaxis()
    axes.set_ylim(1e-17, 1e6)
    axes.set_xlabel('width of the interval in θ [deg]')
    axes.legend(loc='upper left', fontsize=9.5)
