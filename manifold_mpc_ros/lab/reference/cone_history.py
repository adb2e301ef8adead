# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the axis of a cone pointed, and by how much it kept the cone, between states too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from manifold_mpc_ros.config.cones import Between, Cone
from manifold_mpc_ros.lie.arrays import Array


@dataclass(frozen=True, eq=False)
class ConeHistory:
    """One cone at n states: the unit axis and the direction of the cone, inertial (n, 3)."""

    cone: Cone
    axis_N: Array
    direction_N: Array

    @property
    def cosine(self) -> Array:
        """The cosine between them (n,)."""
        return np.asarray(np.sum(self.axis_N * self.direction_N, axis=1))

    @property
    def angle_rad(self) -> Array:
        """The angle between them (n,) [rad]."""
        return np.asarray(np.arccos(np.clip(self.cosine, -1.0, 1.0)))

    def least_margins_rad(self, between: Sequence[Between]) -> Array:
        """Return by what angle the cone is kept at least between states (n - 1,) [rad].

        ``between`` bounds the motion in each of n - 1 intervals: docs/theory.md (23). A direction
        that came in between is taken for both.
        """
        sign, axis, seen = self.cone.sign, self.axis_N, self.direction_N
        cosines = sign * np.array([np.sum(axis[i] * seen[j], axis=1) for i, j in (
            (slice(None, -1), slice(None, -1)), (slice(1, None), slice(None, -1)),
            (slice(1, None), slice(1, None)))])
        bend, swing = np.array(between).T
        most = cosines.max(axis=0)
        sine = np.where(most >= 0.0, np.sqrt(np.maximum(0.0, 1.0 - most ** 2)), 1.0)
        worst = np.clip(sign * (most + bend + swing * sine), -1.0, 1.0)
        return np.asarray(sign * (np.arccos(worst) - self.cone.half_angle_rad))
