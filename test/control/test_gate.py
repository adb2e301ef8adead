# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the gate admits and refuses; no ROS needed."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from manifold_mpc_ros.control.input_gate import (
    RawState,
    Reason,
    Refusal,
    StateGate,
    StateSample,
    admit_direction,
    admit_in_body,
    admit_setpoint,
)
from manifold_mpc_ros.lie import so3

STEP_S = 0.5
TIMEOUT_S = 2.5
NOW_NS = 100 * 10**9
GOOD = RawState(NOW_NS, 'inertial', 'base_link', (0.5, 0.5, 0.5, 0.5), (0.1, -0.2, 0.3))


def gate(*, timed: bool = True) -> StateGate:
    return StateGate('inertial', 'base_link', step_s=STEP_S, timeout_s=TIMEOUT_S, timed=timed)


def ns(seconds: float) -> int:
    return round(seconds * 1e9)


def at(seconds: float) -> RawState:
    return dataclasses.replace(GOOD, stamp_ns=ns(seconds))


def test_a_good_state_becomes_a_rotation_and_a_rate() -> None:
    sample = gate().admit(GOOD, NOW_NS)
    assert isinstance(sample, StateSample)
    assert sample.stamp_ns == NOW_NS
    # x to y to z to x
    np.testing.assert_allclose(
        sample.R_NB, [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], atol=1e-15)
    np.testing.assert_array_equal(sample.omega_BN_B, GOOD.omega_BN_B)


@pytest.mark.parametrize(('change', 'reason'), [
    ({'quaternion_xyzw': (math.nan, 0.0, 0.0, 1.0)}, Reason.NON_FINITE),
    ({'quaternion_xyzw': (0.0, 0.0, 0.0, -math.inf)}, Reason.NON_FINITE),
    ({'omega_BN_B': (0.0, math.inf, 0.0)}, Reason.NON_FINITE),
    ({'omega_BN_B': (0.0, 0.0, math.nan)}, Reason.NON_FINITE),
    ({'quaternion_xyzw': (0.0, 0.0, 0.0, 0.0)}, Reason.QUATERNION_NORM),
    ({'quaternion_xyzw': (0.0, 0.0, 0.0, 1.011)}, Reason.QUATERNION_NORM),
    ({'quaternion_xyzw': (1e200, 1e200, 1e200, 1e200)}, Reason.QUATERNION_NORM),
    ({'inertial_frame_id': ''}, Reason.WRONG_FRAME),
    ({'inertial_frame_id': 'Inertial'}, Reason.WRONG_FRAME),
    ({'body_frame_id': 'imu_link'}, Reason.WRONG_FRAME),
    ({'has_attitude': False}, Reason.NO_ATTITUDE),
    ({'has_rate': False}, Reason.NO_RATE),
    ({'stamp_ns': 0}, Reason.INVALID_STAMP),
    ({'stamp_ns': -1}, Reason.INVALID_STAMP),
    ({'stamp_ns': NOW_NS + ns(STEP_S / 2) + 1}, Reason.FUTURE),
    ({'stamp_ns': NOW_NS - ns(TIMEOUT_S) - 1}, Reason.STALE),
])
def test_refusals(change: dict[str, Any], reason: Reason) -> None:
    door = gate()
    refusal = door.admit(dataclasses.replace(GOOD, **change), NOW_NS)
    assert isinstance(refusal, Refusal)
    assert refusal.reason is reason
    assert refusal.detail
    assert isinstance(door.admit(GOOD, NOW_NS), StateSample)  # a refused one leaves no trace


@pytest.mark.parametrize('change', [
    {'quaternion_xyzw': (0.0, 0.0, 0.0, 1.009)},
    {'inertial_frame_id': None},
    {'stamp_ns': NOW_NS + ns(STEP_S / 2)},
    {'stamp_ns': NOW_NS - ns(TIMEOUT_S)},
])
def test_just_inside(change: dict[str, Any]) -> None:
    sample = gate().admit(dataclasses.replace(GOOD, **change), NOW_NS)
    assert isinstance(sample, StateSample)
    assert so3.is_rotation(sample.R_NB, 1e-14)


def test_both_signs_of_a_quaternion_are_the_same_bits() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        q = rng.standard_normal(4)
        q /= np.linalg.norm(q)
        samples = [gate().admit(dataclasses.replace(GOOD, quaternion_xyzw=tuple(s * q)), NOW_NS)
                   for s in (1.0, -1.0)]
        assert all(isinstance(sample, StateSample) for sample in samples)
        assert samples[0].R_NB.tobytes() == samples[1].R_NB.tobytes()


def test_order_of_stamps_in_real_time() -> None:
    door = gate()
    assert isinstance(door.admit(at(99.0), NOW_NS), StateSample)
    assert door.admit(at(99.0), NOW_NS).reason is Reason.DUPLICATE
    assert door.admit(at(98.5), NOW_NS).reason is Reason.OUT_OF_ORDER
    assert isinstance(door.admit(at(99.5), NOW_NS), StateSample)
    assert not door.restarted
    # time itself went back: a new start
    assert isinstance(door.admit(at(10.0), ns(10.0)), StateSample)
    assert door.restarted
    assert isinstance(door.admit(at(10.1), ns(10.1)), StateSample)
    assert not door.restarted


def test_lockstep_follows_the_stamps_alone() -> None:
    door = gate(timed=False)
    assert isinstance(door.admit(at(7.0), NOW_NS), StateSample)
    assert isinstance(door.admit(at(900.0), NOW_NS), StateSample)
    assert door.admit(at(900.0), NOW_NS).reason is Reason.DUPLICATE
    assert isinstance(door.admit(at(899.5), NOW_NS), StateSample)
    assert door.restarted


@pytest.mark.parametrize(('stamp_s', 'said'), [
    (100.5, 'the stamp is 0.500 s ahead'), (97.0, 'the stamp is 3.000 s old')])
def test_a_refused_stamp_is_said_in_seconds(stamp_s: float, said: str) -> None:
    refusal = gate().admit(at(stamp_s), NOW_NS)
    assert isinstance(refusal, Refusal)
    assert refusal.detail == said


@pytest.mark.parametrize(('stamp_s', 'now_s'), [(1.8e9, 100.0), (100.0, 1.8e9)])
def test_stamps_of_another_clock_are_named(stamp_s: float, now_s: float) -> None:
    refusal = gate().admit(at(stamp_s), ns(now_s))
    assert isinstance(refusal, Refusal)
    assert 'by another clock than the one here: see use_sim_time of both' in refusal.detail


@pytest.mark.parametrize(('age_s', 'another'), [(86400.0, False), (86400.5, True)])
def test_a_stamp_of_a_day_ago_is_of_this_clock(age_s: float, another: bool) -> None:
    refusal = gate().admit(at(100.0), ns(100.0 + age_s))
    assert isinstance(refusal, Refusal)
    assert ('another clock' in refusal.detail) == another


def test_the_first_stamp_of_all_and_time_that_steps_back_by_the_timeout() -> None:
    first = dataclasses.replace(GOOD, stamp_ns=1)
    assert isinstance(gate(timed=False).admit(first, 0), StateSample)
    door = gate()
    assert not door.restarted
    assert isinstance(door.admit(at(100.0), ns(100.0)), StateSample)
    assert not door.restarted
    back = door.admit(at(97.5), ns(97.5))  # by no more than the timeout
    assert isinstance(back, Refusal)
    assert back.reason is Reason.OUT_OF_ORDER
    assert isinstance(door.admit(at(97.4), ns(97.4)), StateSample)
    assert door.restarted
    door.forget()
    assert not door.restarted


def test_forgetting_the_order() -> None:
    door = gate()
    door.admit(GOOD, NOW_NS)
    door.forget()
    assert isinstance(door.admit(GOOD, NOW_NS), StateSample)


def test_setpoints_and_torques() -> None:
    R_ND = admit_setpoint('inertial', (0.0, 0.0, 1.0, 0.0), 'inertial')
    np.testing.assert_array_equal(R_ND, np.diag([-1.0, -1.0, 1.0]))
    for frame, q, reason in [
        ('', (0.0, 0.0, 0.0, 1.0), Reason.WRONG_FRAME),
        ('inertial', (0.0, 0.0, 0.0, math.nan), Reason.NON_FINITE),
        ('inertial', (0.0, 0.0, 0.0, 0.5), Reason.QUATERNION_NORM),
    ]:
        assert admit_setpoint(frame, q, 'inertial').reason is reason
    np.testing.assert_array_equal(
        admit_in_body('base_link', (1.0, 2.0, 3.0), 'base_link'), [1.0, 2.0, 3.0])
    assert admit_in_body('map', (1.0, 2.0, 3.0), 'base_link').reason is Reason.WRONG_FRAME
    assert admit_in_body('base_link', (1.0, math.nan, 3.0), 'base_link').reason is (
        Reason.NON_FINITE)


@pytest.mark.parametrize('size', [5e-324, 1e-200, 1.0, 1e200, 1.7e308])
def test_a_direction_of_any_length_becomes_a_unit_vector(size: float) -> None:
    found = admit_direction('inertial', (0.0, -size, size), 'inertial')
    np.testing.assert_allclose(found, np.array([0.0, -1.0, 1.0]) / math.sqrt(2.0), rtol=1e-15)


@pytest.mark.parametrize(('frame', 'vector', 'reason'), [
    ('map', (1.0, 0.0, 0.0), Reason.WRONG_FRAME),
    ('inertial', (0.0, 0.0, 0.0), Reason.ZERO_DIRECTION),
    ('inertial', (0.0, -0.0, 0.0), Reason.ZERO_DIRECTION),
    ('inertial', (math.nan, 0.0, 1.0), Reason.NON_FINITE),
    ('inertial', (math.inf, 0.0, 1.0), Reason.NON_FINITE),
])
def test_what_is_no_direction_is_refused(
    frame: str, vector: tuple[float, float, float], reason: Reason,
) -> None:
    found = admit_direction(frame, vector, 'inertial')
    assert isinstance(found, Refusal)
    assert found.reason is reason
