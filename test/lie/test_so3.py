# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Maps on SO(3) against their definitions, in every stratum of `strategies`."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.stats
import strategies
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import Array

from manifold_mpc_ros.errors import ConfigurationError, ManifoldMpcError
from manifold_mpc_ros.lie import so3

STRATA = sorted(strategies.ROTATION_VECTORS)
EPS = float(np.finfo(np.float64).eps)
in_strata = pytest.mark.parametrize('stratum', STRATA)
replayable = settings(derandomize=True, deadline=None, max_examples=200)


def transpose(R: Array) -> Array:
    return np.swapaxes(R, -1, -2)


def largest(difference: Array) -> float:
    return float(np.max(np.abs(difference)))


def random_half_turn_axes() -> Array:
    return strategies.axes(strategies.generator('half turns'), 500)


def test_hat_is_the_cross_product_and_vee_its_inverse() -> None:
    rng = strategies.generator('hat')
    v, w = rng.standard_normal((2, 500, 3))
    assert largest((so3.hat(v) @ w[..., None])[..., 0] - np.cross(v, w)) < 1e-14
    assert np.array_equal(so3.vee(so3.hat(v)), v)


def test_vee_takes_the_skew_part_of_any_matrix() -> None:
    a = strategies.generator('vee').standard_normal((500, 3, 3))
    assert largest(so3.hat(so3.vee(a)) - 0.5 * (a - transpose(a))) == 0.0


@in_strata
def test_exp_is_the_matrix_exponential(stratum: str) -> None:
    phi = strategies.rotation_vectors(stratum)
    R = so3.exp(phi)
    assert largest(R - scipy.linalg.expm(so3.hat(phi))) < 8e-15
    assert so3.is_rotation(R, 4e-15)


def test_exp_of_more_than_one_turn_is_the_matrix_exponential() -> None:
    rng = strategies.generator('turns')
    phi = rng.uniform(np.pi, 30.0, size=(300, 1)) * strategies.unit_vectors(rng, 300)
    assert largest(so3.exp(phi) - scipy.linalg.expm(so3.hat(phi))) < 1e-12


@in_strata
def test_log_inverts_exp(stratum: str) -> None:
    phi = strategies.rotation_vectors(stratum)
    assert largest(so3.log(so3.exp(phi)) - phi) < 4e-15
    assert largest(so3.exp(so3.log(so3.exp(phi))) - so3.exp(phi)) < 4e-15


def test_log_is_relatively_accurate_down_to_the_smallest_angles() -> None:
    phi = strategies.rotation_vectors('near_identity')
    tiny = np.concatenate([phi, 1e-150 * phi, 1e-300 * phi])
    error = np.linalg.norm(so3.log(so3.exp(tiny)) - tiny, axis=-1)
    size = np.max(np.abs(tiny), axis=-1)
    assert np.all(error <= 2 * EPS * size + 1e-322)
    assert np.array_equal(so3.log(np.eye(3)), np.zeros(3))


@pytest.mark.parametrize('stratum', [*STRATA, 'half_turn'])
def test_log_is_never_longer_than_pi(stratum: str) -> None:
    if stratum == 'half_turn':
        R = strategies.half_turns(random_half_turn_axes())
    else:
        R = so3.exp(strategies.rotation_vectors(stratum))
    assert np.all(np.linalg.norm(so3.log(R), axis=-1) <= np.pi * (1.0 + 2 * EPS))


def test_log_of_a_half_turn_has_length_pi_and_the_axis_of_the_rule() -> None:
    axis = random_half_turn_axes()
    phi = so3.log(strategies.half_turns(axis))
    assert largest(np.linalg.norm(phi, axis=-1) - np.pi) < 4 * EPS
    sign = np.sign(np.sum(phi * axis, axis=-1, keepdims=True))
    assert largest(phi - np.pi * sign * axis) < 4e-15
    first = np.array([one[np.abs(one) > 1e-9][0] for one in phi])
    assert np.all(first > 0.0)
    assert np.any(sign < 0.0)
    assert np.any(sign > 0.0)


def test_log_of_a_half_turn_has_one_side_whatever_the_rounding() -> None:
    """The relative attitude of two rotations 180 degrees apart is off by rounding: same side."""
    axis = random_half_turn_axes()
    expected = so3.log(strategies.half_turns(axis))
    R_ND = so3.random_rotations(strategies.generator('R_ND'), len(axis))
    R_NB = R_ND @ strategies.half_turns(axis)
    error = so3.attitude_error_B(R_ND, R_NB)
    assert not np.array_equal(error, strategies.half_turns(axis))
    assert largest(so3.log(error) - expected) < 1e-14


@pytest.mark.parametrize('stratum', [*STRATA, 'half_turn'])
def test_quaternion_is_the_one_of_the_half_angle(stratum: str) -> None:
    if stratum == 'half_turn':
        phi = so3.log(strategies.half_turns(random_half_turn_axes()))
    else:
        phi = strategies.rotation_vectors(stratum)
    theta = np.linalg.norm(phi, axis=-1, keepdims=True)
    expected = np.concatenate([np.cos(theta / 2), np.sin(theta / 2) * phi / theta], axis=-1)
    q = so3.quaternion_from_rotation(so3.exp(phi))
    assert np.all(q[..., 0] >= 0.0)
    assert largest(np.linalg.norm(q, axis=-1) - 1.0) < 4 * EPS
    assert largest(q - expected) < 2e-15
    assert largest(so3.rotation_from_quaternion(q) - so3.exp(phi)) < 4e-15


def test_both_quaternions_of_a_rotation_give_the_same_bits() -> None:
    rng = strategies.generator('q')
    q = np.concatenate([rng.standard_normal((2000, 4)), np.eye(4), 1e-200 * np.eye(4)])
    assert so3.rotation_from_quaternion(q).tobytes() == so3.rotation_from_quaternion(-q).tobytes()


def test_quaternion_of_any_length_is_normalised() -> None:
    q = strategies.generator('length').standard_normal((500, 4))
    R = so3.rotation_from_quaternion(q)
    for scale in (1e-300, 1e-9, 3.0, 1e300):
        assert largest(so3.rotation_from_quaternion(scale * q) - R) < 4e-15
    assert so3.is_rotation(R, 4e-15)


def test_one_quaternion_has_the_bits_of_many() -> None:
    rng = strategies.generator('one')
    q = np.concatenate([rng.standard_normal((2000, 4)), np.eye(4), -np.eye(4),
                        1e-200 * np.eye(4), rng.integers(-1, 2, (200, 4)) + 0.25 * np.eye(4)[0]])
    many = so3.rotation_from_quaternion(q)
    for one, R in zip(q, many):
        assert so3.rotation_from_quaternion(one).tobytes() == R.tobytes()
        assert so3.rotation_from_quaternion(one.tolist()).tobytes() == R.tobytes()


@pytest.mark.parametrize('bad', [0.0, np.nan, np.inf])
def test_quaternion_that_is_zero_or_not_finite_is_refused(bad: float) -> None:
    with pytest.raises(ConfigurationError, match='q_wxyz'):
        so3.rotation_from_quaternion([[1.0, 0.0, 0.0, 0.0], [bad, 0.0, 0.0, 0.0]])
    with pytest.raises(ConfigurationError, match='q_wxyz'):
        so3.rotation_from_quaternion([0.0, 0.0, bad, 0.0])


@pytest.mark.parametrize('stratum', STRATA)
def test_angle_is_the_length_of_the_rotation_vector(stratum: str) -> None:
    phi = strategies.rotation_vectors(stratum)
    theta = np.linalg.norm(phi, axis=-1)
    assert np.all(np.abs(so3.angle(so3.exp(phi)) - theta) <= 2e-15 * np.minimum(theta, 1.0))


def test_angle_of_identity_and_half_turn_are_exact() -> None:
    assert so3.angle(np.eye(3)) == 0.0
    assert np.all(so3.angle(strategies.half_turns(random_half_turn_axes())) == np.pi)


def test_cayley_is_its_definition_and_turns_by_twice_the_arctangent() -> None:
    rng = strategies.generator('cayley')
    c = np.concatenate([x * strategies.axes(rng, 20) for x in (1e-12, 1e-3, 0.5, 1.0, 30.0, 1e6)])
    R = so3.cayley(c)
    moderate = np.linalg.norm(c, axis=-1) < 10.0
    definition = (np.eye(3) + so3.hat(c)) @ np.linalg.inv(np.eye(3) - so3.hat(c))
    assert largest((R - definition)[moderate]) < 4e-15
    assert so3.is_rotation(R, 4e-15)
    size = np.linalg.norm(c, axis=-1, keepdims=True)
    assert largest(R - so3.exp(2.0 * np.arctan(size) * c / size)) < 4e-15


@in_strata
def test_cayley_inverse_inverts_cayley(stratum: str) -> None:
    R = so3.exp(strategies.rotation_vectors(stratum))
    assert largest(so3.cayley(so3.cayley_inverse(R)) - R) < 6e-15


def test_cayley_inverse_refuses_half_turns_and_counts_them() -> None:
    R = np.stack([np.eye(3), np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, -1.0, 1.0])])
    with pytest.raises(ManifoldMpcError, match='2 of 3 rotations'):
        so3.cayley_inverse(R)


@in_strata
def test_attitude_error_maps_body_to_desired_frame(stratum: str) -> None:
    phi = strategies.rotation_vectors(stratum)
    R_ND = so3.random_rotations(strategies.generator('error', stratum), len(phi))
    R_NB = R_ND @ so3.exp(phi)
    assert largest(so3.attitude_error_B(R_ND, R_NB) - so3.exp(phi)) < 4e-15


def test_random_rotations_are_uniform() -> None:
    R = so3.random_rotations(np.random.default_rng(7), 20000)
    assert so3.is_rotation(R, 4e-15)
    assert largest(np.mean(R, axis=0)) < 5.0 / np.sqrt(3.0 * 20000)
    result = scipy.stats.kstest(so3.angle(R), lambda t: (t - np.sin(t)) / np.pi)
    assert result.pvalue > 0.01
    assert np.array_equal(R, so3.random_rotations(np.random.default_rng(7), 20000))


@in_strata
def test_project_returns_the_rotation_of_a_polar_product(stratum: str) -> None:
    R = so3.exp(strategies.rotation_vectors(stratum))
    rng = strategies.generator('project', stratum)
    Q = so3.random_rotations(rng, len(R))
    stretch = (Q * rng.uniform(0.5, 2.0, size=(len(R), 1, 3))) @ transpose(Q)
    assert largest(so3.project(R @ stretch) - R) < 1e-14


def test_project_of_a_reflection_is_the_nearest_rotation() -> None:
    rng = strategies.generator('reflection')
    matrix = rng.standard_normal((200, 3, 3))
    matrix[np.linalg.det(matrix) > 0.0] *= -1.0
    nearest = so3.project(matrix)
    assert so3.is_rotation(nearest, 4e-15)
    distance = np.linalg.norm(nearest - matrix, axis=(-1, -2))
    for other in so3.random_rotations(rng, 200):
        assert np.all(distance <= np.linalg.norm(other - matrix, axis=(-1, -2)))


def test_is_rotation_refuses_what_is_not() -> None:
    R = so3.random_rotations(strategies.generator('is'), 5)
    assert so3.is_rotation(R)
    for spoiled in (-R[0], 1.001 * R[0], R[0] + 1e-8, np.full((3, 3), np.nan), np.zeros((3, 3))):
        assert not so3.is_rotation(spoiled)
        assert not so3.is_rotation(np.concatenate([R, spoiled[None]]))
    assert so3.is_rotation(R[0] + 1e-8, 1e-6)


@pytest.mark.parametrize('name', [
    'hat', 'exp', 'left_jacobian', 'right_jacobian', 'left_jacobian_inverse',
    'right_jacobian_inverse', 'cayley', 'log', 'angle', 'vee', 'quaternion_from_rotation',
    'cayley_inverse', 'project',
])
def test_every_map_keeps_leading_dimensions_and_gives_each_item_its_own_bits(name: str) -> None:
    function = getattr(so3, name)
    phi = strategies.rotation_vectors('uniform')[:30]
    vector_maps = ('hat', 'exp', 'cayley')
    items = phi if 'jacobian' in name or name in vector_maps else so3.exp(phi)
    batch = function(items.reshape(2, 3, 5, *items.shape[1:]))
    single = np.array([function(item) for item in items])
    assert batch.shape == (2, 3, 5, *single.shape[1:])
    assert np.array_equal(batch.reshape(single.shape), single)
    assert function(items[:0]).shape == (0, *single.shape[1:])


@replayable
@given(strategies.drawn_rotation_vectors(), strategies.drawn_rotation_vectors())
def test_rotation_carries_the_cross_product(phi: Array, v: Array) -> None:
    R = so3.exp(phi)
    assert largest(so3.hat(R @ v) - R @ so3.hat(v) @ R.T) < 8e-15


@replayable
@given(strategies.drawn_rotation_vectors(), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_turns_about_one_axis_add(phi: Array, s: float, t: float) -> None:
    assert largest(so3.exp(s * phi) @ so3.exp(t * phi) - so3.exp((s + t) * phi)) < 8e-15


@replayable
@given(strategies.drawn_rotation_vectors(), strategies.drawn_rotation_vectors())
def test_log_turns_with_its_rotation(phi: Array, psi: Array) -> None:
    """Log(Q R Q^T) = Q Log(R) and Log(R^T) = -Log(R), for angles below 180 degrees."""
    Q, R = so3.exp(psi), so3.exp(phi)
    assert largest(so3.log(Q @ R @ Q.T) - Q @ phi) < 2e-14
    assert largest(so3.log(R.T) + phi) < 4e-15
