# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Conventions: read and said again they give the same state; each means what its name says."""

from __future__ import annotations

import math
import random
import struct
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import PROPERTY
from strategies import ROTATION_VECTORS, rotation_vectors

from manifold_mpc_ros.config import conventions as to
from manifold_mpc_ros.control.described import conversions
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

ROUNDING = 1e-15
#: Attitudes of every stratum, near 0 and near 180 degrees among them.
ATTITUDES = np.concatenate([
    so3.quaternion_from_rotation(so3.exp(rotation_vectors(name)[::20]))
    for name in sorted(ROTATION_VECTORS)])
AXES = {kind: [to.axes_of('axes', value, named) for value in (
            *named, *so3.rotation_from_quaternion(ATTITUDES[3::97]).reshape(-1, 9).tolist())]
        for kind, named in (('body', to.BODY_AXES), ('world', to.WORLD_AXES))}


@dataclass(frozen=True)
class Case:
    """A state, or what a stack says of one, and conventions; from one number, which is quick."""

    q_wxyz: Array
    omega: to.Vector
    attitude: to.AttitudeConvention
    rate: to.RateConvention

    @classmethod
    def of(cls, seed: int) -> Case:
        draw = random.Random(seed)
        world, body = draw.choice(AXES['world']), draw.choice(AXES['body'])
        return cls(
            draw.choice([1.0, -1.0]) * ATTITUDES[draw.randrange(len(ATTITUDES))],
            (draw.uniform(-0.5, 0.5), draw.uniform(-0.5, 0.5), draw.choice([0.0, 0.5])),
            to.AttitudeConvention(
                draw.choice([*to.FORMS]), draw.choice(to.DIRECTIONS), world, body),
            to.RateConvention(
                draw.choice(to.RATE_AXES), draw.choice([*to.RATE_UNITS]), world, body))


def turned(axes: to.Axes | None) -> to.Axes | None:
    """Return the rotation from our axes to those of the stack."""
    if axes is None:
        return None
    w, x, y, z = axes.q_wxyz
    return to.Axes(axes.R.T, (w, -x, -y, -z))


def inverse(convention: to.AttitudeConvention) -> to.AttitudeConvention:
    """Return the description of the stack's attitudes to somebody who has our axes."""
    return to.AttitudeConvention(world=turned(convention.world), body=turned(convention.body))


def said_as(convention: to.AttitudeConvention, q_WM_wxyz: Array) -> tuple[float, ...]:
    """Return the components by which a stack says an attitude of its own."""
    w, x, y, z = q_WM_wxyz.tolist()
    if convention.direction == 'world_to_body':
        x, y, z = -x, -y, -z
    sign = math.copysign(1.0, w)
    return {
        'quaternion_xyzw': (x, y, z, w), 'quaternion_wxyz': (w, x, y, z),
        'mrp': tuple(part / (sign + w) for part in (x, y, z)),
        'matrix': tuple(so3.rotation_from_quaternion((w, x, y, z)).ravel().tolist()),
    }[convention.form]


cases = st.integers(0, 2**63).map(Case.of)


@PROPERTY
@given(case=cases)
def test_a_description_and_its_inverse_give_the_same_state(case: Case) -> None:
    """What the stack says, as our state, and by the inverse description as the stack's again."""
    w, x, y, z = case.q_wxyz.tolist()
    q_NB = conversions.read_attitude(case.attitude, said_as(case.attitude, case.q_wxyz))
    back = conversions.read_attitude(inverse(case.attitude), q_NB)
    sign = math.copysign(1.0, np.dot(back, (x, y, z, w)))  # q and -q are one attitude
    assert np.abs(sign * np.array(back) - (x, y, z, w)).max() <= ROUNDING, case
    unit = to.RATE_UNITS[case.rate.unit]
    if case.rate.axes == 'body':
        omega_B = conversions.read_rate(case.rate, tuple(part / unit for part in case.omega), q_NB)
        again = conversions.read_rate(
            to.RateConvention(body=turned(case.rate.body)), omega_B, q_NB)
    else:
        omega_N = conversions.to_ours(case.rate.world, case.omega)
        omega_B = conversions.read_rate(case.rate, tuple(part / unit for part in case.omega), q_NB)
        there = conversions.read_rate(
            to.RateConvention('world'), omega_B, (-q_NB[0], -q_NB[1], -q_NB[2], q_NB[3]))
        again = conversions.to_theirs(case.rate.world, there)
        assert np.abs(np.array(there) - omega_N).max() <= ROUNDING, case
    assert np.abs(np.array(again) - case.omega).max() <= ROUNDING, case


@PROPERTY
@given(case=cases)
def test_what_a_stack_says_is_read_as_matrices_say(case: Case) -> None:
    """R_NB = R_NW R_WM R_BM^T, and the rate is that of the body whatever axes it is given in."""
    R_WM, omega_M = so3.rotation_from_quaternion(case.q_wxyz), np.array(case.omega)
    said = R_WM if case.attitude.direction == 'body_to_world' else R_WM.T
    w, x, y, z = so3.quaternion_from_rotation(said).tolist()
    vector = so3.log(said)
    values = {
        'quaternion_xyzw': (x, y, z, w), 'quaternion_wxyz': (-w, -x, -y, -z),
        'mrp': vector * math.tan(np.linalg.norm(vector) / 4.0) / max(
            np.linalg.norm(vector), 1e-300),
        'matrix': said.ravel()}[case.attitude.form]
    R_NW, R_BM = (np.eye(3) if axes is None else axes.R for axes in (
        case.attitude.world, case.attitude.body))
    q_NB = conversions.read_attitude(case.attitude, tuple(map(float, values)))
    R_NB = so3.rotation_from_quaternion([q_NB[3], *q_NB[:3]])
    assert np.abs(R_NB - R_NW @ R_WM @ R_BM.T).max() <= 1e-14, case
    rate = R_WM @ omega_M if case.rate.axes == 'world' else omega_M
    unit = 180.0 / math.pi if case.rate.unit == 'deg/s' else 1.0
    omega_B = conversions.read_rate(case.rate, tuple((unit * rate).tolist()), q_NB)
    assert np.abs(omega_B - R_BM @ omega_M).max() <= 1e-14, case


@PROPERTY
@given(case=cases)
def test_a_state_that_is_written_is_read_again(case: Case) -> None:
    """Of any convention; an attitude in another convention is the same one."""
    w, x, y, z = case.q_wxyz.tolist()
    values = conversions.write_attitude(case.attitude, (x, y, z, w))
    assert len(values) == len(case.attitude.names)
    back = conversions.read_attitude(case.attitude, values)
    sign = math.copysign(1.0, np.dot(back, (x, y, z, w)))
    assert np.abs(sign * np.array(back) - (x, y, z, w)).max() <= ROUNDING, case
    said = conversions.write_rate(case.rate, case.omega, (x, y, z, w))
    again = conversions.read_rate(case.rate, said, (x, y, z, w))
    assert np.abs(np.array(again) - case.omega).max() <= ROUNDING, case


def test_named_axes_are_those_of_the_field() -> None:
    """A vehicle in NED and FRD that heads north, level, heads north in ENU and FLU too."""
    ned, frd = (to.axes_of('axes', name, named) for name, named in (
        ('NED', to.WORLD_AXES), ('FRD', to.BODY_AXES)))
    q_NB = conversions.read_attitude(
        to.AttitudeConvention('quaternion_wxyz', world=ned, body=frd), (1.0, 0.0, 0.0, 0.0))
    R_NB = so3.rotation_from_quaternion([q_NB[3], *q_NB[:3]])
    np.testing.assert_allclose(R_NB @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=ROUNDING)  # north
    np.testing.assert_allclose(R_NB @ [0.0, 0.0, 1.0], [0.0, 0.0, 1.0], atol=ROUNDING)  # up
    yaw_right = conversions.read_rate(to.RateConvention(body=frd), (0.0, 0.0, 0.1), q_NB)
    assert yaw_right == (0.0, 0.0, -0.1)


def test_the_plain_convention_leaves_every_bit() -> None:
    for q in ((0.1, -0.2, 0.3, 0.4), (-0.0, 5e-324, math.inf, 1.0)):
        read = conversions.read_attitude(to.AttitudeConvention(), q)
        assert struct.pack('4d', *read) == struct.pack('4d', *q)


@pytest.mark.parametrize('matrix', [
    [2.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], [-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]])
def test_a_matrix_that_is_no_rotation_is_refused(matrix: list[float]) -> None:
    with pytest.raises(ValueError, match='not a rotation'):
        conversions.read_attitude(to.AttitudeConvention('matrix'), matrix)
    with pytest.raises(ConfigurationError, match='9 numbers of a rotation matrix'):
        to.axes_of('body_axes', matrix, to.BODY_AXES)
