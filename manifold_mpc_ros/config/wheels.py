# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reaction wheels: geometry, limits, and the sets of torques and momenta that they can give.

With W (3, n), columns the unit wheel axes w_i, wheels of motor torques u (n,) give the body the
torque -W u, so every torque of the zonotope

    {W u: |u_i| <= u_max_i} = {t: |n . t| <= sum_i |n . w_i| u_max_i for every facet normal n},

whose facet normals are w_i x w_j. Their momenta W h_w fill a zonotope likewise.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from manifold_mpc_ros.config import checks as checks
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array, BoolArray

#: What motor torques that turn nothing are used for.
NULL_SPACES = ('least_torque', 'away_from_zero', 'balanced')
#: Axes whose smallest singular value is below this span less than three dimensions.
LEAST_SPREAD = 1e-6


@dataclass(frozen=True, eq=False)
class Zonotope:
    """The torques or momenta t (3,) with ``|n_f . t| <= bound_f``: normals (m, 3), bounds (m,)."""

    normals: Array
    bounds: Array

    def gauge(self, vectors_B: Array) -> float:
        """Return the least s with (3,) or (3, m) vectors in s times the set: at most 1 inside."""
        return float(np.max(np.abs(self.normals @ vectors_B).T / self.bounds))

    @property
    def box(self) -> Array:
        """Half widths (3,) of a box inside, in the proportions of the reach along body axes."""
        with np.errstate(divide='ignore'):
            reach = np.min(self.bounds[:, None] / np.abs(self.normals), axis=0)
        return np.asarray(reach * np.min(self.bounds / (np.abs(self.normals) @ reach)))


@dataclass(frozen=True, eq=False)
class WheelArray:
    """Reaction wheels of any number and geometry.

    Arguments
    ---------
    axes_B
        Spin axes in body axes, (n, 3) or 3 n numbers wheel by wheel, normalised here [1].
    max_torque_n_m
        Largest motor torque of each, (n,) or one number for all [N m].
    max_momentum_n_m_s
        Largest momentum about its axis of each, (n,) or one number for all [N m s].
    available
        Which wheels work (n,) bool; None: all of them.
    inertia_kg_m2
        Moment of inertia about the axis, (n,) or one number, by which speeds are momenta; None
        where speeds are not used [kg m^2].
    null_space
        What torques that turn nothing are used for: 'least_torque' (the least of the largest
        relative motor torque), 'away_from_zero' (wheels spun apart, so that few cross zero
        speed), 'balanced' (the least of the largest relative momentum).
    names
        A name for each; none: wheel_1 to wheel_n.

    Raises ConfigurationError naming ``wheels.FIELD``, its value and what would be valid; for axes
    of available wheels that span less than three dimensions too.

    """

    axes_B: Array
    max_torque_n_m: Array
    max_momentum_n_m_s: Array
    available: Any = None
    inertia_kg_m2: Array | None = None
    null_space: str = 'least_torque'
    names: Sequence[str] = ()

    def __post_init__(self) -> None:
        """Check every field."""
        axes = _axes(self.axes_B)
        n = len(axes)
        object.__setattr__(self, 'axes_B', axes)
        for name in ('max_torque_n_m', 'max_momentum_n_m_s', 'inertia_kg_m2'):
            value = getattr(self, name)
            if name != 'inertia_kg_m2' or value is not None:
                object.__setattr__(self, name, checks.each_positive(
                    f'wheels.{name}', value, n))
        given = np.ones(n, dtype=bool) if self.available is None else np.asarray(self.available)
        if given.shape != (n,) or given.dtype != np.bool_:
            raise ConfigurationError('wheels.available', self.available, f'{n} of true or false')
        object.__setattr__(self, 'available', given)
        checks.choice('wheels.null_space', self.null_space, NULL_SPACES)
        names = tuple(self.names) or tuple(f'wheel_{i + 1}' for i in range(n))
        if len(set(names)) != n:
            raise ConfigurationError('wheels.names', self.names, f'{n} names, each of its own')
        object.__setattr__(self, 'names', names)
        if not self.spans_space:
            raise ConfigurationError(
                'wheels.axes_B', axes[given].tolist(),
                'axes of available wheels that span three dimensions')

    def __len__(self) -> int:
        """Return the number of wheels."""
        return len(self.axes_B)

    def __repr__(self) -> str:
        """Return every number."""
        return f'WheelArray({self.plain})'

    @property
    def plain(self) -> dict[str, object]:
        """Every field as lists and words, as in a file."""
        return {name: value.tolist() if isinstance(value, np.ndarray) else value
                for name, value in vars(self).items() if name in self.__dataclass_fields__}

    def without(self, failed: BoolArray) -> WheelArray:
        """Return the array whose wheels ``failed`` (n,) bool are not available either.

        Raises ConfigurationError when fewer than three independent axes are left.
        """
        return replace(self, available=self.available & ~failed)

    def reported(self, momentum_n_m_s: Any) -> tuple[WheelArray, Array]:
        """Map momenta (n,), NaN where one is not known, to the wheels that work, and momenta.

        None: all at rest. All wheels work where too few would be left.

        Raises ConfigurationError for another number of them.
        """
        momentum = np.zeros(len(self)) if momentum_n_m_s is None else np.asarray(
            momentum_n_m_s, dtype=float)
        if momentum.shape != (len(self),) or np.isinf(momentum).any():
            raise ConfigurationError('wheel_momentum_n_m_s', momentum_n_m_s,
                                     f'{len(self)} numbers, one for each of the wheels')
        unknown = np.isnan(momentum)
        try:
            return self if not unknown.any() else self.without(unknown), momentum
        except ConfigurationError:
            return self, momentum

    @property
    def spans_space(self) -> bool:
        """Whether the available wheels give torque about three independent axes."""
        spread = np.linalg.svd(self.matrix, compute_uv=False)
        return len(spread) == 3 and bool(spread[-1] > LEAST_SPREAD)

    @cached_property
    def matrix(self) -> Array:
        """W (3, n), its columns zero for wheels that are not available."""
        return np.asarray(np.where(self.available, self.axes_B.T, 0.0))

    @cached_property
    def inverse(self) -> Array:
        """The pseudo-inverse (n, 3) of W."""
        return np.asarray(np.linalg.pinv(self.matrix))

    @cached_property
    def null_basis(self) -> Array:
        """An orthonormal basis (n, k - 3) of what k available wheels do without turning a body."""
        used = np.flatnonzero(self.available)
        basis = np.zeros((len(self), len(used) - 3))
        basis[used] = np.linalg.svd(self.matrix[:, used])[2][3:].T
        return basis

    @cached_property
    def normals(self) -> Array:
        """Unit normals (m, 3) of the facets of what the available wheels give, one of each pair.

        Each is orthogonal to two axes; parallel pairs give none, coplanar ones the same.
        """
        found: list[Array] = []
        for one, other in itertools.combinations(self.axes_B[self.available], 2):
            normal = np.cross(one, other)
            length = float(np.linalg.norm(normal))
            if length > LEAST_SPREAD and all(
                    np.linalg.norm(np.cross(normal / length, each)) > LEAST_SPREAD
                    for each in found):
                found.append(normal / length)
        return checks.frozen(np.array(found))

    def zonotope(self, limits: Array) -> Zonotope:
        """Return ``{W u: |u_i| <= limits_i}`` of limits (n,)."""
        return Zonotope(self.normals, np.abs(self.normals @ self.matrix) @ limits)

    def held(self, limits: Array) -> Zonotope:
        """Return ``{t: |W^+ t|_i <= limits_i}``: what wheels give whose null space rests.

        It has no more facets: lines that are not in one plane span as many planes or more.
        """
        used = self.available
        rows = self.inverse[used]
        length = np.linalg.norm(rows, axis=1)
        return Zonotope(rows / length[:, None], limits[used] / length)

    @cached_property
    def torques(self) -> Zonotope:
        """The body torques that the available wheels can give."""
        return self.zonotope(self.max_torque_n_m)

    @cached_property
    def momenta(self) -> Zonotope:
        """The momenta in body axes that the available wheels can store."""
        return self.zonotope(self.max_momentum_n_m_s)


def _axes(value: object) -> Array:
    """Return axes (n, 3) of length 1."""
    valid = 'axes of three wheels or more, three numbers each, none of them zero'
    given = checks.array('wheels.axes_B', value, valid)
    if given.ndim == 1 and given.size % 3 == 0:
        given = given.reshape(-1, 3)
    if given.ndim != 2 or given.shape[1] != 3 or len(given) < 3:
        raise ConfigurationError('wheels.axes_B', value, valid)
    length = np.linalg.norm(given, axis=1, keepdims=True)
    if not ((length > 1e-9) & (length < 1e9)).all():
        raise ConfigurationError('wheels.axes_B', value, valid)
    return checks.frozen(given / length)
