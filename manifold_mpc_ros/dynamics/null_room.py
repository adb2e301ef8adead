# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which momenta of four wheels leave the rest of a plan possible: the null space along it.

With W h_w = b the momenta of four wheels are ``h_w = W^+ b + nu z``, z the unit vector that turns
nothing. A plan says b_k at every node: every wheel fits at node k for the nu of an interval I_k,
and the motors of step k, which give b_{k+1} - b_k, can change nu by what is in an interval D_k.
So the rest of the plan is possible from just the nu of (docs/theory.md, section 15)

    S_N = I_N,    S_k = I_k and (S_{k+1} - D_k).
"""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.lie.arrays import Array

# A wheel whose part of z is smaller than this is not moved by nu.
_STILL = 1e-9


def null_room(wheels: WheelArray, stored_B: Array, step_s: float) -> tuple[Array, float]:
    """Map momenta b (N + 1, 3) [N m s] that four wheels are to store to S_k (N + 1, 2) [N m s].

    And to the largest gap [N m s] that made one of the sets empty, 0 where none is: its place
    takes what is nearest to the next set, or the middle where no nu fits the node or the step.
    """
    used, line = wheels.available, wheels.null_basis[:, 0]
    base = stored_B @ wheels.inverse.T
    fits, short = _interval(base[:, used], line[used], wheels.max_momentum_n_m_s[used])
    moves, slow = _interval(np.diff(base[:, used], axis=0), line[used],
                            step_s * wheels.max_torque_n_m[used])
    gap = max(short, slow)
    (low, high), room = fits[-1], [fits[-1]]
    for (least, most), (down, up) in zip(fits[-2::-1].tolist(), moves[::-1].tolist()):
        low, high = low - up, high - down
        gap = max(gap, low - most, least - high)
        low, high = min(max(low, least), most), min(max(high, least), most)
        room.append((low, high))
    return np.array(room[::-1]), gap


def _interval(base: Array, line: Array, limit: Array) -> tuple[Array, float]:
    """Return the ends (m, 2) of the y with ``|base + y line| <= limit`` of rows (m, k).

    The middle where there is none, and by how much there is none at the most.
    """
    moved = np.abs(line) > _STILL
    middle, half = -base[:, moved] / line[moved], limit[moved] / np.abs(line[moved])
    ends = np.stack([(middle - half).max(axis=1), (middle + half).min(axis=1)], axis=1)
    gaps = ends[:, :1] - ends[:, 1:]
    return np.where(gaps > 0.0, ends.mean(axis=1, keepdims=True), ends), max(
        0.0, float(gaps.max()))
