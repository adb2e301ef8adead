# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Between the numbers of other stacks and ours, by their conventions (config/conventions.py).

A state that is written and read again is the state within 1e-15, whatever the convention
(test_conversions.py); the plain convention leaves every bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from manifold_mpc_ros.config.conventions import (
    RATE_UNITS,
    ROTATION_TOLERANCE,
    AttitudeConvention,
    Axes,
    Quaternion,
    RateConvention,
    Vector,
    wxyz,
)
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array


def read_attitude(convention: AttitudeConvention, values: Sequence[float]) -> Quaternion:
    """Map the components of a message to x, y, z, w of q_NB = q_NW q_WM q_BM^-1.

    The length of a quaternion is kept. Raises ValueError for a matrix that is no rotation.
    """
    q = _READ[convention.form](values)
    if convention.direction == 'world_to_body':
        q = _inverse(q)
    if convention.world is not None:
        q = _times(convention.world.q_wxyz, q)
    if convention.body is not None:
        q = _times(q, _inverse(convention.body.q_wxyz))
    return (*q[1:], q[0])


def read_rate(
    convention: RateConvention, values: Vector, quaternion_xyzw: Quaternion,
) -> Vector:
    """Map the components of a message to omega_BN_B [rad/s], with the attitude q_NB.

    Raises ValueError for an attitude that is needed and no number.
    """
    scale = RATE_UNITS[convention.unit]
    vector = values if scale == 1.0 else _vector(scale * np.array(values))
    if convention.axes == 'body':
        return to_ours(convention.body, vector)
    x, y, z, w = quaternion_xyzw
    R_NB = so3.rotation_from_quaternion((w, x, y, z))
    return _vector(R_NB.T @ to_ours(convention.world, vector))


def write_attitude(
    convention: AttitudeConvention, quaternion_xyzw: Quaternion,
) -> tuple[float, ...]:
    """Map x, y, z, w of q_NB to the components of a message; inverse of `read_attitude`."""
    x, y, z, w = quaternion_xyzw
    q = (w, x, y, z)
    if convention.world is not None:
        q = _times(_inverse(convention.world.q_wxyz), q)
    if convention.body is not None:
        q = _times(q, convention.body.q_wxyz)
    return _WRITE[convention.form](
        q if convention.direction == 'body_to_world' else _inverse(q))


def write_rate(
    convention: RateConvention, omega_BN_B: Vector, quaternion_xyzw: Quaternion,
) -> Vector:
    """Map omega_BN_B [rad/s], with q_NB, to the components of a message: as `read_rate` reads."""
    vector = omega_BN_B
    if convention.axes == 'world':
        x, y, z, w = quaternion_xyzw
        vector = _vector(so3.rotation_from_quaternion((w, x, y, z)) @ vector)
    vector = to_theirs(
        convention.body if convention.axes == 'body' else convention.world, vector)
    scale = RATE_UNITS[convention.unit]
    return vector if scale == 1.0 else _vector(np.array(vector) / scale)


def to_ours(axes: Axes | None, vector: Vector) -> Vector:
    """Map components in the axes of a stack to components in ours: R v."""
    return vector if axes is None else _vector(axes.R @ vector)


def to_theirs(axes: Axes | None, vector: Vector) -> Vector:
    """Map components in our axes to components in those of a stack: R^T v."""
    return vector if axes is None else _vector(axes.R.T @ vector)


def _read_mrp(values: Sequence[float]) -> Quaternion:
    """Map s to w = (1 - s.s) / (1 + s.s), v = 2 s / (1 + s.s)."""
    x, y, z = values
    square = x * x + y * y + z * z
    twice = 2.0 / (1.0 + square)
    return ((1.0 - square) / (1.0 + square), twice * x, twice * y, twice * z)


def _read_matrix(values: Sequence[float]) -> Quaternion:
    """Map nine numbers row by row to a quaternion."""
    R = np.array(values, dtype=np.float64).reshape(3, 3)
    if np.isfinite(R).all() and not (
            so3.is_rotation(R, ROTATION_TOLERANCE) and np.linalg.det(R) > 0.0):
        raise ValueError('the matrix is not a rotation')
    return wxyz(R)


def _write_mrp(q: Quaternion) -> Vector:
    """Map a quaternion to the set of MRP of the shorter turn: v / (1 + w), of q or -q."""
    w, x, y, z = q
    below = math.copysign(1.0, w) + w
    return (x / below, y / below, z / below)


_READ = {
    'quaternion_xyzw': lambda values: (values[3], values[0], values[1], values[2]),
    'quaternion_wxyz': lambda values: (values[0], values[1], values[2], values[3]),
    'mrp': _read_mrp, 'matrix': _read_matrix}
_WRITE: dict[str, Callable[[Quaternion], tuple[float, ...]]] = {
    'quaternion_xyzw': lambda q: (*q[1:], q[0]), 'quaternion_wxyz': lambda q: q,
    'mrp': _write_mrp,
    'matrix': lambda q: tuple(so3.rotation_from_quaternion(q).ravel().tolist())}


def _vector(values: Array) -> Vector:
    """Return three numbers."""
    x, y, z = values.tolist()
    return (x, y, z)


def _inverse(q: Quaternion) -> Quaternion:
    """Return the conjugate of w, x, y, z."""
    return (q[0], -q[1], -q[2], -q[3])


def _times(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return Hamilton's product a b of w, x, y, z."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx, aw * bz + ax * by - ay * bx + az * bw)
