# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of the domain of attraction: the chart cut open, its planes, and how many are in."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator
from scipy.ndimage import gaussian_filter

from manifold_mpc_ros.cli.plot_style import INK, save_figure, styled
from manifold_mpc_ros.config import AttitudeMpcConfig
from manifold_mpc_ros.mpc.domain import NONE, Domain, IntArray
from manifold_mpc_ros.mpc.domain_states import Plane
from manifold_mpc_ros.mpc.scaling import Array

# A state without a plan at any horizon tried.
OUTSIDE_COLOUR = '#BBBBBB'
# Width of the mean over neighbours in the planes, in cells of the raster.
SMOOTHING_CELLS = 0.8
HALO = '#FFFFFF'


@dataclass(frozen=True)
class Picture:
    """What is drawn: P and c of the terminal set, the groups at rest and moving, the planes."""

    config: AttitudeMpcConfig
    P: Array
    c: float
    grid: Domain
    half_turns: Domain
    moving: list[Domain]
    planes: list[tuple[Plane, Domain]]

    @cached_property
    def largest(self) -> int:
        """The largest smallest N that is drawn."""
        drawn = [self.grid, self.half_turns, *(domain for _, domain in self.planes)]
        return max(1, *(int(domain.smallest.max()) for domain in drawn))

    @cached_property
    def colours(self) -> ListedColormap:
        """One colour for each N from 0, dark is long; NONE is grey."""
        shades = colormaps['viridis_r'](np.linspace(0.0, 1.0, self.largest + 1))
        return ListedColormap(shades, under=OUTSIDE_COLOUR)

    @cached_property
    def norm(self) -> BoundaryNorm:
        """The map from N to a colour."""
        return BoundaryNorm(np.arange(self.largest + 2) - 0.5, self.largest + 1)

    def rgba(self, horizons: Array | IntArray) -> Array:
        """Return the colours (n, 4) of smallest N (n,)."""
        return np.asarray(self.colours(self.norm(np.rint(horizons))))

    def section(self, axes: Array) -> Array:
        """Return the edge (n, 2) [rad] of X_T at rest in the plane of two unit vectors (3, 2).

        With xi = (zeta, 0) the terminal set is the ellipsoid ``zeta^T P_gg zeta <= c``; for
        pointing zeta = E^T x is the plane itself.
        """
        block = self.P[:2, :2] if len(self.P) == 5 else axes.T @ self.P[:3, :3] @ axes
        turn = np.linspace(0.0, 2 * np.pi, 181)
        circle = np.stack([np.cos(turn), np.sin(turn)])
        shape = np.linalg.inv(np.linalg.cholesky(block)).T
        return np.asarray((np.sqrt(self.c) * shape @ circle).T)


def raster(plane: Plane, domain: Domain) -> tuple[Array, Array]:
    """Return the raster's coordinates (r,) [rad] and smallest N (r, r), NaN off the disc.

    The number of points across follows from how many states the plane has.
    """
    resolution = 5
    while np.count_nonzero(plane.covered(resolution)) < len(domain.states):
        resolution += 1
    field = np.full((resolution, resolution), np.nan)
    field[plane.covered(resolution)] = domain.smallest
    return np.linspace(-np.pi, np.pi, resolution), field


def plot_domain(picture: Picture, path: Path) -> Path:
    """Draw the domain and return where the picture is."""
    from manifold_mpc_ros.cli.plot_domain_ball import draw_ball, draw_sphere
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
    filled = _smoothed(field)
    levels = np.arange(-1, picture.largest + 1) - 0.5
    colours = [OUTSIDE_COLOUR, *picture.rgba(np.arange(picture.largest + 1))]
    regions = axes.contourf(degrees, degrees, filled.T, levels=[-1.5, *levels[1:], 1e3],
                            colors=colours)
    lines = axes.contour(degrees, degrees, filled.T, levels=levels[1:], colors=HALO,
                         linewidths=0.5)
    rim = Circle((0.0, 0.0), 180.0, fill=False, edgecolor=INK, linewidth=1.0, zorder=4)
    axes.add_patch(rim)
    for drawn in (regions, lines):
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


def _smoothed(field: Array) -> Array:
    """Return a raster without its steps, for drawing: a Gaussian mean over about one cell.

    Off the disc the mean goes on; a raster with states without any plan stays as it is.
    """
    known = np.isfinite(field)
    if np.any(field == NONE):
        return np.where(known, field, NONE)
    weight = gaussian_filter(known.astype(float), SMOOTHING_CELLS)
    total = gaussian_filter(np.where(known, field, 0.0), SMOOTHING_CELLS)
    return np.asarray(total / np.maximum(weight, 1e-9))


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
