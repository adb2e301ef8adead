# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the axis of a cone pointed, and by how much it kept the cone, between states too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from manifold_mpc_ros.config.cones import Between, Cone, joined
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

    @property
    def ends(self) -> Array:
        """The cosines (3, n - 1) at the ends of the intervals.

        At the first, at the last, and at the last with a direction that came in between.
        """
        axis, seen = self.axis_N, self.direction_N
        return np.array([np.sum(axis[i] * seen[j], axis=1) for i, j in (
            (slice(None, -1), slice(None, -1)), (slice(1, None), slice(None, -1)),
            (slice(1, None), slice(1, None)))])

    def margins_rad(self, cosines: Array) -> Array:
        """Map cosines to the angles by which they keep the cone [rad]."""
        cone = self.cone
        return cone.sign * (np.arccos(np.clip(cosines, -1.0, 1.0)) - cone.half_angle_rad)

    def least_margins_rad(self, between: Sequence[Between]) -> Array:
        """Return by what angle the cone is kept at least in each interval (n - 1,) [rad].

        ``between`` bounds the motion in it: docs/theory.md (23).
        """
        sign, (bend, swing) = self.cone.sign, np.array(between).T
        most = (sign * self.ends).max(axis=0)
        sine = np.where(most >= 0.0, np.sqrt(np.maximum(0.0, 1.0 - most ** 2)), 1.0)
        return self.margins_rad(sign * (most + bend + swing * sine))


def least_margins_rad(histories: Sequence[ConeHistory], between: Sequence[Between]
                      ) -> dict[str, Array]:
    """Return by what angle each cone or group is kept at least in each interval (n - 1,) [rad].

    Of a group by the better of two bounds: of one member throughout by (23), and of the best one
    at the nearer end less the turn from there, docs/theory.md (24b).
    """
    least = joined([each.cone for each in histories],
                   np.array([each.least_margins_rad(between) for each in histories]))
    members = [each for each in histories if each.cone.group is not None]
    ends = joined([each.cone for each in members],
                  np.array([each.margins_rad(each.ends) for each in members]))
    turns = np.array([each.turn_rad for each in between])
    return least | {name: np.maximum(least[name], margins.min(axis=0) - turns)
                    for name, margins in ends.items()}
