# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Commanded attitudes over time: a body axis points, another is turned as near as it goes."""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.config.guidance import ORBITING, GuidanceConfig
from manifold_mpc_ros.control.guidance.orbit import (
    Orbit,
    Times,
    ground_N_m,
    orbit_of,
    sun_direction_N,
)
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

#: Rates and accelerations are differences over so much time [ns].
DIFFERENCE_NS = 10**8
_ECLIPTIC_NORTH_N = np.array([0.0, -0.397777, 0.917482])


class Guidance:
    """The attitudes of a configuration, with rates and accelerations.

    Raises what `orbit_of` raises.
    """

    def __init__(self, config: GuidanceConfig) -> None:
        """Find the orbit where the mode needs one."""
        self._config = config
        self._orbit: Orbit | None = orbit_of(config) if config.mode in ORBITING else None
        x, y, z, w = config.attitude_xyzw
        self._R_0 = so3.rotation_from_quaternion([w, x, y, z])

    def points(self, times_ns: Times) -> tuple[Array, Array, Array]:
        """Map times (m,) [ns since 1970] to R_ND (m, 3, 3), omega_DN_D and alpha_DN_D (m, 3).

        Central differences of the attitude, in the axes of the target [rad/s, rad/s^2].
        """
        d = DIFFERENCE_NS / 1e9
        before, now, after = (self.attitudes(times_ns + k * DIFFERENCE_NS) for k in (-1, 0, 1))
        first = so3.log(np.swapaxes(before, 1, 2) @ now) / d
        second = so3.log(np.swapaxes(now, 1, 2) @ after) / d
        return now, 0.5 * (first + second), (second - first) / d

    def attitudes(self, times_ns: Times) -> Array:
        """Map times (m,) [ns since 1970] to attitudes R_ND (m, 3, 3)."""
        config = self._config
        if config.mode == 'inertial':
            return np.tile(self._R_0, (len(times_ns), 1, 1))
        if config.mode == 'spin':
            turns = config.spin_rate_rad_s * ((times_ns - round(config.epoch_s * 1e9)) / 1e9)
            return self._R_0 @ so3.exp(
                np.remainder(turns, 2.0 * np.pi)[:, None] * config.axis_B)
        along, second = self._directions(times_ns)
        return _axes(along, second) @ _axes(
            config.axis_B[None], config.second_axis_B[None])[0].T

    def elevation_rad(self, times_ns: Times) -> Array:
        """Return how high above the target's horizon the spacecraft is (m,)."""
        assert self._orbit is not None
        place, target = self._orbit(times_ns), ground_N_m(self._config, times_ns)
        return np.arcsin(np.sum(_unit(place - target) * _unit(target), axis=1))

    def _directions(self, times_ns: Times) -> tuple[Array, Array]:
        """Return where the axis points and where the second one is turned to (m, 3)."""
        if self._orbit is None:
            sun = sun_direction_N(times_ns)
            return sun, np.broadcast_to(_ECLIPTIC_NORTH_N, sun.shape)
        place = self._orbit(times_ns)
        velocity = (self._orbit(times_ns + DIFFERENCE_NS)
                    - self._orbit(times_ns - DIFFERENCE_NS))
        if self._config.mode == 'velocity':
            return velocity, -place
        if self._config.mode == 'nadir':
            return -place, velocity
        return ground_N_m(self._config, times_ns) - place, velocity


def _unit(vectors: Array) -> Array:
    """Return vectors (m, 3) of length 1."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _axes(first: Array, second: Array) -> Array:
    """Return the rotations (m, 3, 3) whose columns are first, its normal with second, the rest."""
    one, normal = _unit(first), _unit(np.cross(first, second))
    return np.stack([one, normal, np.cross(one, normal)], axis=2)
