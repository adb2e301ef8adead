# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the control law jumps, and that it does: the topological obstruction, measured.

A law is sampled along a curve of states at rest, every state solved cold, so each answer depends
on its state alone. Between two samples that differ, the larger half is kept again and again: a
steep continuous law gives differences that halve with the interval, a jump one that stays.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.manifold import tangent_basis

# Maps the parameter of a curve [deg] to a torque (3,) [N m].
Law: TypeAlias = Callable[[float], Array]

# Neighbours that differ by less than this part of the largest torque are not looked into.
SMALLEST_CHANGE = 0.02
# A difference is no jump once it is below this part of what it was on the first interval.
SHRUNK = 0.25
# Differences are followed down to intervals of this width [deg].
FINEST_DEG = 1e-9


class Solution(Protocol):
    """What is read of one answer."""

    @property
    def torque_B_n_m(self) -> Array:
        """The torque (3,) [N m]."""

    @property
    def cost(self) -> float:
        """The value of the plan."""


class ColdController(Protocol):
    """What is needed of a control law; `AttitudeMpc` is such."""

    @property
    def config(self) -> AttitudeMpcConfig:
        """The configuration."""

    def reset(self) -> None:
        """Forget the last answer."""

    def solve(self, R_NB: Array, omega_BN_B: Array) -> Solution:
        """Answer a state."""


@dataclass(frozen=True, eq=False)
class Jump:
    """A place where the law jumps: one-sided torques at the ends of an interval ``widths[-1]``.

    ``differences[i]`` is what the torques at the ends of the interval of ``widths[i]`` differ by.
    """

    at_deg: float
    below_n_m: Array       # (3,)
    above_n_m: Array       # (3,)
    widths_deg: Array      # (k,) falling
    differences_n_m: Array  # (k,)

    @property
    def size_n_m(self) -> float:
        """``|tau(at+) - tau(at-)|``."""
        return float(self.differences_n_m[-1])


def cold_solution(mpc: ColdController, R_NB: Array) -> Solution:
    """Return the answer to an attitude at rest, without any memory of answers before."""
    mpc.reset()
    return mpc.solve(R_NB, np.zeros(3))


def turn_law(mpc: ColdController, axis: ArrayLike) -> Law:
    """Return ``theta -> tau(exp(theta n))`` at rest, n the unit vector of ``axis`` (3,)."""
    n = unit(axis)
    return lambda degrees: cold_solution(mpc, so3.exp(np.radians(degrees) * n)).torque_B_n_m


def circle_law(mpc: ColdController, radius_deg: float) -> Law:
    """Return the law on a circle around the antipode of the pointing axis, at rest."""
    return lambda degrees: cold_solution(
        mpc, attitude_of_direction(mpc.config, radius_deg, degrees)).torque_B_n_m


def attitude_of_direction(config: AttitudeMpcConfig, radius_deg: ArrayLike, phase_deg: ArrayLike
                          ) -> Array:
    """Return R_NB (..., 3, 3) without roll whose ``Gamma = R_NB^T b`` is beside -b.

    ``Gamma = -cos(radius) b + sin(radius) (cos(phase) e1 + sin(phase) e2)``: the body turns from
    the target by ``180 deg - radius`` about ``sin(phase) e1 - cos(phase) e2``, across b.
    """
    first, second = tangent_basis(config.pointing_axis_B).T
    phase = np.radians(np.asarray(phase_deg, dtype=float))[..., None]
    left = np.pi - np.radians(np.asarray(radius_deg, dtype=float))[..., None]
    return np.asarray(so3.exp(left * (np.sin(phase) * first - np.cos(phase) * second)))


def find_jumps(law: Law, grid_deg: Array, torques: Array, *, finest_deg: float = FINEST_DEG
               ) -> list[Jump]:
    """Return the jumps between neighbours of a grid (n,) with torques (n, 3), one a pair.

    Of two jumps between the same neighbours the larger one is found.
    """
    scale = float(np.linalg.norm(torques, axis=1).max())
    differences = np.linalg.norm(np.diff(torques, axis=0), axis=1)
    found = []
    for k in np.flatnonzero(differences > SMALLEST_CHANGE * scale):
        jump = sharpen(law, (float(grid_deg[k]), torques[k]),
                       (float(grid_deg[k + 1]), torques[k + 1]), finest_deg)
        if jump is not None:
            found.append(jump)
    return found


def sharpen(law: Law, low: tuple[float, Array], high: tuple[float, Array],
            finest_deg: float = FINEST_DEG) -> Jump | None:
    """Return the jump between two (angle, torque), None when the law is continuous there."""
    first = float(np.linalg.norm(high[1] - low[1]))
    widths, differences = [high[0] - low[0]], [first]
    while widths[-1] > finest_deg:
        middle = (low[0] + high[0]) / 2
        if not low[0] < middle < high[0]:
            break
        torque = law(middle)
        left = float(np.linalg.norm(torque - low[1]))
        right = float(np.linalg.norm(high[1] - torque))
        if left > right:
            high = (middle, torque)
        else:
            low = (middle, torque)
        widths.append(high[0] - low[0])
        differences.append(max(left, right))
        if differences[-1] < SHRUNK * first:
            return None
    return Jump((low[0] + high[0]) / 2, low[1], high[1], np.array(widths), np.array(differences))


def differences_at(law: Law, centre_deg: float, widths_deg: ArrayLike) -> Array:
    """Return ``|tau(centre + w/2) - tau(centre - w/2)|`` [N m] for widths w (k,) [deg]."""
    return np.array([np.linalg.norm(law(centre_deg + w / 2) - law(centre_deg - w / 2))
                     for w in np.asarray(widths_deg, dtype=float)])


def jump_of_side(mpc: ColdController, axis: Array, span_deg: float, width_deg: float
                 ) -> tuple[float, float] | None:
    """Return where [deg] the side of the turn about an axis changes, and the jump there [N m].

    The side is the sign of ``tau . n``; None when it is the same at ``180 - span`` and
    ``180 + span``.
    """
    law, n = turn_law(mpc, axis), unit(axis)
    low, high = 180.0 - span_deg, 180.0 + span_deg
    below, above = law(low), law(high)
    if (below @ n > 0) == (above @ n > 0):
        return None
    side = bool(below @ n > 0)
    while high - low > width_deg:
        middle = (low + high) / 2
        torque = law(middle)
        if (torque @ n > 0) == side:
            low, below = middle, torque
        else:
            high, above = middle, torque
    return (low + high) / 2, float(np.linalg.norm(above - below))


def hemisphere(n: int) -> Array:
    """Return n axes (n, 3) with z > 0, evenly spread (a Fibonacci spiral); -n is the same axis."""
    k = np.arange(n)
    z = 1.0 - (k + 0.5) / n
    turn = np.pi * (3.0 - np.sqrt(5.0)) * k
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)


def disk(radius_deg: float, rings: int) -> Array:
    """Return points (n, 2) [deg] of a triangular lattice inside a disk, its centre not one."""
    spacing = radius_deg / rings
    index = np.arange(-2 * rings, 2 * rings + 1)
    i, j = np.meshgrid(index, index)
    points = spacing * np.stack([i + 0.5 * j + 0.5, np.sqrt(0.75) * j + np.sqrt(0.75) / 3],
                                axis=-1).reshape(-1, 2)
    return np.asarray(points[np.linalg.norm(points, axis=1) <= radius_deg])


def phases_across(config: AttitudeMpcConfig, torques: Array) -> Array:
    """Return the angle (n,) [rad] of each torque's part across the pointing axis."""
    across = torques @ tangent_basis(config.pointing_axis_B)
    return np.arctan2(across[:, 1], across[:, 0])


def winding(angles_rad: Sequence[float] | Array) -> tuple[int, float]:
    """Return how often closed samples of an angle wind round, and their largest step [rad].

    The number is the degree of the map where the largest step is well below pi; every step is
    taken the short way.
    """
    angles = np.asarray(angles_rad, dtype=float)
    steps = np.diff(np.append(angles, angles[0]))
    steps = (steps + np.pi) % (2 * np.pi) - np.pi
    return round(float(steps.sum()) / (2 * np.pi)), float(np.abs(steps).max())


def unit(axis: ArrayLike) -> Array:
    """Return the unit vector of an axis (3,)."""
    vector = np.asarray(axis, dtype=float)
    return np.asarray(vector / np.linalg.norm(vector))
