# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of a manoeuvre as a row of snapshots: the body, its axes, where it turns next."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.axes3d import Axes3D  # type: ignore[import-untyped]

from manifold_mpc_ros.cli.plot_style import AXIS_COLOURS, AXIS_NAMES, INK, save_figure, styled
from manifold_mpc_ros.lie import so3

MOST_IN_A_ROW = 4
COLUMN_INCHES = 2.75
LEAST_WIDTH_INCHES = 9.0  # for the key below the panels
ROW_INCHES = 2.45
HALF_SIZES = np.array([0.55, 0.32, 0.16])  # of the drawn box along body x, y, z
AXIS_LENGTH = 0.95
ARROW_RADIUS = 1.12
# A turn between two snapshots below this is drawn without an arrow [rad].
SMALLEST_ARROW_RAD = math.radians(3.0)


def snapshot_rows(
    time_s: np.ndarray, spacing_s: float, end_s: float | None, most: int,
) -> np.ndarray:
    """Return the rows nearest to multiples of the spacing, from 0 to the first past ``end_s``.

    The spacing doubles until no more than ``most`` rows are left.
    """
    last_s = float(time_s[-1]) if end_s is None else min(end_s + spacing_s, float(time_s[-1]))
    first_s = max(0.0, float(time_s[0]))
    while last_s - first_s >= spacing_s * most:
        spacing_s *= 2.0
    wanted = np.arange(first_s, last_s + 1e-9, spacing_s)
    nearest = np.abs(time_s[None, :] - wanted[:, None]).argmin(axis=1)
    return np.unique(nearest)


def plot_orientation(title: str, times_s: np.ndarray, R_NB: np.ndarray, path: Path) -> Path:
    """Draw attitudes (n, 3, 3) at times (n,) [s] as n panels in rows of at most four.

    The arrow follows the tip of a body axis from its snapshot to the next one: it shows the
    direction of turning and how far the body gets.
    """
    rows = math.ceil(len(times_s) / MOST_IN_A_ROW)
    columns = math.ceil(len(times_s) / rows)
    width = max(COLUMN_INCHES * columns, LEAST_WIDTH_INCHES)
    height = ROW_INCHES * rows + 1.15
    with styled():
        figure = Figure(figsize=(width, height))
        figure.suptitle(title, fontsize=13, y=1.0 - 0.18 / height, va='top')
        for index, (time_s, R) in enumerate(zip(times_s, R_NB, strict=True)):
            axes = figure.add_subplot(rows, columns, index + 1, projection='3d')
            following = R_NB[index + 1] if index + 1 < len(R_NB) else R
            _draw_snapshot(axes, R, following)
            axes.set_title(f't = {time_s:g} s', y=1.03, fontsize=12)
        _draw_key(figure)
        figure.subplots_adjust(left=0.0, right=1.0, bottom=0.45 / height,
                               top=1.0 - 0.75 / height, wspace=0.0, hspace=0.1)
        return save_figure(figure, path)


def _draw_key(figure: Figure) -> None:
    """Say which colour is which body axis, and what the arrow means."""
    handles = [Line2D([], [], color=colour, linewidth=3.0, label=f'body {name}')
               for name, colour in zip(AXIS_NAMES, AXIS_COLOURS, strict=True)]
    handles.append(Line2D([], [], color=INK, linewidth=2.0, marker='>', markevery=[1],
                          label='turn until the next snapshot'))
    handles.append(Line2D([], [], color='#999999', linewidth=1.0, linestyle='--',
                          label='inertial x, y, z'))
    figure.legend(handles=handles, loc='lower center', ncols=len(handles), fontsize=11,
                  handlelength=2.0)


def _draw_snapshot(axes: Axes3D, R_NB: np.ndarray, following: np.ndarray) -> None:
    """Draw one attitude into its panel."""
    axes.set_axis_off()
    axes.set_proj_type('ortho')
    axes.view_init(elev=38.0, azim=-62.0)
    axes.set_box_aspect((1.0, 1.0, 1.0), zoom=1.7)
    for set_limits in (axes.set_xlim, axes.set_ylim, axes.set_zlim):
        set_limits(-1.15, 1.15)
    for direction in np.eye(3):
        axes.plot(*np.outer(direction, [0.0, 1.1]), color='#999999', linewidth=1.0,
                  linestyle='--')
    _draw_box(axes, R_NB)
    for axis, colour in enumerate(AXIS_COLOURS):
        axes.plot(*np.outer(R_NB[:, axis], [0.0, AXIS_LENGTH]), color=colour, linewidth=3.0,
                  solid_capstyle='round', zorder=10, clip_on=False)
    _draw_turn(axes, R_NB, following)


def _draw_box(axes: Axes3D, R_NB: np.ndarray) -> None:
    """Draw a box in body axes; the face towards body +x is darker, so half turns differ."""
    faces, colours = [], []
    for axis in range(3):
        others = [other for other in range(3) if other != axis]
        for sign in (-1.0, 1.0):
            corners = np.zeros((4, 3))
            corners[:, axis] = sign
            corners[:, others] = [[-1, -1], [1, -1], [1, 1], [-1, 1]]
            faces.append(corners * HALF_SIZES @ R_NB.T)
            colours.append('#5A6B7B' if (axis, sign) == (0, 1.0) else '#D5DBE1')
    axes.add_collection3d(Poly3DCollection(
        faces, facecolors=colours, edgecolors='#7A8894', linewidths=0.8, alpha=0.85))


def _draw_turn(axes: Axes3D, R_NB: np.ndarray, following: np.ndarray) -> None:
    """Draw the arc that a body axis sweeps until the next snapshot, ending in an arrowhead."""
    phi = so3.log(R_NB.T @ following)
    turn = float(np.linalg.norm(phi))
    if turn < SMALLEST_ARROW_RAD:
        return
    swept = int(np.argmin(np.abs(phi)))
    if abs(phi[0]) < 0.5 * turn:
        swept = 0  # body x, the long side of the box, whenever it moves enough
    parts = np.linspace(0.0, 1.0, 40)
    arc = ARROW_RADIUS * (R_NB @ so3.exp(parts[:, None] * phi))[..., swept]
    tip, tangent = arc[-1], arc[-1] - arc[-2]
    tangent = tangent / np.linalg.norm(tangent)
    outward = tip / np.linalg.norm(tip)
    size = min(0.26, 0.5 * turn * ARROW_RADIUS)
    foot = tip - size * tangent
    head = [tip, foot + 0.45 * size * outward, foot - 0.45 * size * outward]
    shaft = arc[np.linalg.norm(arc - tip, axis=1) > 0.8 * size]
    axes.plot(*shaft.T, color=INK, linewidth=2.0, zorder=11, clip_on=False)
    axes.add_collection3d(Poly3DCollection(
        [head], facecolors=INK, edgecolors=INK, zorder=12, clip_on=False))
