# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ball of rotation vectors with one octant cut out, and the sphere of directions."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.axes3d import Axes3D  # type: ignore[import-untyped]
from scipy.interpolate import RegularGridInterpolator
from scipy.spatial import KDTree

from manifold_mpc_ros.cli.plot_style import AXIS_COLOURS, INK
from manifold_mpc_ros.lab.domain.domain import NONE
from manifold_mpc_ros.lab.domain.picture import Picture, raster, smoothed
from manifold_mpc_ros.lie.arrays import Array, IntArray

# The octant towards the viewer, by the signs of x, y and z, and from where it is seen.
OCTANT = np.array([1.0, -1.0, 1.0])
ELEVATION_DEG, AZIMUTH_DEG = 26.0, -52.0
# Cells along a quarter of a great circle, and along a radius.
_CELLS = 45
# The colour between measured half turns is that of the mean of so many neighbours.
_NEIGHBOURS = 5
_LIGHT = np.array([0.35, -0.55, 0.75]) / np.linalg.norm([0.35, -0.55, 0.75])


def draw_ball(axes: Axes3D, picture: Picture) -> None:
    """Draw the ball |zeta| <= pi: half turns on its surface, the three planes in the cut."""
    _prepare(axes)
    turns = picture.half_turns
    axis = turns.states.vectors / np.pi
    nearest = KDTree(np.concatenate([axis, -axis]))
    horizons = np.tile(turns.smallest, 2)
    for signs in _octants():
        if np.array_equal(signs, OCTANT):
            continue
        cells = _octant_cells() * signs
        _add(axes, cells, _shaded(picture, _at(nearest, horizons, cells), cells), 1)
    for plane, domain in picture.planes:
        along, field = raster(plane, domain)
        value, none = (RegularGridInterpolator((along, along), each) for each in smoothed(field))
        cells = _quarter_cells()
        signs = OCTANT @ plane.axes
        where = np.pi * cells.mean(axis=1) * signs
        _add(axes, cells * signs @ plane.axes.T, picture.rgba(
            np.where(none(where) > 0.5, NONE, value(where))), 2)
        edge = picture.section(plane.axes)
        edge = edge[np.all(edge * signs >= -1e-9, axis=1)]
        axes.plot(*(edge @ plane.axes.T / np.pi).T, color=INK, linewidth=1.6, zorder=6)
        _draw_cut(axes, signs, plane.axes)
    _draw_frame(axes)


def _draw_cut(axes: Axes3D, signs: Array, plane_axes: Array) -> None:
    """Draw the edges of the cut in one plane: two radii and the arc between them."""
    turn = np.linspace(0.0, np.pi / 2, 46)
    arc = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    outline = np.concatenate([np.zeros((1, 2)), arc, np.zeros((1, 2))]) * signs
    axes.plot(*(outline @ plane_axes.T).T, color='#FFFFFF', linewidth=1.0, zorder=5)


def draw_sphere(axes: Axes3D, picture: Picture) -> None:
    """Draw the sphere of directions from which b points, coloured by the smallest N."""
    _prepare(axes)
    b, x = picture.config.pointing_axis_B, picture.grid.states.vectors
    theta = np.linalg.norm(x, axis=1)[:, None]
    unit = x / np.where(theta > 0, theta, 1.0)
    # Gamma = exp(-hat x) b with x across b.
    directions = np.cos(theta) * b - np.sin(theta) * np.cross(unit, b)
    nearest = KDTree(directions)
    for signs in _octants():
        cells = _octant_cells() * signs
        _add(axes, cells, _shaded(picture, _at(nearest, picture.grid.smallest, cells), cells), 1)
    _draw_frame(axes)


def _prepare(axes: Axes3D) -> None:
    """Choose the view."""
    axes.set_axis_off()
    axes.set_proj_type('ortho')
    axes.view_init(elev=ELEVATION_DEG, azim=AZIMUTH_DEG)
    axes.computed_zorder = False
    axes.set_box_aspect((1.0, 1.0, 1.0), zoom=1.55)
    for set_limits in (axes.set_xlim, axes.set_ylim, axes.set_zlim):
        set_limits(-1.0, 1.0)


def _octants() -> list[Array]:
    """Return the signs of all eight octants."""
    return [np.array(signs) for signs in itertools.product((-1.0, 1.0), repeat=3)]


def _octant_cells() -> Array:
    """Return the cells (n, 4, 3) that cover the positive octant of the unit sphere."""
    angle = np.linspace(0.0, np.pi / 2, _CELLS + 1)
    polar, turn = np.meshgrid(angle, angle, indexing='ij')
    points = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn),
                       np.cos(polar)], axis=-1)
    return _corners(points)


def _quarter_cells() -> Array:
    """Return the cells (n, 4, 2) that cover a quarter of the unit disc."""
    radius, turn = np.meshgrid(np.linspace(0.0, 1.0, 2 * _CELLS + 1),
                               np.linspace(0.0, np.pi / 2, 2 * _CELLS + 1), indexing='ij')
    return _corners(np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=-1))


def _corners(points: Array) -> Array:
    """Map a mesh of points (a, b, d) to the corners of its cells (n, 4, d)."""
    corners = np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], 2)
    return corners.reshape(-1, 4, points.shape[-1])


def _at(nearest: KDTree, horizons: IntArray, cells: Array) -> Array:
    """Return the smallest N at the middle of each cell, from its neighbours; NONE like most."""
    middle = cells.mean(axis=1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    distance, index = nearest.query(middle, k=_NEIGHBOURS)
    weight, inside = 1 / (distance + 1e-9), horizons[index] != NONE
    part = (weight * inside).sum(axis=1)
    mean = (weight * inside * horizons[index]).sum(axis=1) / np.maximum(part, 1e-9)
    return np.asarray(np.where(part < 0.5 * weight.sum(axis=1), NONE, mean))


def _shaded(picture: Picture, horizons: Array, cells: Array) -> Array:
    """Return the colours of cells, a little darker away from the light."""
    colours = picture.rgba(horizons)
    normal = cells.mean(axis=1)
    colours[:, :3] *= (0.86 + 0.14 * np.clip(normal @ _LIGHT, 0.0, 1.0))[:, None]
    return colours


def _add(axes: Axes3D, cells: Array, colours: Any, order: int) -> None:
    """Draw cells; those on the back of the sphere are not drawn at all."""
    azimuth, elevation = np.radians([AZIMUTH_DEG, ELEVATION_DEG])
    towards = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth),
                        np.sin(elevation)])
    seen = (cells.mean(axis=1) @ towards > -0.02) if order == 1 else np.ones(len(cells), bool)
    if seen.any():
        axes.add_collection3d(Poly3DCollection(
            cells[seen], facecolors=colours[seen], edgecolors=colours[seen], linewidths=0.7,
            zorder=order))


def _draw_frame(axes: Axes3D) -> None:
    """Draw the axes of the chart where they leave the ball."""
    for direction, colour, name in zip(np.eye(3), AXIS_COLOURS, 'xyz', strict=True):
        tip = direction * OCTANT
        axes.plot(*np.outer(tip, [1.0, 1.22]), color=colour, linewidth=2.2, zorder=8,
                  clip_on=False)
        sign = '' if float(tip.sum()) > 0 else '−'
        axes.text(*(1.32 * tip), f'{sign}{name}', color=colour, fontsize=13, ha='center',
                  va='center', zorder=9)
