# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Conventions of other stacks: how their numbers say an attitude, a rate or a torque.

N and B are this package's inertial and body axes, W and M those of the other stack: with ROS's
own choice (REP-103), N is east, north, up where W is a local frame, and B is forward, left, up.
Quaternions are Hamilton's. A convention maps both ways; its two maps are inverse to rounding
(1e-15 of unit quaternions, test_conventions.py), and the plain convention leaves every bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]
Rows = tuple[Vector, Vector, Vector]

#: Forms of an attitude, with the names of their components; a matrix is row by row.
FORMS = {'quaternion_xyzw': 'xyzw', 'quaternion_wxyz': 'wxyz', 'mrp': 'xyz', 'matrix': '012345678'}
DIRECTIONS = ('body_to_world', 'world_to_body')
RATE_AXES = ('body', 'world')
RATE_UNITS = {'rad/s': 1.0, 'deg/s': math.pi / 180.0}
#: A matrix R with an entry of R^T R - I beyond this is no rotation.
ROTATION_TOLERANCE = 1e-2
#: Rotations to our axes from named ones; the others by 9 numbers.
BODY_AXES: dict[str, Rows | None] = {
    'FLU': None, 'FRD': ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))}
WORLD_AXES: dict[str, Rows | None] = {
    'ENU': None, 'inertial': None,
    'NED': ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0))}


@dataclass(frozen=True)
class Axes:
    """A fixed rotation R (3, 3) from the axes of a stack to ours, as rows and as w, x, y, z."""

    rows: Rows
    quaternion_wxyz: Quaternion

    def to_ours(self, vector: Vector) -> Vector:
        """Map components in the axes of the stack to components in ours: R v."""
        return _product(self.rows, vector)

    def to_theirs(self, vector: Vector) -> Vector:
        """Map components in our axes to components in those of the stack: R^T v."""
        return _product(_transposed(self.rows), vector)


def axes_of(key: str, value: object, named: dict[str, Rows | None]) -> Axes | None:
    """Return axes by name, or by the 9 numbers of R row by row; None for ours.

    Raises ConfigurationError naming ``key``.
    """
    if isinstance(value, str) and value in named:
        rows = named[value]
        return None if rows is None else _axes(np.array(rows))
    valid = f'{" or ".join(named)}, or the 9 numbers of a rotation matrix row by row, to our axes'
    numbers = isinstance(value, (list, tuple)) and all(
        isinstance(each, (int, float)) and not isinstance(each, bool) for each in value)
    if not numbers or len(value) != 9:  # type: ignore[arg-type]
        raise ConfigurationError(key, value, valid)
    R = np.array(value, dtype=np.float64).reshape(3, 3)
    if not (np.isfinite(R).all() and so3.is_rotation(R, 1e-6)):
        raise ConfigurationError(key, value, valid)
    return _axes(so3.rotation_from_quaternion(so3.quaternion_from_rotation(R)))


@dataclass(frozen=True)
class AttitudeConvention:
    """How a stack says an attitude: its form, which way it maps, and between which axes.

    ``mrp`` is tan(angle / 4) times the axis of the rotation that turns the world axes into the
    body axes, so that body_to_world is sigma_BN of the literature.
    """

    form: str = 'quaternion_xyzw'
    direction: str = 'body_to_world'
    world: Axes | None = None
    body: Axes | None = None

    def read(self, values: Sequence[float]) -> Quaternion:
        """Map the components of a message to x, y, z, w of q_NB = q_NW q_WM q_BM^-1.

        The length of a quaternion is kept. Raises ValueError for a matrix that is no rotation.
        """
        q = _READ[self.form](values)
        if self.direction == 'world_to_body':
            q = _inverse(q)
        if self.world is not None:
            q = _times(self.world.quaternion_wxyz, q)
        if self.body is not None:
            q = _times(q, _inverse(self.body.quaternion_wxyz))
        return (*q[1:], q[0])

    def write(self, quaternion_xyzw: Quaternion) -> tuple[float, ...]:
        """Map x, y, z, w of q_NB to the components of a message; inverse of `read`."""
        q = (quaternion_xyzw[3], *quaternion_xyzw[:3])
        if self.body is not None:
            q = _times(q, self.body.quaternion_wxyz)
        if self.world is not None:
            q = _times(_inverse(self.world.quaternion_wxyz), q)
        if self.direction == 'world_to_body':
            q = _inverse(q)
        return _WRITE[self.form](q)


@dataclass(frozen=True)
class RateConvention:
    """How a stack says the rate of the body against the world: in which axes and unit."""

    axes: str = 'body'
    unit: str = 'rad/s'
    world: Axes | None = None
    body: Axes | None = None

    def read(self, values: Vector, quaternion_xyzw: Quaternion) -> Vector:
        """Map the components of a message to omega_BN_B [rad/s], with the attitude q_NB."""
        scale = RATE_UNITS[self.unit]
        vector = values if scale == 1.0 else _scaled(values, scale)
        if self.axes == 'world':
            vector = vector if self.world is None else self.world.to_ours(vector)
            return _product(_transposed(_rotation(quaternion_xyzw)), vector)
        return vector if self.body is None else self.body.to_ours(vector)

    def write(self, omega_BN_B: Vector, quaternion_xyzw: Quaternion) -> Vector:
        """Map omega_BN_B [rad/s] to the components of a message; inverse of `read`."""
        if self.axes == 'world':
            vector = _product(_rotation(quaternion_xyzw), omega_BN_B)
            vector = vector if self.world is None else self.world.to_theirs(vector)
        else:
            vector = omega_BN_B if self.body is None else self.body.to_theirs(omega_BN_B)
        scale = RATE_UNITS[self.unit]
        return vector if scale == 1.0 else _scaled(vector, 1.0 / scale)


def _read_mrp(values: Sequence[float]) -> Quaternion:
    """Map s to w = (1 - s.s) / (1 + s.s), v = 2 s / (1 + s.s)."""
    x, y, z = values
    square = x * x + y * y + z * z
    twice = 2.0 / (1.0 + square)
    return ((1.0 - square) / (1.0 + square), twice * x, twice * y, twice * z)


def _write_mrp(q: Quaternion) -> Vector:
    """Map w, v to s = v / (1 + w), of the two that of length 1 or less."""
    w, x, y, z = q if q[0] >= 0.0 else _scaled4(q, -1.0)
    return (x / (1.0 + w), y / (1.0 + w), z / (1.0 + w))


def _read_matrix(values: Sequence[float]) -> Quaternion:
    """Map nine numbers row by row to a quaternion."""
    R = np.array(values, dtype=np.float64).reshape(3, 3)
    if np.isfinite(R).all() and not (
            so3.is_rotation(R, ROTATION_TOLERANCE) and np.linalg.det(R) > 0.0):
        raise ValueError('the matrix is not a rotation')
    w, x, y, z = so3.quaternion_from_rotation(R).tolist()
    return (w, x, y, z)


def _write_matrix(q: Quaternion) -> tuple[float, ...]:
    """Map a quaternion to nine numbers row by row."""
    return tuple(so3.rotation_from_quaternion(q).ravel().tolist())


_READ = {
    'quaternion_xyzw': lambda values: (values[3], values[0], values[1], values[2]),
    'quaternion_wxyz': lambda values: (values[0], values[1], values[2], values[3]),
    'mrp': _read_mrp, 'matrix': _read_matrix}
_WRITE = {
    'quaternion_xyzw': lambda q: (q[1], q[2], q[3], q[0]), 'quaternion_wxyz': lambda q: q,
    'mrp': _write_mrp, 'matrix': _write_matrix}


def _axes(R: so3.Array) -> Axes:
    """Return a rotation in both forms."""
    w, x, y, z = so3.quaternion_from_rotation(R).tolist()
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    return Axes(((a, b, c), (d, e, f), (g, h, i)), (w, x, y, z))


def _rotation(quaternion_xyzw: Quaternion) -> Rows:
    """Return the rows of the rotation of a quaternion, NaN where there is none."""
    x, y, z, w = quaternion_xyzw
    length = x * x + y * y + z * z + w * w
    s = 2.0 / length if 0.0 < length < math.inf else math.nan
    return ((1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)),
            (s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)),
            (s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)))


def _inverse(q: Quaternion) -> Quaternion:
    """Return the conjugate of w, x, y, z."""
    return (q[0], -q[1], -q[2], -q[3])


def _times(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return Hamilton's product a b of w, x, y, z."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx, aw * bz + ax * by - ay * bx + az * bw)


def _product(rows: Rows, vector: Vector) -> Vector:
    """Return a matrix times a vector."""
    x, y, z = vector
    (a, b, c), (d, e, f), (g, h, i) = rows
    return (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)


def _transposed(rows: Rows) -> Rows:
    """Return the transpose."""
    (a, b, c), (d, e, f), (g, h, i) = rows
    return ((a, d, g), (b, e, h), (c, f, i))


def _scaled(vector: Vector, scale: float) -> Vector:
    """Return a multiple of a vector."""
    return (vector[0] * scale, vector[1] * scale, vector[2] * scale)


def _scaled4(q: Quaternion, scale: float) -> Quaternion:
    """Return a multiple of a quaternion."""
    return (q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale)
