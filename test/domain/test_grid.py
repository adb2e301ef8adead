# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The grids are uniform, and no point is farther from them than they say."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from strategies import generator, unit_vectors

from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.domain import rotation_grid
from manifold_mpc_ros.lie import so3

SIZES = (50, 500, 2000)


@pytest.mark.parametrize('n', SIZES)
def test_attitudes_have_the_moments_of_the_haar_measure(n: int) -> None:
    """E[R] = 0 and E[R_ij R_kl] = delta_ik delta_jl / 3 up to 2/n; random draws: 1/sqrt(n)."""
    R = rotation_grid.attitudes(n)
    assert R.shape == (n, 3, 3)
    assert so3.is_rotation(R, 1e-14)
    eye = np.eye(3)
    second = np.einsum('nij,nkl->ijkl', R, R) / n - np.einsum('ik,jl->ijkl', eye, eye) / 3
    assert np.abs(R.mean(axis=0)).max() < 2.0 / n
    assert np.abs(second).max() < 2.0 / n


@pytest.mark.parametrize('n', SIZES[1:])
def test_angles_of_attitudes_have_their_distribution(n: int) -> None:
    """The part of SO(3) within an angle t of any attitude is (t - sin t) / pi."""
    for centre in so3.random_rotations(generator('centres'), 5):
        angles = np.sort(so3.angle(centre.T @ rotation_grid.attitudes(n)))
        within = (angles - np.sin(angles)) / np.pi
        assert np.abs(within - (np.arange(n) + 0.5) / n).max() < 0.6 / np.sqrt(n)


@pytest.mark.parametrize('n', SIZES)
def test_directions_have_the_moments_of_the_sphere(n: int) -> None:
    u = rotation_grid.directions(n)
    assert np.abs(np.linalg.norm(u, axis=1) - 1).max() < 1e-15
    assert np.abs(u.mean(axis=0)).max() < 2.0 / n
    assert np.abs(u.T @ u / n - np.eye(3) / 3).max() < 2.0 / n
    assert np.abs((u ** 4).mean(axis=0) - 1 / 5).max() < 4.0 / n


@pytest.mark.parametrize('n', SIZES[1:])
def test_points_in_the_ball_are_uniform(n: int) -> None:
    x = rotation_grid.ball(n)
    radius = np.linalg.norm(x, axis=1)
    assert radius.max() < 1.0
    assert np.abs(x.mean(axis=0)).max() < 0.1 / np.sqrt(n)
    assert np.abs(x.T @ x / n - np.eye(3) / 5).max() < 0.3 / np.sqrt(n)
    for part in (0.25, 0.5, 0.75):
        assert abs(np.mean(radius <= part) - part ** 3) < 0.5 / np.sqrt(n)


def test_covering_angles_that_are_known() -> None:
    """Cross-polytopes: arccos(1/sqrt(d)). The 12 turns of a tetrahedron: 90 degrees."""
    for d in (3, 4):
        points = np.concatenate([np.eye(d), -np.eye(d)])
        assert np.isclose(
            rotation_grid.covering_angle(points), np.arccos(1 / np.sqrt(d)), atol=1e-12)
    halves = np.array(list(itertools.product((-0.5, 0.5), repeat=4)))
    tetrahedron = so3.rotation_from_quaternion(np.concatenate([np.eye(4), halves[8:]]))
    assert np.isclose(rotation_grid.covering_radius(tetrahedron), np.pi / 2, atol=1e-7)


@pytest.mark.parametrize('n', SIZES)
def test_no_attitude_is_farther_than_the_covering_radius(n: int) -> None:
    R = rotation_grid.attitudes(n)
    q = so3.quaternion_from_rotation(R)
    drawn = unit_vectors_4(5000)
    nearest = 2 * np.arccos(np.clip(np.abs(drawn @ q.T).max(axis=1), 0, 1))
    radius = rotation_grid.covering_radius(R)
    assert 0.8 * radius < nearest.max() <= radius + 1e-9
    # A ball of this radius has at least 1/n of the volume, and not twenty times as much.
    assert 1 < n * (radius - np.sin(radius)) / np.pi < 20


@pytest.mark.parametrize('n', SIZES)
def test_no_direction_is_farther_than_the_covering_angle(n: int) -> None:
    u = rotation_grid.directions(n)
    drawn = unit_vectors(generator('directions'), 5000)
    nearest = np.arccos(np.clip((drawn @ u.T).max(axis=1), -1, 1))
    angle = rotation_grid.covering_angle(u)
    assert 0.8 * angle < nearest.max() <= angle + 1e-9
    assert 1 < n * (1 - np.cos(angle)) / 2 < 3


def test_the_same_number_gives_the_same_points() -> None:
    for points in (rotation_grid.attitudes, rotation_grid.directions, rotation_grid.ball):
        assert np.array_equal(points(77), points(77))


def test_numbers_that_make_no_grid_are_refused() -> None:
    for points in (rotation_grid.attitudes, rotation_grid.directions, rotation_grid.ball):
        with pytest.raises(ConfigurationError, match='n: 0 is not valid'):
            points(0)
    with pytest.raises(ConfigurationError, match='more than 3'):
        rotation_grid.covering_angle(np.eye(3))
    cap = rotation_grid.directions(50)[:20]
    with pytest.raises(ConfigurationError, match='around the centre'):
        rotation_grid.covering_angle(cap)


def unit_vectors_4(n: int) -> np.ndarray:
    """Return n quaternions, uniform on S^3."""
    q = generator('quaternions').standard_normal((n, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)
