# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of the pointing law around the antipode: its torques there, and how they wind."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import MultipleLocator

from manifold_mpc_ros.cli.plot_style import INK, save_figure, styled

if TYPE_CHECKING:
    from manifold_mpc_ros.lab.discontinuity.findings import Findings
    from manifold_mpc_ros.lab.discontinuity.study import AntipodeStudy
    from manifold_mpc_ros.lab.discontinuity.study import Circle as StudiedCircle

COLUMN_INCHES, HEIGHT_INCHES = 4.4, 8.8
# Colours of directions, cyclic and dark enough to be seen on white.
_DIRECTIONS = LinearSegmentedColormap.from_list(
    'directions', ['#0072B2', '#7B3294', '#C51B4A', '#D55E00', '#B8860B', '#009E73', '#0072B2'])


def plot_antipode(found: Sequence[Findings], path: Path) -> Path:
    """Draw one column for each law: torques beside the antipode, their angle around circles."""
    shown = [(one.label, one.antipode) for one in found if one.antipode is not None]
    with styled():
        figure = Figure(figsize=(COLUMN_INCHES * len(shown) + 0.6, HEIGHT_INCHES),
                        layout='constrained')
        figure.suptitle('Pointing law on S² at rest, around the antipode of the target',
                        fontsize=14)
        grid = figure.subplots(2, len(shown), squeeze=False)
        for column, (label, study) in enumerate(shown):
            _draw_field(grid[0][column], study)
            _draw_winding(grid[1][column], study)
            grid[0][column].set_title(label)
        grid[0][0].set_ylabel('off the antipode along e₂ [deg]')
        grid[1][0].set_ylabel('angle of the torque across b [deg]')
        return save_figure(figure, path)


def _draw_field(axes: Axes, study: AntipodeStudy) -> None:
    """Draw the first torque's part across b, as arrows whose colour is their direction."""
    x, y = study.field_deg.T
    size = np.linalg.norm(study.field_n_m, axis=1)
    largest = float(size.max())
    reach = max(circle.radius_deg for circle in study.circles)
    spacing = float(np.sqrt(np.pi * reach ** 2 / len(x)))
    angle = np.arctan2(study.field_n_m[:, 1], study.field_n_m[:, 0])
    u, v = study.field_n_m.T * (0.85 * spacing / largest)
    axes.quiver(x, y, u, v, angle, cmap=_DIRECTIONS, clim=(-np.pi, np.pi), pivot='mid',
                angles='xy', scale_units='xy', scale=1.0, width=0.0075, headwidth=4.0,
                headlength=4.5, headaxislength=4.0)
    for circle in study.circles:
        if circle.radius_deg >= reach / 4:
            axes.add_patch(Circle((0.0, 0.0), circle.radius_deg, facecolor='none',
                                  edgecolor='#BBBBBB', linewidth=0.8, zorder=0))
    axes.plot(0.0, 0.0, 'x', color=INK, markersize=8.0, markeredgewidth=2.0)
    axes.text(0.02, 0.02, f'longest arrow {largest:.2f} N m', transform=axes.transAxes,
              fontsize=9.5)
    axes.set_xlabel('off the antipode along e₁ [deg]')
    axes.set_aspect('equal')
    axes.set_xlim(-1.08 * reach, 1.08 * reach)
    axes.set_ylim(-1.18 * reach, 1.08 * reach)
    axes.grid(False)


def _draw_winding(axes: Axes, study: AntipodeStudy) -> None:
    """Draw the torque's angle once around each circle, unwrapped the short way."""
    colours = colormaps['viridis'](np.linspace(0.0, 0.85, len(study.circles)))
    lowest, highest = np.inf, -np.inf
    for circle, colour in zip(study.circles, colours):
        angle = np.degrees(np.unwrap(np.append(circle.angle_rad, circle.angle_rad[0])))
        phase = np.append(circle.phase_deg, circle.phase_deg[0] + 360.0)
        angle = angle - 360.0 * np.floor((angle[0] + 180.0) / 360.0)
        lowest, highest = min(lowest, angle.min()), max(highest, angle.max())
        axes.plot(phase, angle, color=colour, linewidth=1.6,
                  label=f'{circle.radius_deg:g}°: {_says(circle)}')
    axes.set_xlim(0.0, 365.0)
    axes.set_ylim(lowest - 30.0, highest + 15.0)
    axes.set_xticks(np.arange(0.0, 361.0, 90.0))
    axes.yaxis.set_major_locator(MultipleLocator(90.0))
    axes.set_xlabel('phase around the antipode [deg]')
    axes.legend(title='radius of the circle', loc='upper left', fontsize=9.5, title_fontsize=9.5)


def _says(circle: StudiedCircle) -> str:
    """Return what a circle shows."""
    return f'{len(circle.jumps)} jumps' if circle.jumps else f'degree {circle.winding:+d}'
