# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of the jump over all axes: how large it is, and where on the turn."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from manifold_mpc_ros.cli.plot_style import INK, save_figure, styled

if TYPE_CHECKING:
    from manifold_mpc_ros.lab.discontinuity.findings import Findings
    from manifold_mpc_ros.lab.discontinuity.study import JumpMap

# How far below the equator mirrored axes (-n for n) continue the map, so that its rim is drawn.
_BELOW = -0.45
# A map whose jumps agree to this part is a number, not a picture.
_SAME = 1e-3


def plot_map(found: Sequence[Findings], path: Path) -> Path:
    """Draw two discs for each law: the size of the jump, and how far from 180 degrees it is."""
    maps = [(one.label, one.map) for one in found if one.map is not None]
    shown = [(label, one) for label, one in maps if not _constant(one)] or maps[:1]
    constant = [(label, one) for label, one in maps if _constant(one)]
    with styled():
        figure = Figure(figsize=(5.6 * len(shown) + 0.4, 10.2), layout='constrained')
        figure.suptitle('Jump of the first torque at rest, over all axes of the turn',
                        fontsize=14)
        grid = figure.subplots(2, len(shown), squeeze=False)
        for column, (label, one) in enumerate(shown):
            _draw(figure, grid[0][column], one, one.jump_n_m, 'jump |Δτ| [N m]', False)
            _draw(figure, grid[1][column], one, one.at_deg - 180.0,
                  'where the law jumps: θ − 180° [deg]', True)
            grid[0][column].set_title(label, pad=14.0)
        note = 'Axes with z > 0 in an equal-area projection, rings 30° and 60° from the equator.'
        for label, one in constant:
            note += f'\n{label}: {np.nanmean(one.jump_n_m):.4f} N m about every axis.'
        figure.supxlabel(note, fontsize=10.5)
        return save_figure(figure, path)


def _constant(one: JumpMap) -> bool:
    """Return whether the jump is the same about every axis."""
    return bool(np.nanmax(one.jump_n_m) - np.nanmin(one.jump_n_m)
                <= _SAME * np.nanmax(one.jump_n_m))


def _draw(figure: Figure, axes: Axes, one: JumpMap, values: np.ndarray, label: str,
          signed: bool) -> None:
    """Draw a quantity over the hemisphere; a signed one changes its sign from n to -n."""
    mirrored = -one.axes[one.axes[:, 2] < -_BELOW]
    points = project(np.concatenate([one.axes, mirrored]))
    beyond = values[one.axes[:, 2] < -_BELOW]
    values = np.concatenate([values, -beyond if signed else beyond])
    kept = np.isfinite(values)
    triangles = Triangulation(*points[kept].T)
    if signed:
        largest = max(float(np.nanmax(np.abs(values))), 1e-9)
        levels, colours = MaxNLocator(20).tick_values(-largest, largest), 'RdBu_r'
    else:
        levels = MaxNLocator(20).tick_values(float(np.nanmin(values)), float(np.nanmax(values)))
        colours = 'viridis'
    filled = axes.tricontourf(triangles, values[kept], levels=levels, cmap=colours)
    rim = Circle((0.0, 0.0), 1.0, transform=axes.transData, facecolor='none', edgecolor=INK,
                 linewidth=1.2)
    axes.add_patch(rim)
    filled.set_clip_path(rim)
    axes.plot(*project(one.axes).T, '.', color='black', markersize=1.2, alpha=0.35)
    _draw_frame(axes, INK if signed else 'white')
    bar = figure.colorbar(filled, ax=axes, orientation='horizontal', shrink=0.8, pad=0.04)
    bar.set_label(label)
    bar.locator = MaxNLocator(6)
    bar.update_ticks()


def _draw_frame(axes: Axes, ink: str) -> None:
    """Draw rings of latitude and the names of the body axes."""
    for latitude in (30.0, 60.0):
        axes.add_patch(Circle((0.0, 0.0), float(np.sqrt(1 - np.sin(np.radians(latitude)))),
                              facecolor='none', edgecolor=ink, linewidth=0.7, alpha=0.6))
    for text, place in (('x', (1.06, 0.0)), ('y', (0.0, 1.06)), ('−x', (-1.07, 0.0)),
                        ('−y', (0.0, -1.06)), ('z', (0.05, 0.05))):
        axes.text(*place, text, ha='center', va='center', fontsize=11,
                  color=ink if text == 'z' else INK)
    axes.plot(0.0, 0.0, '+', color=ink, markersize=8.0)
    axes.set_xlim(-1.12, 1.12)
    axes.set_ylim(-1.12, 1.12)
    axes.set_aspect('equal')
    axes.set_axis_off()


def project(axes: np.ndarray) -> np.ndarray:
    """Map unit vectors (n, 3) to the plane, areas kept, the equator to the unit circle."""
    lateral = np.linalg.norm(axes[:, :2], axis=1)
    radius = np.sqrt(np.maximum(1.0 - axes[:, 2], 0.0))
    return np.asarray(axes[:, :2] * (radius / np.maximum(lateral, 1e-12))[:, None])
