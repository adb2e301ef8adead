# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Smooth manifolds with a chart at their origin: R^n, SO(3), S^2 and products of them.

A point is a column of ``ambient`` numbers. The chart is phi: R^n -> M with phi(0) the origin, the
equilibrium of the paper's section 2; it is injective where each factor's coordinates are shorter
than its ``chart_radius``. Formulas are CasADi expressions, valid and differentiable at the origin.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.lie.symbolic import direction_log, quaternion_log, quaternion_product

# Below this squared length a series replaces a closed form that divides 0 by 0.
_SMALL = 1e-8


class Manifold(Protocol):
    """What the design procedure needs of a manifold M of dimension n.

    ``euler_characteristic`` is 0 for SO(3), 2 for S^2, 1 for R^n; ``contractible`` says whether
    a continuous law could stabilise the origin globally (paper section 4: only on R^n here).
    """

    @property
    def name(self) -> str:
        """The manifold's usual name."""

    @property
    def dimension(self) -> int:
        """The dimension n."""

    @property
    def ambient(self) -> int:
        """How many numbers represent a point."""

    @property
    def origin(self) -> Array:
        """The point phi(0) (ambient,)."""

    @property
    def chart_radii(self) -> tuple[tuple[int, float], ...]:
        """(dimension, radius) of each factor's chart, in the order of the coordinates."""

    @property
    def euler_characteristic(self) -> int:
        """The Euler characteristic."""

    @property
    def contractible(self) -> bool:
        """Whether the manifold is contractible."""

    def point(self, xi: ca.SX) -> ca.SX:
        """Map coordinates (n,) to the point phi(xi) (ambient,)."""

    def coordinates(self, point: ca.SX) -> ca.SX:
        """Map a point (ambient,) to its coordinates phi^-1 (n,)."""

    def retract(self, point: ca.SX, step: ca.SX) -> ca.SX:
        """Move a point along a tangent vector (n,): any point, first order exact."""

    def distance(self, a: ca.SX, b: ca.SX) -> ca.SX:
        """Return the geodesic distance of two points."""


class Euclidean:
    """R^n with the identity as its chart."""

    chart_radius = float('inf')
    euler_characteristic = 1
    contractible = True

    def __init__(self, dimension: int) -> None:
        """Make R^dimension."""
        self.name, self.dimension, self.ambient = f'R^{dimension}', dimension, dimension
        self.origin = np.zeros(dimension)
        self.chart_radii = ((dimension, float('inf')),)

    def point(self, xi: ca.SX) -> ca.SX:
        """Return xi."""
        return xi

    def coordinates(self, point: ca.SX) -> ca.SX:
        """Return the point."""
        return point

    def retract(self, point: ca.SX, step: ca.SX) -> ca.SX:
        """Return the sum."""
        return point + step

    def distance(self, a: ca.SX, b: ca.SX) -> ca.SX:
        """Return ``|a - b|``."""
        return ca.norm_2(a - b)


class RotationGroup:
    """SO(3) as unit quaternions (w, x, y, z), q and -q the same point.

    ``phi(xi) = exp(hat(scale xi))``; the scale turns a rotation into a rate when it is a step of
    that many seconds.
    """

    name, dimension, ambient = 'SO(3)', 3, 4
    euler_characteristic = 0
    contractible = False

    def __init__(self, scale: float = 1.0) -> None:
        """Scale the chart; coordinates are ``Log / scale``."""
        self.scale = scale
        self.origin = np.array([1.0, 0.0, 0.0, 0.0])
        self.chart_radii = ((3, np.pi / scale),)

    def point(self, xi: ca.SX) -> ca.SX:
        """Return the quaternion of the rotation vector ``scale xi``."""
        half = self.scale / 2 * xi
        return ca.vertcat(_cosine(half), _sinc(half) * half)

    def coordinates(self, point: ca.SX) -> ca.SX:
        """Return ``Log(point) / scale``, at most pi / scale long."""
        return quaternion_log(point) / self.scale

    def retract(self, point: ca.SX, step: ca.SX) -> ca.SX:
        """Return ``point exp(hat(scale step))``, a step in body axes."""
        return quaternion_product(point, self.point(step))

    def distance(self, a: ca.SX, b: ca.SX) -> ca.SX:
        """Return the angle between two attitudes over the scale."""
        inverse = ca.vertcat(a[0], -a[1:4])
        return ca.norm_2(quaternion_log(quaternion_product(inverse, b))) / self.scale


class Sphere:
    """S^2, unit vectors of R^3, with its origin at a given axis b.

    ``phi(xi) = exp(-hat(x)) b`` with ``x = E xi`` and E (3, 2) a right-handed basis of the plane
    across b: x is the shortest rotation vector of a body whose axis b should meet the point.
    """

    name, dimension, ambient = 'S^2', 2, 3
    chart_radii = ((2, np.pi),)
    euler_characteristic = 2
    contractible = False

    def __init__(self, axis: ArrayLike) -> None:
        """Put the origin at ``axis`` (3,), a unit vector."""
        self.origin = np.asarray(axis, dtype=float)
        self.basis = tangent_basis(self.origin)

    def point(self, xi: ca.SX) -> ca.SX:
        """Return ``exp(-hat(E xi)) b``."""
        return _rotated(-self.basis @ xi, ca.SX(self.origin))

    def coordinates(self, point: ca.SX) -> ca.SX:
        """Return ``angle E^T (point cross b) / |point cross b|``; at -b the first basis axis."""
        axis, across = ca.SX(self.origin), ca.SX(self.basis[:, 0])
        return self.basis.T @ direction_log(point, axis, across)

    def retract(self, point: ca.SX, step: ca.SX) -> ca.SX:
        """Return ``T phi(step)``, T the shortest rotation that takes the origin to the point."""
        return _rotated(-self.basis @ self.coordinates(point), self.point(step))

    def distance(self, a: ca.SX, b: ca.SX) -> ca.SX:
        """Return the angle between two directions."""
        return ca.atan2(ca.norm_2(ca.cross(a, b)), ca.dot(a, b))


class Product:
    """The product of manifolds, points and coordinates stacked in order."""

    def __init__(self, *factors: Manifold) -> None:
        """Stack the factors."""
        self.factors: Sequence[Manifold] = factors
        self.name = ' x '.join(factor.name for factor in factors)
        self.dimension = sum(factor.dimension for factor in factors)
        self.ambient = sum(factor.ambient for factor in factors)
        self.origin = np.concatenate([factor.origin for factor in factors])
        self.chart_radii = tuple(radius for factor in factors for radius in factor.chart_radii)
        self.euler_characteristic = int(
            np.prod([factor.euler_characteristic for factor in factors]))
        self.contractible = all(factor.contractible for factor in factors)

    def split(self, point: ca.SX) -> list[ca.SX]:
        """Return the factors' parts of a point."""
        ends = np.cumsum([0, *(factor.ambient for factor in self.factors)]).tolist()
        return [point[low:high] for low, high in pairwise(ends)]

    def split_coordinates(self, xi: ca.SX) -> list[ca.SX]:
        """Return the factors' parts of coordinates or of a tangent step."""
        ends = np.cumsum([0, *(factor.dimension for factor in self.factors)]).tolist()
        return [xi[low:high] for low, high in pairwise(ends)]

    def point(self, xi: ca.SX) -> ca.SX:
        """Return the factors' points."""
        return ca.vertcat(*(factor.point(part) for factor, part
                            in zip(self.factors, self.split_coordinates(xi))))

    def coordinates(self, point: ca.SX) -> ca.SX:
        """Return the factors' coordinates."""
        return ca.vertcat(*(factor.coordinates(part) for factor, part
                            in zip(self.factors, self.split(point))))

    def retract(self, point: ca.SX, step: ca.SX) -> ca.SX:
        """Move every factor by its part of the step."""
        return ca.vertcat(*(factor.retract(part, move) for factor, part, move in zip(
            self.factors, self.split(point), self.split_coordinates(step))))

    def distance(self, a: ca.SX, b: ca.SX) -> ca.SX:
        """Return the root of the sum of the factors' squared distances."""
        parts = [factor.distance(one, other) for factor, one, other in zip(
            self.factors, self.split(a), self.split(b))]
        return ca.norm_2(ca.vertcat(*parts))


def tangent_basis(axis: ArrayLike) -> Array:
    """Map a unit vector b (3,) to E (3, 2) with orthonormal columns and ``e1 x e2 = b``.

    e1 lies in the plane of b and the coordinate axis that b leans on least.
    """
    b = np.asarray(axis, dtype=float)
    helper = np.eye(3)[int(np.argmin(np.abs(b)))]
    first = helper - b * (b @ helper)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(b, first)], axis=1)


def _cosine(v: ca.SX) -> ca.SX:
    """Return cos|v|, differentiable at 0."""
    squared = ca.dot(v, v)
    small = squared < _SMALL
    series = 1 - squared / 2 + squared * squared / 24
    return ca.if_else(small, series, ca.cos(ca.sqrt(ca.if_else(small, 1, squared))))


def _sinc(v: ca.SX) -> ca.SX:
    """Return sin|v| / |v|, differentiable at 0."""
    squared = ca.dot(v, v)
    small = squared < _SMALL
    angle = ca.sqrt(ca.if_else(small, 1, squared))
    series = 1 - squared / 6 + squared * squared / 120
    return ca.if_else(small, series, ca.sin(angle) / angle)


def _rotated(x: ca.SX, v: ca.SX) -> ca.SX:
    """Return ``exp(hat(x)) v``."""
    half = _sinc(x / 2)
    return _cosine(x) * v + _sinc(x) * ca.cross(x, v) + half * half / 2 * ca.dot(x, v) * x
