# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Conventions of other stacks: how their numbers say an attitude, a rate or a torque.

N and B are this package's inertial and body axes, W and M those of the other stack: with ROS's
own choice (REP-103), N is east, north, up where W is a local frame, and B is forward, left, up.
Quaternions are Hamilton's. What is read of a state that another convention says is the state again
within 1e-15 (test_conventions.py), and the plain convention leaves every bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from manifold_mpc_ros.config import checks
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]

#: Forms of an attitude, with the names of their components; a matrix is row by row.
FORMS = {'quaternion_xyzw': 'xyzw', 'quaternion_wxyz': 'wxyz', 'mrp': 'xyz', 'matrix': '012345678'}
DIRECTIONS = ('body_to_world', 'world_to_body')
RATE_AXES = ('body', 'world')
RATE_UNITS = {'rad/s': 1.0, 'deg/s': math.pi / 180.0}
#: A matrix R with an entry of R^T R - I beyond this is no rotation.
ROTATION_TOLERANCE = 1e-2
#: Rotations to our axes from named ones, None for the same; the others by 9 numbers.
Named = dict[str, list[list[float]] | None]
BODY_AXES: Named = {'FLU': None, 'FRD': [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]}
WORLD_AXES: Named = {'ENU': None, 'inertial': None,
                     'NED': [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]}


class Axes(NamedTuple):
    """The rotation (3, 3) from the axes of a stack to ours, and as w, x, y, z."""

    R: so3.Array
    q_wxyz: Quaternion


def axes_of(key: str, value: object, named: Named) -> Axes | None:
    """Return axes by name, or by the 9 numbers of R row by row; None for ours.

    Raises ConfigurationError naming ``key``.
    """
    if isinstance(value, str) and value in named:
        rows = named[value]
        return None if rows is None else Axes(np.array(rows), _wxyz(np.array(rows)))
    valid = f'{" or ".join(named)}, or the 9 numbers of a rotation matrix row by row, to our axes'
    R = checks.array(key, value, valid)
    if R.shape != (9,) or not so3.is_rotation(R.reshape(3, 3), 1e-6):
        raise ConfigurationError(key, value, valid)
    q_wxyz = _wxyz(R.reshape(3, 3))
    return Axes(so3.rotation_from_quaternion(q_wxyz), q_wxyz)


def to_ours(axes: Axes | None, vector: Vector) -> Vector:
    """Map components in the axes of a stack to components in ours: R v."""
    return vector if axes is None else _vector(axes.R @ vector)


def to_theirs(axes: Axes | None, vector: Vector) -> Vector:
    """Map components in our axes to components in those of a stack: R^T v."""
    return vector if axes is None else _vector(axes.R.T @ vector)


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

    @property
    def names(self) -> str:
        """One character for each component."""
        return FORMS[self.form]

    def read(self, values: Sequence[float]) -> Quaternion:
        """Map the components of a message to x, y, z, w of q_NB = q_NW q_WM q_BM^-1.

        The length of a quaternion is kept. Raises ValueError for a matrix that is no rotation.
        """
        q = _READ[self.form](values)
        if self.direction == 'world_to_body':
            q = _inverse(q)
        if self.world is not None:
            q = _times(self.world.q_wxyz, q)
        if self.body is not None:
            q = _times(q, _inverse(self.body.q_wxyz))
        return (*q[1:], q[0])


@dataclass(frozen=True)
class RateConvention:
    """How a stack says the rate of the body against the world: in which axes and unit."""

    axes: str = 'body'
    unit: str = 'rad/s'
    world: Axes | None = None
    body: Axes | None = None

    names = 'xyz'

    def read(self, values: Vector, quaternion_xyzw: Quaternion) -> Vector:
        """Map the components of a message to omega_BN_B [rad/s], with the attitude q_NB.

        Raises ValueError for an attitude that is needed and no number.
        """
        scale = RATE_UNITS[self.unit]
        vector = values if scale == 1.0 else _vector(scale * np.array(values))
        if self.axes == 'body':
            return to_ours(self.body, vector)
        x, y, z, w = quaternion_xyzw
        R_NB = so3.rotation_from_quaternion((w, x, y, z))
        return _vector(R_NB.T @ to_ours(self.world, vector))


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
    return _wxyz(R)


_READ = {
    'quaternion_xyzw': lambda values: (values[3], values[0], values[1], values[2]),
    'quaternion_wxyz': lambda values: (values[0], values[1], values[2], values[3]),
    'mrp': _read_mrp, 'matrix': _read_matrix}

def _wxyz(R: so3.Array) -> Quaternion:
    """Return the quaternion of a rotation."""
    w, x, y, z = so3.quaternion_from_rotation(R).tolist()
    return (w, x, y, z)


def _vector(values: so3.Array) -> Vector:
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
