# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which states are asked whether they are in D_N: uniform grids chosen by the target.

'attitude': uniform on SO(3), and exact half turns, which are the hardest. 'pointing': the state
is the commanded direction seen from the body, so the grid is one of directions on S^2, and the
antipode is the hardest; the roll-free attitude stands for each direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.inertia import largest_guaranteed_rate
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.domain import rotation_grid
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.manifold import tangent_basis


@dataclass(frozen=True)
class States:
    """Named states: rotation vectors of R_NB (n, 3) [rad] and body rates (n, 3) [rad/s].

    ``covering_rad`` is the largest angle from any attitude (or direction) to the nearest one of
    these; None where they do not cover the manifold.
    """

    name: str
    vectors: Array
    rates: Array
    covering_rad: float | None = None

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.vectors)


@dataclass(frozen=True)
class Plane:
    """A plane through the origin of the chart: two unit rotation vectors and their names."""

    axes: Array
    names: tuple[str, str]

    def points(self, resolution: int) -> Array:
        """Return coordinates (r, r, 2) [rad] of a square raster that covers the disc of pi."""
        along = np.linspace(-np.pi, np.pi, resolution)
        return np.stack(np.meshgrid(along, along, indexing='ij'), axis=-1)

    def covered(self, resolution: int) -> Array:
        """Return which raster points (r, r) are in the disc, or next to a point that is."""
        spacing = 2 * np.pi / (resolution - 1)
        lengths = np.linalg.norm(self.points(resolution), axis=-1)
        return np.asarray(lengths <= np.pi + spacing)


def uniform_states(config: AttitudeMpcConfig, n: int) -> States:
    """Return n states at rest, uniform on SO(3) or on S^2."""
    if config.target == 'attitude':
        R = rotation_grid.attitudes(n)
        return States('grid at rest', so3.log(R), np.zeros((n, 3)),
                      rotation_grid.covering_radius(R))
    directions = rotation_grid.directions(n)
    vectors = _pointing_vectors(config.pointing_axis_B, directions)
    return States('grid at rest', vectors, np.zeros((n, 3)),
                  rotation_grid.covering_angle(directions))


def half_turns(config: AttitudeMpcConfig, n: int) -> States:
    """Return exact half turns at rest: about x, y, z and n more axes; for S^2 the antipode."""
    if config.target == 'attitude':
        axes = np.concatenate([np.eye(3), _upper(rotation_grid.directions(2 * n))])
        return States('half turns at rest', np.pi * axes, np.zeros_like(axes))
    axes = tangent_basis(config.pointing_axis_B)[:, :1].T
    return States('antipode at rest', np.pi * axes, np.zeros_like(axes))


def moving_states(config: AttitudeMpcConfig, n: int, largest_rate: float) -> States:
    """Return the uniform grid with rates uniform in the ball ``|omega| <= largest_rate``.

    Raises ConfigurationError for rates at which the implicit step need not exist.
    """
    bound = largest_guaranteed_rate(config.inertia_kg_m2, config.step_s)
    if not 0 < largest_rate < bound:
        raise ConfigurationError(
            'largest rate', largest_rate,
            f'rad/s above 0 and below {bound:.4g}, where the implicit step exists for certain')
    rest = uniform_states(config, n)
    return States(f'grid at rates up to {largest_rate:g} rad/s', rest.vectors,
                  largest_rate * rotation_grid.ball(n))


def planes(config: AttitudeMpcConfig) -> tuple[Plane, ...]:
    """Return the planes that a picture of the domain shows."""
    if config.target == 'pointing':
        return (Plane(tangent_basis(config.pointing_axis_B), ('1', '2')),)
    eye, names = np.eye(3), 'xyz'
    return tuple(Plane(eye[:, [i, j]], (names[i], names[j])) for i, j in ((0, 1), (0, 2), (1, 2)))


def plane_states(plane: Plane, resolution: int) -> States:
    """Return the states at rest on the raster of a plane, row by row."""
    points = plane.points(resolution)[plane.covered(resolution)]
    return States(f'plane of {" and ".join(plane.names)}', points @ plane.axes.T,
                  np.zeros((len(points), 3)))


def _pointing_vectors(axis_B: Array, directions: Array) -> Array:
    """Map directions Gamma (n, 3), body axes, to roll-free x (n, 3): Gamma = exp(-hat x) b.

    ``x = theta (Gamma x b) / |Gamma x b|``, theta the angle between Gamma and b.
    """
    cross = np.cross(directions, axis_B)
    sine = np.linalg.norm(cross, axis=1)
    theta = np.arctan2(sine, directions @ axis_B)
    antipode = tangent_basis(axis_B)[:, 0]
    safe = np.where(sine > 0, sine, 1.0)[:, None]
    return theta[:, None] * np.where(sine[:, None] > 0, cross / safe, antipode)


def _upper(unit: Array) -> Array:
    """Return the axes with positive z: u and -u are one half turn."""
    return unit[unit[:, 2] > 0]
