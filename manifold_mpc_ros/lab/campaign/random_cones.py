# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Random cones, and the straight way from one attitude to another, which they may cross."""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import AnyArray as Array

# Attitudes of the straight way.
_POINTS = 25


def random_cones(rng: np.random.Generator, *, most: int, most_axes: int,
                 half_angle_rad: tuple[float, float], keep_in_part: float,
                 keep_in_half_angle_rad: tuple[float, float]) -> list[Cone]:
    """Draw 1 to ``most`` cones of 1 to ``most_axes`` body axes.

    Axes and directions are uniform on the sphere, half angles between two ends; a cone is a
    keep-in one, with ends of its own, with probability ``keep_in_part``.
    """
    axes = _directions(rng, int(rng.integers(1, most_axes + 1)))
    cones = []
    for i in range(int(rng.integers(1, most + 1))):
        inside = rng.random() < keep_in_part
        cones.append(Cone(
            f'cone{i}', axes[rng.integers(len(axes))], _directions(rng, 1)[0],
            rng.uniform(*(keep_in_half_angle_rad if inside else half_angle_rad)),
            'keep_in' if inside else 'keep_out'))
    return cones


def straight_way(R_NB: Array, R_ND: Array) -> Array:
    """Return attitudes (n, 3, 3) from one to another (3, 3) about one axis, both included."""
    parts = np.linspace(0.0, 1.0, _POINTS)[:, None]
    return np.asarray(R_NB @ so3.exp(parts * so3.log(R_NB.T @ R_ND)))


def _directions(rng: np.random.Generator, n: int) -> Array:
    """Return unit vectors (n, 3)."""
    v = rng.standard_normal((n, 3))
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))
