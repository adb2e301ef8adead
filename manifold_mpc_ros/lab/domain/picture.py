# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the pictures of a domain of attraction share: what is drawn, its colours, its rasters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import BoundaryNorm, ListedColormap
from scipy.ndimage import gaussian_filter

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lab.domain.domain import NONE, Domain
from manifold_mpc_ros.lab.domain.states import Plane
from manifold_mpc_ros.lie.arrays import Array, IntArray

# A state without a plan at any horizon tried.
OUTSIDE_COLOUR = '#BBBBBB'
# Width of the mean over neighbours in the planes, in cells of the raster.
SMOOTHING_CELLS = 0.8


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


def smoothed(field: Array) -> tuple[Array, Array]:
    """Return a raster without its steps, for drawing, and which part of it is without any plan.

    Gaussian means over about one cell: of the smallest N of states that have one, and of states
    without (1) among all. Off the disc they go on.
    """
    known, none = np.isfinite(field), field == NONE
    return _mean(field, known & ~none), _mean(none, known)


def _mean(values: Array, among: Array) -> Array:
    """Return a Gaussian mean of those values that count."""
    weight = gaussian_filter(among.astype(float), SMOOTHING_CELLS)
    total = gaussian_filter(np.where(among, values, 0.0), SMOOTHING_CELLS)
    return np.asarray(total / np.maximum(weight, 1e-9))
