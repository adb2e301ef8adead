# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ways round cones: by way of one of 200 attitudes that are the same every time, straight twice.

The 32 that violate cones least, the shortest of them, lead starts of the search to its plans.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from manifold_mpc_ros.config.cones import Cone, joined
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

# Attitudes that ways are by way of, and the ways that are tried (benchmarks/cone_problems.py).
_ATTITUDES, MOST_WAYS = 200, 32
# Where a straight part of a way is looked at, and by how much it may violate a cone [rad]: the
# solver bends it.
_PARTS = np.linspace(0.0, 1.0, 13)[:, None, None]
_BENT = 0.2
# Parts of the limits that a start uses, as the slew law does.
_RATE, _TORQUE = 0.85, 0.6


class Ways:
    """The ways of one configuration."""

    def __init__(self, config: AttitudeMpcConfig) -> None:
        """Lay down what ways are by way of, and how they end."""
        self._config = config
        self._via = so3.spiral_rotations(_ATTITUDES)
        self._end = self._met(self._via)
        self._last = _turns(self._via, self._end)

    def aims(self, cones: Sequence[Cone], directions: Array, start: Array, *, held: bool
             ) -> list[Array]:
        """Map cones, their directions (k, n, 3) and the attitude R_DB (3, 3) to ways.

        Each is what the slew law of a start aims at, stage by stage: quaternions (N + 1, 4). None
        where the straight way keeps all cones, unless a cone has ``held`` the best plan back.
        """
        def violation(begin: Array, turns: Array) -> Array:
            seen = begin @ so3.exp(_PARTS * turns)
            margins = np.array([np.min([cone.margins_rad(seen, s) for s in directions[:, i]],
                                       axis=0) for i, cone in enumerate(cones)])
            least = np.min(list(joined(cones, margins).values()), axis=0)
            return np.asarray(np.maximum(-least, 0.0))
        straight = _turns(start[None], self._met(start[None]))
        if not held and not violation(start, straight).any():
            return []
        first = _turns(start[None], self._via)
        violated = sum(np.maximum(each - _BENT, 0.0).sum(axis=0) for each in (
            violation(start, first), violation(self._via, self._last)))
        length = np.linalg.norm(first, axis=1) + np.linalg.norm(self._last, axis=1)
        chosen = np.lexsort([length, violated])[:MOST_WAYS]
        return [self._timed(np.stack([start, self._via[i], self._end[i]])) for i in chosen]

    def _met(self, attitudes: Array) -> Array:
        """Return the attitudes nearest to some (m, 3, 3) that meet the target."""
        if self._config.target == 'attitude':
            return np.broadcast_to(np.eye(3), attitudes.shape)
        axis = self._config.pointing_axis_B
        gamma = np.swapaxes(attitudes, -1, -2) @ axis
        normal = np.cross(gamma, axis)
        sine = np.linalg.norm(normal, axis=-1, keepdims=True)
        angle = np.arctan2(sine, (gamma @ axis)[..., None])
        return attitudes @ so3.exp(-angle * normal / np.maximum(sine, 1e-12))

    def _timed(self, corners: Array) -> Array:
        """Return where a start aims (N + 1, 4): along the corners, ahead of the body."""
        config = self._config
        turns = _turns(corners[:-1], corners[1:])
        angles = np.maximum(np.linalg.norm(turns, axis=1), 1e-9)
        axes = turns / angles[:, None]
        rate = _RATE * min(limit.rate_about(axis) for limit in config.rate_limits for axis in axes)
        assert config.max_torque_n_m is not None
        effort = np.abs(axes @ config.inertia_kg_m2) / config.max_torque_n_m
        brake = _TORQUE / float(effort.max(initial=1e-9))
        end = np.cumsum(angles)
        times = config.step_s * np.arange(config.horizon + 1)
        # Ahead by the way on which the slew law would still go at this rate.
        ahead = rate ** 2 / (2.0 * brake) + rate * 2.0 * config.step_s
        place = np.minimum(rate * times + ahead, end[-1])
        part = np.minimum(np.searchsorted(end, place), len(end) - 1)
        done = (place - end[part] + angles[part]) / angles[part]
        R = corners[part] @ so3.exp(done[:, None] * turns[part])
        return _continuous(so3.quaternion_from_rotation(R), corners[0])


def _continuous(q: Array, start: Array) -> Array:
    """Return quaternions (k, 4) with the signs that make them continuous from an attitude on."""
    before = so3.quaternion_from_rotation(start)
    dots = np.sum(q * np.vstack([before, q[:-1]]), axis=1)
    return q * np.cumprod(np.where(dots < 0.0, -1.0, 1.0))[:, None]


def _turns(start: Array, end: Array) -> Array:
    """Return the rotation vectors (..., 3) from one attitude to another."""
    return so3.log(np.swapaxes(start, -1, -2) @ end)
