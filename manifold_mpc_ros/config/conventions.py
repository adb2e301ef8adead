# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Conventions of other stacks: how their numbers say an attitude, a rate or a torque.

N and B are this package's inertial and body axes, W and M those of the other stack: with ROS's
own choice (REP-103), N is east, north, up where W is a local frame, and B is forward, left, up.
Quaternions are Hamilton's. The maps are in control/described/conversions.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from manifold_mpc_ros.config import checks
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

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

    R: Array
    q_wxyz: Quaternion


def axes_of(key: str, value: object, named: Named) -> Axes | None:
    """Return axes by name, or by the 9 numbers of R row by row; None for ours.

    Raises ConfigurationError naming ``key``.
    """
    if isinstance(value, str) and value in named:
        rows = named[value]
        return None if rows is None else Axes(np.array(rows), wxyz(np.array(rows)))
    valid = f'{" or ".join(named)}, or the 9 numbers of a rotation matrix row by row, to our axes'
    R = checks.array(key, value, valid)
    if R.shape != (9,) or not so3.is_rotation(R.reshape(3, 3), 1e-6):
        raise ConfigurationError(key, value, valid)
    q_wxyz = wxyz(R.reshape(3, 3))
    return Axes(so3.rotation_from_quaternion(q_wxyz), q_wxyz)


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

    @cached_property
    def names(self) -> str:
        """One character for each component."""
        return FORMS[self.form]


@dataclass(frozen=True)
class RateConvention:
    """How a stack says the rate of the body against the world: in which axes and unit."""

    axes: str = 'body'
    unit: str = 'rad/s'
    world: Axes | None = None
    body: Axes | None = None

    names = 'xyz'


def wxyz(R: Array) -> Quaternion:
    """Return the quaternion of a rotation."""
    w, x, y, z = so3.quaternion_from_rotation(R).tolist()
    return (w, x, y, z)
