# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Uniform deterministic grids: attitudes on SO(3), directions on S^2, points in a ball.

Each is a spiral or a lattice of irrational steps, so any number of points is possible, and the
same number gives the same points. How far a point can be from the grid is not estimated but
computed (`covering_angle`).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

# Turns per point of the two circles of a quaternion: 1/sqrt(2), and 1/psi with psi^4 = psi + 4
# (super-Fibonacci spirals; M. Alexa, CVPR 2022).
_FIRST_TURN = 1 / np.sqrt(2.0)
_SECOND_TURN = 1 / 1.533751168755204288118041
_GOLDEN_RATIO = (1 + np.sqrt(5.0)) / 2
# The real root of x^4 = x + 1: its powers are the steps of an even lattice in three dimensions.
_PLASTIC = 1.2207440846057594753616853


def attitudes(n: int) -> Array:
    """Return n attitudes (n, 3, 3), uniform on SO(3) with respect to the Haar measure.

    ``q_i = (sqrt(t) e^(i a), sqrt(1 - t) e^(i b))`` on S^3 with t = (i + 1/2)/n, a and b growing
    by irrational turns: the volume of S^3 is uniform in t, a and b.
    """
    index = _index(n)
    t, turned = index / n, 2 * np.pi * index
    a, b = turned * _FIRST_TURN, turned * _SECOND_TURN
    return so3.rotation_from_quaternion(np.stack(
        [np.sqrt(t) * np.sin(a), np.sqrt(t) * np.cos(a),
         np.sqrt(1 - t) * np.sin(b), np.sqrt(1 - t) * np.cos(b)], axis=-1))


def directions(n: int) -> Array:
    """Return n unit vectors (n, 3), uniform on S^2: a spiral of equal areas (Fibonacci)."""
    index = _index(n)
    height, turn = 1 - 2 * index / n, 2 * np.pi * index / _GOLDEN_RATIO
    ring = np.sqrt(1 - height ** 2)
    return np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=-1)


def ball(n: int) -> Array:
    """Return n points (n, 3), uniform in the unit ball, in an order unrelated to the others."""
    steps = _PLASTIC ** -np.arange(1.0, 4.0)
    height, turn, volume = np.modf(0.5 + _index(n)[:, None] * steps)[0].T
    height, radius = 1 - 2 * height, np.cbrt(volume)
    ring = np.sqrt(1 - height ** 2)
    unit = np.stack([ring * np.cos(2 * np.pi * turn), ring * np.sin(2 * np.pi * turn), height], 1)
    return radius[:, None] * unit


def covering_angle(points: Array) -> float:
    """Map unit vectors (n, d) to the largest angle [rad] from any direction to the nearest one.

    The direction that is farthest from the points is the normal of a facet of their convex
    hull (the centre of an empty cap), and the facet's distance from the centre is the cosine of
    the angle: exact up to rounding, not sampled.

    Raises ConfigurationError when the points do not surround the centre.
    """
    if len(points) <= points.shape[-1]:
        raise ConfigurationError('points', len(points), f'more than {points.shape[-1]} of them')
    nearest = float(np.min(-ConvexHull(points).equations[:, -1]))
    if nearest <= 0:
        raise ConfigurationError('points', nearest, 'points all around the centre')
    return float(np.arccos(min(nearest, 1.0)))


def covering_radius(R: Array) -> float:
    """Map attitudes (n, 3, 3) to the largest angle [rad] from any attitude to the nearest one.

    Twice the covering angle of the quaternions q and -q on S^3.
    """
    q = so3.quaternion_from_rotation(R)
    return 2 * covering_angle(np.concatenate([q, -q]))


def _index(n: int) -> Array:
    """Return 1/2, 3/2, ..., n - 1/2."""
    if n < 1:
        raise ConfigurationError('n', n, 'a number of points of at least 1')
    return np.arange(n, dtype=np.float64) + 0.5
