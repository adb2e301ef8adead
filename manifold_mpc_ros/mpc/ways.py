# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ways round cones: shortest paths over a fixed grid of attitudes, from which starts follow.

The grid, its edges and their order are the same every time. Attitudes that violate a cone cost
more by a factor, so that a way out of a cone is found too. A second way goes where a wall stops
the first: the attitudes that pass a cone on the same side.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from manifold_mpc_ros.config.cones import Cone, joined
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

# Attitudes of the grid, about 12 degrees apart, and the nearest others that each is joined to.
_ATTITUDES, _NEIGHBOURS = 4000, 14
# How much longer an edge counts that ends where a cone is violated, or a wall stands.
_VIOLATED = 30.0
# A cone stands in a way that comes this near to it [rad]; a wall takes this sector round the cone
# [rad], out to this distance from it [rad].
_NEAR, _SECTOR, _REACH = 0.35, 0.6, 1.2
# Cones that get a wall at most, and by how much a way may be longer than the shortest.
_WALLED, _LONGEST = 3, 2.5
MOST_WAYS = 2 ** _WALLED
# Parts of the limits that a start uses, as the slew law does.
_RATE, _TORQUE = 0.85, 0.6
# A pointing target is met by attitudes this near to it [rad].
_MEETS = 0.3


class _Grid(NamedTuple):
    """Attitudes (n, 3, 3), the pairs (m, 2) that are joined, and the turns (m, 3) between."""

    attitudes: Array
    pairs: np.ndarray
    turns: Array
    tree: cKDTree


@cache
def _grid() -> _Grid:
    """Return the grid, made when it is first asked for."""
    R = so3.spiral_rotations(_ATTITUDES)
    q = so3.quaternion_from_rotation(R)
    tree = cKDTree(np.vstack([q, -q]))
    nearest = tree.query(q, _NEIGHBOURS + 1)[1][:, 1:] % _ATTITUDES
    pairs = np.stack([np.repeat(np.arange(_ATTITUDES), _NEIGHBOURS), nearest.ravel()], axis=1)
    return _Grid(R, pairs, _turns(R[pairs[:, 0]], R[pairs[:, 1]]), tree)


def _turns(start: Array, end: Array) -> Array:
    """Return the rotation vectors (..., 3) from one attitude to another."""
    return so3.log(np.swapaxes(start, -1, -2) @ end)


class Ways:
    """The ways of one configuration."""

    def __init__(self, config: AttitudeMpcConfig) -> None:
        """Keep what measures a way: turns count as at constant kinetic energy."""
        self._config = config
        _grid()
        root = np.linalg.cholesky(config.inertia_kg_m2)
        self._measure = root / np.sqrt(np.trace(config.inertia_kg_m2) / 3.0)

    def aims(self, cones: Sequence[Cone], directions: Array, start: Array) -> list[Array]:
        """Map cones, their directions (k, n, 3) and the attitude R_DB (3, 3) to ways.

        Each is what the slew law of a start aims at, stage by stage: quaternions (N + 1, 4).
        """
        margins = self._margins(cones, directions, _grid().attitudes)
        barred = self._least(cones, margins) < 0.0
        first = self._shortest(barred, start)
        ways = [first]
        near = [i for i, cone in enumerate(cones) if cone.group is None
                and self._margins([cone], directions[:, i:i + 1], first).min() < _NEAR]
        for count in range(1, len(near[:_WALLED]) + 1):
            for chosen in itertools.combinations(near[:_WALLED], count):
                walls = [self._wall(cones[i], directions[0, i], first, margins[i])
                         for i in chosen]
                ways.append(self._shortest(
                    barred | np.any(walls, axis=0), start))
        lengths = [self._length(way) for way in ways]
        return [self._timed(self._straightened(cones, directions, way))
                for way, length in zip(ways, lengths) if length <= _LONGEST * lengths[0]]

    @staticmethod
    def _margins(cones: Sequence[Cone], directions: Array, attitudes: Array) -> Array:
        """Return the least margin (n, m) of each cone over its directions."""
        return np.array([np.min([cone.margins_rad(attitudes, s) for s in directions[:, i]], axis=0)
                         for i, cone in enumerate(cones)])

    @staticmethod
    def _least(cones: Sequence[Cone], margins: Array) -> Array:
        """Return the least margin (m) of those that have to be kept."""
        return np.asarray(np.min(list(joined(cones, margins).values()), axis=0))

    def _length(self, way: Array) -> float:
        """Return how long a way (k, 3, 3) is."""
        return float(np.linalg.norm(_turns(way[:-1], way[1:]) @ self._measure, axis=1).sum())

    def _wall(self, cone: Cone, direction: Array, way: Array, margins: Array) -> Array:
        """Return which attitudes of the grid pass a cone on the side on which a way does (n,)."""
        def azimuth(attitudes: Array) -> Array:
            axis = attitudes @ cone.axis_B
            across = axis - (axis @ direction)[..., None] * direction
            return np.arctan2(across @ other, across @ one)
        one = np.linalg.svd(direction[None])[2][1]
        other = np.cross(direction, one)
        passed = way[int(np.argmin(cone.margins_rad(way, direction)))]
        beside = azimuth(_grid().attitudes) - azimuth(passed[None])
        return (np.cos(beside) > np.cos(_SECTOR)) & (margins < _REACH)

    def _shortest(self, barred: np.ndarray, start: Array) -> Array:
        """Return the shortest way (k, 3, 3) from an attitude to the target."""
        grid, n = _grid(), _ATTITUDES
        lengths = np.linalg.norm(grid.turns @ self._measure, axis=1)
        lengths *= np.where(barred[grid.pairs[:, 1]], _VIOLATED, 1.0)
        ends = self._ends()
        reached = np.linalg.norm(
            _turns(grid.attitudes[ends], self._met(grid.attitudes[ends])) @ self._measure, axis=1)
        q = so3.quaternion_from_rotation(start)
        begins = np.unique(grid.tree.query(q, _NEIGHBOURS)[1] % n)
        left = np.linalg.norm(_turns(start[None], grid.attitudes[begins]) @ self._measure, axis=1)
        left *= np.where(barred[begins], _VIOLATED, 1.0)
        rows = np.concatenate([grid.pairs[:, 0], ends, np.full(len(begins), n)])
        columns = np.concatenate([grid.pairs[:, 1], np.full(len(ends), n + 1), begins])
        graph = csr_matrix((np.concatenate([lengths, reached + 1e-9, left]), (rows, columns)),
                           shape=(n + 2, n + 2))
        before = dijkstra(graph, indices=n, return_predecessors=True)[1]
        chain = [int(before[n + 1])]
        while before[chain[-1]] != n:
            chain.append(int(before[chain[-1]]))
        way = grid.attitudes[chain[::-1]]
        return np.concatenate([start[None], way, self._met(way[-1:])])

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

    def _ends(self) -> np.ndarray:
        """Return the attitudes of the grid from which a way ends at the target."""
        R = _grid().attitudes
        if self._config.target == 'attitude':
            return np.argsort(so3.angle(R), kind='stable')[:_NEIGHBOURS]
        axis = self._config.pointing_axis_B
        return np.flatnonzero((R @ axis) @ axis > np.cos(_MEETS))

    def _straightened(self, cones: Sequence[Cone], directions: Array, way: Array) -> Array:
        """Return the corners (k, 3, 3) of a way: each the farthest that is seen from the last."""
        corners, at, last = [way[0]], 0, len(way) - 1
        parts = np.linspace(0.0, 1.0, 9)[1:, None, None]
        while at < last:
            steps = way[at] @ so3.exp(parts * _turns(way[at], way[at + 1:]))
            margins = self._margins(cones, directions, steps)
            clear = (self._least(cones, margins) >= -0.02).all(axis=0)
            seen = np.flatnonzero(clear)
            at += 1 + (int(seen[-1]) if len(seen) else 0)
            corners.append(way[at])
        return np.array(corners)

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
