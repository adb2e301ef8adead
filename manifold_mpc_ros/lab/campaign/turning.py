# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which way a controller turns, tick by tick: what must not chatter.

SO(3) is covered twice by the unit quaternions, so a continuous attitude path that ends at the
target ends at one of its two quaternions: the side of the turn. On the sphere there is no such
pair; there the direction in which the plan sets out is compared from tick to tick.
"""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.lab.reference.stage_cost import direction_B
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

# A plan has set out when Gamma has moved by this much [rad].
MOVED_RAD = 1e-6


def sides_of_turn(R_NB: Array, plans_R_NB: Array) -> Array:
    """Map a path (n, 3, 3) and the plan (n, N + 1, 3, 3) from each of its ticks to sides (n,).

    The path is lifted continuously to unit quaternions, from the one with w >= 0 at the start;
    each plan is lifted continuously from the path's present lift. The side is the sign of the
    plan's final scalar part: +1 or -1, the quaternion of the identity that it leads to; 0 when
    it ends by exactly 180 degrees. Steps must be below 180 degrees (the model's are below 90).
    """
    q = so3.quaternion_from_rotation(np.concatenate([R_NB[:, None], plans_R_NB[:, 1:]], axis=1))
    path = np.cumprod(np.append(1.0, _continuation(q[1:, 0], q[:-1, 0])))
    plan = np.prod(_continuation(q[:, 1:], q[:, :-1]), axis=1)
    return path * plan * np.sign(q[:, -1, 0])


def count_changes(sides: Array) -> int:
    """Return how many ticks have another side (n,) than the tick before."""
    return int(np.count_nonzero(sides[1:] != sides[:-1]))


def reversals(axis: Array, R_NB: Array, plans_R_NB: Array) -> Array:
    """Say of each tick (n,) whether the planned direction of motion on the sphere turned back.

    With Gamma = R_NB^T b on the sphere: the direction is the tangent at Gamma in which the plan
    moves it first (by at least MOVED_RAD). It has turned back when it is more than 90 degrees from
    the previous tick's, carried along the path by parallel transport, and Gamma is more than 90
    degrees from b. A body that starts by moving away does so once, as it stops and returns.

    Arguments
    ---------
    axis
        The body axis b (3,).
    R_NB, plans_R_NB
        The path (n, 3, 3) and the plan (n, N + 1, 3, 3) from each of its ticks.

    """
    gamma = direction_B(axis, R_NB)
    ahead = direction_B(axis, plans_R_NB[:, 1:])
    along = np.sum(ahead * gamma[:, None], axis=-1, keepdims=True)
    tangents = ahead - along * gamma[:, None]
    moved = np.linalg.norm(np.cross(ahead, gamma[:, None]), axis=-1) > MOVED_RAD
    first = tangents[np.arange(len(gamma)), np.argmax(moved, axis=1)]
    first = np.where(moved.any(axis=1)[:, None], first, 0.0)
    carried = _transported(first[:-1], gamma[:-1], gamma[1:])
    back = np.sum(carried * first[1:], axis=-1) < 0.0
    return np.append(False, back & (gamma[1:] @ axis < 0.0))


def roll_turned(axis: Array, R_NB: Array) -> float:
    """Return the angle turned about the body axis b (3,) along a path (n, 3, 3) [rad].

    The sum of ``b . Log(R_k^T R_{k+1})``; turns in both directions cancel.
    """
    steps = so3.log(np.swapaxes(R_NB[:-1], -1, -2) @ R_NB[1:])
    return float(np.sum(steps @ axis))


def _continuation(following: Array, q: Array) -> Array:
    """Return the sign (...) that makes the following quaternion (..., 4) continue q."""
    return np.where(np.sum(following * q, axis=-1) < 0.0, -1.0, 1.0)


def _transported(tangent: Array, start: Array, end: Array) -> Array:
    """Return tangents (n, 3) carried along the geodesics between unit vectors (n, 3)."""
    along = np.sum(tangent * end, axis=-1) / (1.0 + np.sum(start * end, axis=-1))
    return tangent - along[:, None] * (start + end)
