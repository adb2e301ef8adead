# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The manifolds by identities: chart and inverse, retraction, distance, on every stratum."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from strategies import OFFSETS_RAD, generator, rotation_vectors, unit_vectors

from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.manifold import (
    Euclidean,
    Manifold,
    Product,
    RotationGroup,
    Sphere,
    tangent_basis,
)

SCALE = 0.25
AXIS = np.array([0.48, -0.6, 0.64])
MANIFOLDS: dict[str, Manifold] = {
    'R^3': Euclidean(3), 'SO(3)': RotationGroup(), 'scaled': RotationGroup(scale=SCALE),
    'S^2': Sphere(AXIS), 'S^2 z': Sphere([0.0, 0.0, 1.0]),
    'product': Product(Sphere(AXIS), RotationGroup(scale=SCALE), Euclidean(2)),
}
FIRST = {name: m.factors[0] if isinstance(m, Product) else m for name, m in MANIFOLDS.items()}
in_manifolds = pytest.mark.parametrize('name', sorted(MANIFOLDS))


class Maps:
    """The maps of a manifold as numeric functions, one point a call or many as columns."""

    def __init__(self, manifold: Manifold) -> None:
        n, ambient = manifold.dimension, manifold.ambient
        xi, a, b = ca.SX.sym('xi', n), ca.SX.sym('a', ambient), ca.SX.sym('b', ambient)
        self.point = self._numeric([xi], manifold.point(xi))
        self.coordinates = self._numeric([a], manifold.coordinates(a))
        self.retract = self._numeric([a, xi], manifold.retract(a, xi))
        self.distance = self._numeric([a, b], manifold.distance(a, b))
        self.round_trip_slope = self._numeric(
            [xi], ca.jacobian(manifold.coordinates(manifold.point(xi)), xi))

    @staticmethod
    def _numeric(arguments: list[ca.SX], value: ca.SX) -> Callable[..., Array]:
        function = ca.Function('f', arguments, [value])

        def call(*points: Array) -> Array:
            if points[0].ndim == 1:
                return np.squeeze(np.array(function(*points)))
            mapped = function.map(len(points[0]))
            return np.squeeze(np.array(mapped(*(point.T for point in points))).T)
        return call


MAPS = {name: Maps(manifold) for name, manifold in MANIFOLDS.items()}


def draws(name: str) -> Array:
    """Return coordinates (k, n) whose factors are near 0, near the chart's end, and between."""
    parts = []
    for index, (dimension, radius) in enumerate(MANIFOLDS[name].chart_radii):
        rng, end = generator('manifold', name, index), min(radius, 5.0)
        lengths = np.concatenate([[0.0], OFFSETS_RAD, np.logspace(-4.1, -3.9, 41),
                                  np.linspace(1e-3, 0.999, 60) * end, end - OFFSETS_RAD / SCALE])
        lengths = rng.permutation(np.repeat(lengths, 6))
        v = rng.standard_normal((len(lengths), dimension))
        parts.append(lengths[:, None] * v / np.linalg.norm(v, axis=1, keepdims=True))
    return np.hstack(parts)


@in_manifolds
def test_the_chart_is_undone(name: str) -> None:
    """phi^-1 o phi = id and phi o phi^-1 = id, 4e-12 rad from 0 and from half a turn included.

    On S^2 the circle |xi| = pi is one point: beside it a point does not determine its side to
    more than its own rounding over its distance.
    """
    xi, maps = draws(name), MAPS[name]
    back = maps.coordinates(maps.point(xi))
    assert np.abs(maps.point(back) - maps.point(xi)).max() < 5e-15
    tolerance = np.full(len(xi), 2e-14 / SCALE)
    if isinstance(FIRST[name], Sphere):
        left = np.pi - np.linalg.norm(xi[:, :2], axis=1)
        assert np.abs(np.linalg.norm(back[:, :2], axis=1) + left - np.pi).max() < 5e-15
        tolerance = np.maximum(tolerance, 4e-15 / left)
    assert (np.abs(back - xi).max(axis=1) < tolerance).all()


@in_manifolds
def test_small_coordinates_keep_their_relative_accuracy(name: str) -> None:
    v = generator('small', name).standard_normal((40, MANIFOLDS[name].dimension))
    for size in np.logspace(-14, -2, 25):
        back = MAPS[name].coordinates(MAPS[name].point(size * v))
        sizes = np.linalg.norm(v, axis=1)
        tolerance = 1e-15 if name.startswith('S^2') or name == 'product' else 0.0
        assert (np.linalg.norm(back - size * v, axis=1)
                <= 1e-14 * size * sizes + 2 * tolerance).all()


@in_manifolds
def test_the_chart_starts_at_the_origin_and_ends_where_it_says(name: str) -> None:
    manifold, maps = MANIFOLDS[name], MAPS[name]
    zero = np.zeros(manifold.dimension)
    assert np.array_equal(maps.point(zero), manifold.origin)
    assert np.array_equal(maps.coordinates(manifold.origin), zero)
    assert sum(dimension for dimension, _ in manifold.chart_radii) == manifold.dimension
    start = 0
    for dimension, radius in manifold.chart_radii:
        if np.isfinite(radius):
            beyond = zero.copy()
            beyond[start] = 1.001 * radius
            assert np.abs(maps.coordinates(maps.point(beyond)) - beyond).max() > radius
        start += dimension


@in_manifolds
def test_the_round_trip_has_slope_one_at_the_origin_and_away_from_it(name: str) -> None:
    """By automatic differentiation through both maps: no branch divides 0 by 0."""
    eye = np.eye(MANIFOLDS[name].dimension)
    xi = draws(name)
    inside = np.ones(len(xi), dtype=bool)
    start = 0
    for dimension, radius in MANIFOLDS[name].chart_radii:
        part = np.linalg.norm(xi[:, start:start + dimension], axis=1)
        inside &= part < (0.9 * radius if np.isfinite(radius) else np.inf)
        start += dimension
    for one in [np.zeros(len(eye)), *xi[inside][::7]]:
        assert np.abs(MAPS[name].round_trip_slope(one) - eye).max() < 1e-9


@in_manifolds
def test_the_distance_is_a_metric(name: str) -> None:
    maps, xi = MAPS[name], draws(name)
    a, b, c = (maps.point(generator(name, k).permutation(xi)) for k in range(3))
    assert np.abs(maps.distance(a, a)).max() < 1e-7
    ab, ba, bc, ac = (maps.distance(*pair) for pair in ((a, b), (b, a), (b, c), (a, c)))
    assert np.abs(ab - ba).max() < 1e-12 / SCALE
    assert (ab >= 0).all()
    assert (ac <= ab + bc + 1e-12 / SCALE).all()


@in_manifolds
def test_coordinates_are_as_long_as_the_distance_to_the_origin(name: str) -> None:
    maps, xi = MAPS[name], draws(name)
    origin = np.tile(MANIFOLDS[name].origin, (len(xi), 1))
    lengths = maps.distance(origin, maps.point(xi))
    assert np.abs(lengths - np.linalg.norm(xi, axis=1)).max() < 2e-14 / SCALE


@in_manifolds
def test_the_retraction_moves_by_the_step_and_stays_on_the_manifold(name: str) -> None:
    """|step| is the distance moved, from any point, for steps of any length."""
    maps, xi = MAPS[name], draws(name)
    points = maps.point(xi)
    steps = generator('steps', name).permutation(xi)
    assert np.abs(maps.retract(points, 0 * steps) - points).max() < 1e-14 * 10
    for size in (1e-6, 1e-3, 0.5):
        moved = maps.retract(points, size * steps)
        length = size * np.linalg.norm(steps, axis=1)
        assert np.abs(maps.distance(points, moved) - length).max() < 1e-14 / SCALE * 10
    at_origin = maps.retract(np.tile(MANIFOLDS[name].origin, (len(xi), 1)), steps)
    assert np.abs(at_origin - maps.point(steps)).max() < 1e-14


def test_the_antipode_of_the_sphere_has_coordinates_of_length_pi() -> None:
    """Exactly there a rule picks the side; 1e-12 rad beside it the side is the nearer one."""
    manifold, maps = MANIFOLDS['S^2'], MAPS['S^2']
    exact = maps.coordinates(-manifold.origin)
    assert np.linalg.norm(exact) == np.pi
    assert np.abs(exact - [np.pi, 0.0]).max() < 1e-15
    basis = tangent_basis(AXIS)
    for offset in OFFSETS_RAD:
        for side in unit_vectors(generator('antipode', offset), 20)[:, :2]:
            side = side / np.linalg.norm(side)
            found = maps.coordinates(maps.point((np.pi - offset) * side))
            assert np.linalg.norm(found) == pytest.approx(np.pi - offset, abs=2e-15)
            # What is left of the side is the rounding of the point over the offset.
            assert np.linalg.norm(found / np.linalg.norm(found) - side) < 1e-15 / offset + 1e-14
    assert np.abs(maps.point(np.array([np.pi, 0.0])) + AXIS).max() < 1e-15
    assert np.abs(np.cross(basis[:, 0], basis[:, 1]) - AXIS).max() < 1e-15


def test_half_turns_have_rotation_vectors_of_length_pi() -> None:
    maps = MAPS['SO(3)']
    for axis in [*np.eye(3), *unit_vectors(generator('half turns'), 30)]:
        found = maps.coordinates(np.array([0.0, *axis]))
        assert np.abs(found - np.pi * axis).max() < 1e-15 * 5


def test_a_quaternion_and_its_negative_are_one_attitude() -> None:
    maps = MAPS['SO(3)']
    points = maps.point(rotation_vectors('uniform')[:200])
    assert np.array_equal(maps.coordinates(points), maps.coordinates(-points))
    assert np.abs(maps.distance(points, -points)).max() < 1e-7


@pytest.mark.parametrize('stratum', ['uniform', 'near_identity', 'near_half_turn'])
def test_so3_agrees_with_the_rotation_matrices(stratum: str) -> None:
    maps, vectors = MAPS['SO(3)'], rotation_vectors(stratum)[::5]
    points = maps.point(vectors)
    assert np.abs(so3.rotation_from_quaternion(points) - so3.exp(vectors)).max() < 1e-14
    assert np.abs(maps.coordinates(points) - so3.log(so3.exp(vectors))).max() < 1e-14
    following = maps.retract(points, vectors[::-1].copy())
    expected = so3.exp(vectors) @ so3.exp(vectors[::-1])
    assert np.abs(so3.rotation_from_quaternion(following) - expected).max() < 1e-14


@pytest.mark.parametrize('axis', [
    AXIS, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0], np.ones(3) / np.sqrt(3)])
def test_the_sphere_is_what_a_turned_body_sees(axis: Array) -> None:
    """Gamma = R^T b, and its coordinates are R's rotation vector when R does not roll."""
    axis = np.asarray(axis)
    basis, maps = tangent_basis(axis), Maps(Sphere(axis))
    assert np.abs(basis.T @ basis - np.eye(2)).max() < 1e-15
    assert np.abs(basis.T @ axis).max() < 1e-15
    assert np.linalg.det(np.column_stack([basis, axis])) == pytest.approx(1.0, abs=1e-14)
    x = draws('S^2')
    seen = np.einsum('nji,j->ni', so3.exp(x @ basis.T), axis)
    assert np.abs(maps.point(x) - seen).max() < 1e-15 * 4
    # A roll about b before the turn is seen as well; the sphere does not know about one after it.
    rolled = so3.exp(np.outer(np.linspace(-3, 3, len(x)), axis)) @ so3.exp(x @ basis.T)
    assert np.abs(np.einsum('nji,j->ni', rolled, axis) - seen).max() < 1e-15 * 4


def test_topology() -> None:
    """Only R^n is contractible; chi(S^2) = 2, chi of a product is the product's."""
    facts = {name: (m.euler_characteristic, m.contractible) for name, m in MANIFOLDS.items()}
    assert facts['R^3'] == (1, True)
    assert facts['SO(3)'] == (0, False)
    assert facts['S^2'] == (2, False)
    assert facts['product'] == (0, False)
    assert (MANIFOLDS['product'].dimension, MANIFOLDS['product'].ambient) == (7, 9)
    assert MANIFOLDS['product'].name == 'S^2 x SO(3) x R^2'
    both = Product(Sphere(AXIS), Euclidean(4))
    assert (both.euler_characteristic, both.contractible) == (2, False)
