# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of the domain of attraction: the chart cut open, its planes, and how many are in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from manifold_mpc_ros.cli.plot_style import INK, save_figure, styled
from manifold_mpc_ros.lab.domain.domain import Domain
from manifold_mpc_ros.lab.domain.picture import OUTSIDE_COLOUR, Picture, raster, smoothed
from manifold_mpc_ros.lab.domain.plot_ball import draw_ball, draw_sphere
from manifold_mpc_ros.lab.domain.states import Plane

HALO = '#FFFFFF'


def plot_domain(picture: Picture, path: Path) -> Path:
    """Draw the domain and return where the picture is."""
    with styled():
        pointing = picture.config.target == 'pointing'
        figure = Figure(figsize=(11.5, 6.6 if pointing else 10.2))
        tops = figure.add_gridspec(1, 2, left=0.0, right=0.86, top=0.94,
                                   bottom=0.14 if pointing else 0.42,
                                   wspace=0.22 if pointing else 0.12)
        ball = figure.add_subplot(tops[0, 0], projection='3d')
        (draw_sphere if pointing else draw_ball)(ball, picture)
        if pointing:
            plane = figure.add_subplot(tops[0, 1])
            draw_plane(plane, picture, *picture.planes[0])
        else:
            shares = figure.add_axes((0.53, 0.50, 0.33, 0.40))
            draw_shares(shares, picture)
            row = figure.add_gridspec(1, 3, left=0.065, right=0.87, top=0.395, bottom=0.06,
                                      wspace=0.27)
            for index, (plane, domain) in enumerate(picture.planes):
                draw_plane(figure.add_subplot(row[0, index]), picture, plane, domain)
        figure.text(0.015, 0.025 if pointing else 0.435, _below(pointing), fontsize=10,
                    va='center')
        _draw_key(figure, picture)
        figure.text(0.015, 0.975, _title(picture), fontsize=13, va='center')
        return save_figure(figure, path)


def draw_plane(axes: Axes, picture: Picture, plane: Plane, domain: Domain) -> None:
    """Draw one plane of the chart: smallest N by colour, the terminal set by its edge."""
    along, field = raster(plane, domain)
    degrees = np.degrees(along)
    filled, outside = smoothed(field)
    levels = np.arange(picture.largest + 1) - 0.5
    regions = axes.contourf(degrees, degrees, filled.T, levels=[*levels, 1e3],
                            colors=picture.rgba(np.arange(picture.largest + 1)))
    lines = axes.contour(degrees, degrees, filled.T, levels=levels, colors=HALO, linewidths=0.5)
    none = axes.contourf(degrees, degrees, outside.T, levels=[0.5, 1.5], colors=[OUTSIDE_COLOUR],
                         zorder=3)
    rim = Circle((0.0, 0.0), 180.0, fill=False, edgecolor=INK, linewidth=1.0, zorder=4)
    axes.add_patch(rim)
    for drawn in (regions, lines, none):
        drawn.set_clip_path(rim)
    _draw_section(axes, picture, plane)
    axes.set_aspect('equal')
    axes.set_xlim(-188, 188)
    axes.set_ylim(-188, 188)
    axes.set_xticks(np.arange(-180, 181, 90))
    axes.set_yticks(np.arange(-180, 181, 90))
    axes.grid(False)
    letter = 'x' if picture.config.target == 'pointing' else r'\zeta'
    axes.set_xlabel(f'${letter}_{plane.names[0]}$ [deg]', labelpad=1)
    axes.set_ylabel(f'${letter}_{plane.names[1]}$ [deg]', labelpad=-6)


def _draw_section(axes: Axes, picture: Picture, plane: Plane) -> None:
    """Draw the edge of the terminal set into a plane."""
    edge = np.degrees(picture.section(plane.axes))
    axes.plot(*edge.T, color=INK, linewidth=1.6, zorder=5)
    axes.annotate('$X_T$', edge[22], xytext=(9, 9), textcoords='offset points', color=INK,
                  fontsize=11, zorder=6)


def draw_shares(axes: Axes, picture: Picture) -> None:
    """Draw how many attitudes need each N as bars, and the part inside D_N as a line."""
    horizons = np.arange(picture.largest + 1)
    counts = [float(np.mean(picture.grid.smallest == n)) for n in horizons]
    axes.bar(horizons, 100 * np.array(counts), width=0.86, color=picture.rgba(horizons),
             edgecolor=INK, linewidth=0.6)
    styles = ('-', '--')
    for domain, style in zip([picture.grid, *picture.moving], styles):
        inside = [100 * float(domain.inside(int(n)).mean()) for n in horizons]
        axes.plot(horizons, inside, color=INK, linestyle=style, marker='o', markersize=4,
                  linewidth=1.4, label=f'inside $D_N$, {_words(domain)}')
    axes.set_xlabel('N')
    axes.set_ylabel('% of the grid')
    axes.set_xlim(-0.6, picture.largest + 0.6)
    axes.set_ylim(0, 104)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.legend(loc='upper left', fontsize=10)


def _words(domain: Domain) -> str:
    """Return the name of a group without the grid."""
    return domain.states.name.removeprefix('grid ')


def _draw_key(figure: Figure, picture: Picture) -> None:
    """Draw the colours of N."""
    axes = figure.add_axes((0.905, 0.1, 0.022, 0.76))
    key = figure.colorbar(ScalarMappable(picture.norm, picture.colours), cax=axes,
                          ticks=np.arange(picture.largest + 1))
    key.ax.tick_params(length=0)
    key.outline.set_linewidth(0.6)
    key.ax.set_title('smallest\nN', fontsize=11, pad=8)


def _below(pointing: bool) -> str:
    """Say what the view in three dimensions shows."""
    if pointing:
        return ('the direction to point at, seen from the body; the plane shows all of them, and '
                'its rim is the antipode')
    return ('ball of rotation vectors $|\\zeta| \\leq \\pi$, one octant cut out; '
            'its surface: half turns')


def _title(picture: Picture) -> str:
    """Say what is drawn."""
    config = picture.config
    space = r'$S^2$' if config.target == 'pointing' else 'SO(3)'
    return (f'Domain of attraction $D_N$ on {space}, from rest, h = {config.step_s:g} s: '
            f'{len(picture.grid.states)} grid points and sampled planes')
