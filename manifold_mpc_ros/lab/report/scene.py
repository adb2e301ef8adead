# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The 3D view of the report page: the body, its axes, and their paths on the unit sphere.

The page moves the traces named in `MOVED` when its slider moves. The body is drawn as the box of
uniform density that has the model's moments of inertia, in its principal axes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from manifold_mpc_ros.cli.plot_style import AXIS_COLOURS, AXIS_NAMES, INK, set_colours
from manifold_mpc_ros.lab.recording.bags.cones import cone_histories
from manifold_mpc_ros.lab.recording.bags.run import BagRun
from manifold_mpc_ros.lie.arrays import Array

#: Half of the longest edge of the box that is drawn.
LARGEST_HALF_EDGE = 0.34
#: Length of the arrow of the largest torque.
TORQUE_LENGTH = 0.9
TORQUE_COLOUR = '#B5179E'
#: Number of traces that stay where they are.
_FIXED = 5
#: Where the traces that move are in the figure.
MOVED = {'body': _FIXED, 'axes': _FIXED + 1, 'commanded': _FIXED + 4, 'torque': _FIXED + 5}
_FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
                   [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])


def scene(run: BagRun) -> go.Figure:
    """Return the view; what moves is at its place of the first state once the page has drawn."""
    figure = go.Figure([_sphere(), _inertial_axes(), *_paths(run)])
    x, y, z = corners(run).T
    i, j, k = _FACES.T
    figure.add_trace(go.Mesh3d(
        x=x, y=y, z=z, i=i, j=j, k=k, color='#C9D3DE', flatshading=True,
        hoverinfo='skip', lighting={'ambient': 0.62, 'diffuse': 0.7, 'specular': 0.1}))
    for name, colour in zip(AXIS_NAMES, AXIS_COLOURS, strict=True):
        figure.add_trace(_arrow(colour, f'body {name}', 6))
    axes = commanded_axes(run)
    figure.add_trace(go.Scatter3d(
        x=axes[:, 0], y=axes[:, 1], z=axes[:, 2], mode='markers', hoverinfo='name',
        name='commanded', marker={'symbol': 'diamond-open', 'size': 6, 'color': INK}))
    figure.add_trace(_arrow(TORQUE_COLOUR, 'torque', 7))
    figure.add_traces(_cones(run))
    hidden: dict[str, Any] = {'visible': False, 'range': [-1.12, 1.12]}
    figure.update_layout(
        height=430, margin={'l': 0, 'r': 0, 't': 0, 'b': 0}, showlegend=True,
        paper_bgcolor='rgba(0,0,0,0)',
        legend={'orientation': 'h', 'x': 0.0, 'y': 0.0, 'yanchor': 'top', 'font': {'size': 12}},
        scene={'xaxis': hidden, 'yaxis': hidden, 'zaxis': hidden, 'aspectmode': 'cube',
               'camera': {'eye': {'x': 1.02, 'y': 0.85, 'z': 0.55}}, 'dragmode': 'orbit'})
    return figure


def _cones(run: BagRun) -> list[go.Scatter3d]:
    """Return the edge of each cone at the end of the run, and the path of its axis."""
    traces = []
    circle = np.linspace(0.0, 2.0 * np.pi, 73)[:, None]
    cones = cone_histories(run)
    for history, colour in zip(cones, set_colours(len(cones)), strict=True):
        s, angle = history.direction_N[-1], history.cone.half_angle_rad
        one = np.linalg.svd(s[None])[2][1]
        across = np.cos(circle) * one + np.sin(circle) * np.cross(s, one)
        edge = np.cos(angle) * s + np.sin(angle) * across
        for points, dash, name in ((edge, 'solid', history.cone.name),
                                   (history.axis_N, 'dot', f'{history.cone.name}: axis')):
            x, y, z = 1.01 * points.T
            traces.append(go.Scatter3d(
                x=x, y=y, z=z, mode='lines', name=name, hoverinfo='name',
                line={'color': colour, 'width': 4, 'dash': dash}))
    return traces


def corners(run: BagRun) -> Array:
    """Return the corners (8, 3) of the box in body axes.

    Edges follow from ``a_i^2 ~ tr(J)/2 - J_i`` in the principal axes.
    """
    inertia = np.eye(3) if run.scenario is None \
        else run.scenario.controller_config.mpc.inertia_kg_m2
    moments, axes = np.linalg.eigh(inertia)
    half = np.sqrt(np.maximum(moments.sum() / 2.0 - moments, 1e-3 * moments.max()))
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return np.asarray((signs * half * LARGEST_HALF_EDGE / half.max()) @ axes.T)


def commanded_axes(run: BagRun) -> Array:
    """Return the axes in the commanded frame that the body is to bring its own to (k, 3)."""
    config = None if run.scenario is None else run.scenario.controller_config.mpc
    if config is not None and config.target == 'pointing':
        return np.asarray(config.pointing_axis_B)[None]
    return np.eye(3)


def drawn_torques(run: BagRun) -> Array:
    """Return the torques as arrows in body axes (m, 3), the largest of a fixed length."""
    torques = run.commands.torque_B_n_m
    largest = float(np.linalg.norm(torques, axis=1).max(initial=0.0))
    return torques * (TORQUE_LENGTH / largest if largest > 0.0 else 0.0)


def _arrow(colour: str, name: str, width: int) -> go.Scatter3d:
    """Return a line from the origin, with its tip marked."""
    return go.Scatter3d(
        x=[0.0, 0.0], y=[0.0, 0.0], z=[0.0, 0.0], mode='lines+markers', name=name,
        hoverinfo='name', line={'color': colour, 'width': width},
        marker={'color': colour, 'size': [0.01, 5]})


def _paths(run: BagRun) -> list[go.Scatter3d]:
    """Return the paths of the tips of the body axes over the sphere."""
    return [go.Scatter3d(
        x=run.states.R_NB[:, 0, axis], y=run.states.R_NB[:, 1, axis],
        z=run.states.R_NB[:, 2, axis], mode='lines', showlegend=False, hoverinfo='skip',
        line={'color': AXIS_COLOURS[axis], 'width': 3}, opacity=0.55) for axis in range(3)]


def _sphere() -> go.Scatter3d:
    """Return circles of latitude and longitude."""
    turn = np.linspace(0.0, 2.0 * np.pi, 73)
    circles = []
    for latitude in np.radians([-60, -30, 0, 30, 60]):
        circles.append(np.stack([np.cos(latitude) * np.cos(turn), np.cos(latitude) * np.sin(turn),
                                 np.full_like(turn, np.sin(latitude))]))
    for longitude in np.radians(np.arange(0, 180, 30)):
        circles.append(np.stack([np.cos(turn) * np.cos(longitude),
                                 np.cos(turn) * np.sin(longitude), np.sin(turn)]))
    gap = np.full((3, 1), np.nan)
    x, y, z = np.concatenate([part for circle in circles for part in (circle, gap)], axis=1)
    return go.Scatter3d(x=x, y=y, z=z, mode='lines', hoverinfo='skip', showlegend=False,
                        line={'color': '#C6CED7', 'width': 1})


def _inertial_axes() -> go.Scatter3d:
    """Return the names of the inertial axes at their ends."""
    x, y, z = 1.1 * np.eye(3)
    return go.Scatter3d(
        x=x, y=y, z=z, mode='text', text=['x<sub>N</sub>', 'y<sub>N</sub>', 'z<sub>N</sub>'],
        textfont={'color': '#5B6675', 'size': 13}, hoverinfo='skip', showlegend=False)
