# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Stratified draws shared by the tests: rotations, rates and inertias, seeded and replayable.

Formulas on SO(3) branch near 0 and near 180 degrees, so every draw comes from a named stratum
and a test runs on each of them.
"""

from __future__ import annotations

import functools
import zlib
from collections.abc import Callable

import numpy as np
from hypothesis import strategies as st

from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.lie.coefficients import SERIES_ANGLE

# Distances from 0 and from 180 degrees [rad].
OFFSETS_RAD = np.logspace(-12, -3, 10)


def generator(*key: object) -> np.random.Generator:
    """Return a generator whose stream depends on the key alone."""
    return np.random.default_rng(zlib.crc32(repr(key).encode()))


def unit_vectors(rng: np.random.Generator, n: int) -> Array:
    """Return n directions (n, 3), uniform on the sphere."""
    v = rng.standard_normal((n, 3))
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def axes(rng: np.random.Generator, n: int) -> Array:
    """Return the six principal half axes, six diagonals of faces and n random axes."""
    diagonals = np.array([[1, 1, 0], [1, -1, 0], [0, 1, 1], [0, 1, -1], [1, 0, 1], [-1, 0, 1]])
    return np.concatenate(
        [np.eye(3), -np.eye(3), diagonals / np.sqrt(2.0), unit_vectors(rng, n)]
    )


def _with_angles(rng: np.random.Generator, angles: Array, per_angle: int) -> Array:
    v = np.stack([axes(rng, per_angle) for _ in angles])
    return (angles[:, None, None] * v).reshape(-1, 3)


def uniform(rng: np.random.Generator) -> Array:
    """Return rotation vectors of rotations uniform on SO(3), by their known angle and axis."""
    # The angle of a uniform rotation has the density (1 - cos t)/pi; inverted on a grid.
    grid = np.linspace(0.0, np.pi, 10001)
    angles = np.interp(rng.uniform(size=2000), (grid - np.sin(grid)) / np.pi, grid)
    return angles[:, None] * unit_vectors(rng, 2000)


def near_identity(rng: np.random.Generator) -> Array:
    """Return rotation vectors of length 1e-12 to 1e-3 rad."""
    return _with_angles(rng, OFFSETS_RAD, 30)


def near_half_turn(rng: np.random.Generator) -> Array:
    """Return rotation vectors 1e-12 to 1e-3 rad short of 180 degrees."""
    return _with_angles(rng, np.pi - OFFSETS_RAD, 30)


def near_thresholds(rng: np.random.Generator) -> Array:
    """Return rotation vectors on both sides of every angle at which a formula changes.

    The coefficients change to series at SERIES_ANGLE; the largest component of the quaternion
    changes at 90 degrees about the diagonals and at 120 degrees about (1, 1, 1).
    """
    sides = np.array([-1e-3, -1e-9, -1e-15, 0.0, 1e-15, 1e-9, 1e-3])
    switches = np.array([SERIES_ANGLE, np.pi / 2, 2 * np.pi / 3])
    angles = (switches[:, None] + sides).ravel()
    diagonal = angles[:, None] * np.array([1.0, 1.0, 1.0]) / np.sqrt(3.0)
    return np.concatenate([_with_angles(rng, angles, 10), diagonal])


# Rotation vectors shorter than pi, by stratum; the logarithm returns each of them.
ROTATION_VECTORS: dict[str, Callable[[np.random.Generator], Array]] = {
    'uniform': uniform,
    'near_identity': near_identity,
    'near_half_turn': near_half_turn,
    'near_thresholds': near_thresholds,
}


@functools.cache
def rotation_vectors(stratum: str) -> Array:
    """Return the rotation vectors (n, 3) of one stratum, read-only, the same in every run."""
    vectors = ROTATION_VECTORS[stratum](generator(stratum))
    vectors.flags.writeable = False
    return vectors


def half_turns(axis: Array) -> Array:
    """Return the rotations (..., 3, 3) by exactly 180 degrees about unit axes (..., 3)."""
    return 2.0 * axis[..., :, None] * axis[..., None, :] - np.eye(3)


def principal_inertia(*moments: float) -> Array:
    """Return the inertia tensor with these principal moments, in principal axes."""
    return np.diag(np.array(moments, dtype=np.float64))


def turned(inertia: Array, rng: np.random.Generator) -> Array:
    """Return the inertia in random axes, exactly symmetric."""
    Q = so3.random_rotations(rng, 1)[0]
    J = Q @ inertia @ Q.T
    return 0.5 * (J + J.T)


# Inertia tensors [kg m^2] that every test of the dynamics runs on.
INERTIAS: dict[str, Array] = {
    'symmetric': principal_inertia(0.8, 0.8, 0.8),
    'oblate': principal_inertia(0.7, 0.7, 1.2),
    'prolate': principal_inertia(1.0, 1.0, 0.3),
    'asymmetric': principal_inertia(1.0, 0.9, 0.6),
    'off_diagonal': turned(principal_inertia(1.0, 0.9, 0.6), generator('off_diagonal')),
    'off_diagonal_prolate': turned(principal_inertia(0.2, 1.1, 1.2), generator('prolate')),
    'cubesat': turned(principal_inertia(2e-3, 8e-3, 9e-3), generator('cubesat')),
    'station': turned(principal_inertia(1.2e8, 0.6e8, 1.5e8), generator('station')),
}


def random_inertias(rng: np.random.Generator, n: int) -> Array:
    """Return n inertia tensors (n, 3, 3) of solid bodies in random axes [kg m^2].

    The moments are sums of two of three positive second moments, so they always satisfy the
    triangle inequality; the third of them goes down to 2 % of the largest (a thin plate).
    """
    second = rng.uniform(0.02, 1.0, size=(n, 3))
    moments = np.sum(second, axis=-1, keepdims=True) - second
    Q = so3.random_rotations(rng, n)
    J = (Q * moments[:, None, :]) @ np.swapaxes(Q, -1, -2)
    return 0.5 * (J + np.swapaxes(J, -1, -2))


def momenta(rng: np.random.Generator, J: Array, fraction: float, n: int) -> Array:
    """Return m = h Pi (n + 12, 3) at this fraction of the existence guard of J."""
    return fraction * np.linalg.eigvalsh(J)[0] * axes(rng, n)


def rates(rng: np.random.Generator, n: int, largest_rad_s: float) -> Array:
    """Return n body rates (n, 3) of any direction, up to this length [rad/s], zero included."""
    lengths = largest_rad_s * rng.uniform(size=(n, 1))
    lengths[0] = 0.0
    return lengths * unit_vectors(rng, n)


@st.composite
def drawn_rotation_vectors(draw: st.DrawFn) -> Array:
    """Draw one rotation vector (3,) of any stratum."""
    stratum = draw(st.sampled_from(sorted(ROTATION_VECTORS)))
    vectors = rotation_vectors(stratum)
    return vectors[draw(st.integers(0, len(vectors) - 1))]


@st.composite
def drawn_inertias(draw: st.DrawFn) -> Array:
    """Draw one inertia tensor (3, 3), from the named ones or at random."""
    name = draw(st.sampled_from([*sorted(INERTIAS), 'random']))
    if name == 'random':
        return random_inertias(np.random.default_rng(draw(st.integers(0, 2**32 - 1))), 1)[0]
    return INERTIAS[name]


def drawn_unit_vectors() -> st.SearchStrategy[Array]:
    """Draw one direction (3,), principal axes among them."""
    directions = axes(generator('drawn_unit_vectors'), 500)
    return st.integers(0, len(directions) - 1).map(lambda i: directions[i])
