# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Properties of the gate at the door, of who publishes, and of when ticks come; no ROS needed."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import (
    PROPERTY,
    any_text,
    any_vector,
    is_rotation_matrix,
    quaternions,
)

from manifold_mpc_ros.control.input_gate import (
    RawState,
    Refusal,
    StateGate,
    StateSample,
    admit_direction,
    admit_in_body,
    admit_setpoint,
)
from manifold_mpc_ros.nodes.controller.tick_timing import AnswerTiming, TickTiming, arrival_s
from manifold_mpc_ros.nodes.publisher_watch import PublisherWatch

SECOND = 10**9
#: Of a number of seconds since the machine's start, and of one that is taken off.
ROUNDING_S = 1e-6
stamps = st.integers(-2**31 * SECOND, 2**31 * SECOND) | st.integers(9 * SECOND, 13 * SECOND)
raw_states = st.builds(
    RawState, stamps, st.none() | any_text, any_text, quaternions(), any_vector,
    has_attitude=st.booleans(), has_rate=st.booleans())


def gate(*, timed: bool = True) -> StateGate:
    return StateGate('inertial', 'base_link', step_s=0.5, timeout_s=2.5, timed=timed)


@PROPERTY
@given(raw=raw_states, now_ns=stamps, timed=st.booleans())
def test_whatever_a_state_holds_it_is_a_rotation_and_a_finite_rate_or_refused(
    raw: RawState, now_ns: int, timed: bool,
) -> None:
    admitted = gate(timed=timed).admit(raw, now_ns)
    if isinstance(admitted, Refusal):
        assert admitted.detail
        return
    assert is_rotation_matrix(admitted.R_NB)
    assert np.isfinite(admitted.omega_BN_B).all()
    assert (raw.body_frame_id, raw.has_attitude, raw.has_rate) == ('base_link', True, True)
    assert raw.inertial_frame_id in (None, 'inertial')
    assert admitted.stamp_ns > 0
    if timed:
        assert -SECOND // 4 <= now_ns - admitted.stamp_ns <= 5 * SECOND // 2


@PROPERTY
@given(seen=st.lists(st.tuples(st.integers(1, 12), st.integers(1, 12)), max_size=12))
def test_admitted_stamps_grow_unless_time_started_again(seen: list[tuple[int, int]]) -> None:
    """States every half second of any order, at any time."""
    door, last_ns = gate(), 0
    for stamp, now in seen:
        raw = RawState(stamp * SECOND // 2, 'inertial', 'base_link', (0.0, 0.0, 0.0, 1.0),
                       (0.0, 0.0, 0.0))
        admitted = door.admit(raw, now * SECOND // 2)
        if isinstance(admitted, StateSample):
            assert door.restarted == (admitted.stamp_ns < last_ns)
            assert admitted.stamp_ns > last_ns or last_ns - admitted.stamp_ns > 5 * SECOND // 2
            last_ns = admitted.stamp_ns


@PROPERTY
@given(quaternion=quaternions(), frame=any_text)
def test_a_setpoint_is_a_rotation_or_refused_and_both_signs_are_the_same(
    quaternion: tuple, frame: str,
) -> None:
    admitted = admit_setpoint(frame, quaternion, 'inertial')
    negated = admit_setpoint(frame, tuple(-x for x in quaternion), 'inertial')  # type: ignore[arg-type]
    if isinstance(admitted, Refusal):
        assert isinstance(negated, Refusal)
        assert admitted.reason is negated.reason
        return
    assert frame == 'inertial'
    assert is_rotation_matrix(admitted)
    assert not isinstance(negated, Refusal)
    assert admitted.tobytes() == negated.tobytes()


@PROPERTY
@given(direction=any_vector)
def test_a_direction_has_unit_length_or_is_refused(direction: tuple) -> None:
    admitted = admit_direction('inertial', direction, 'inertial')
    usable = all(map(math.isfinite, direction)) and any(direction)
    assert isinstance(admitted, Refusal) != usable
    if not isinstance(admitted, Refusal):
        assert np.linalg.norm(admitted) == pytest.approx(1.0)
        assert (np.sign(admitted) * np.sign(direction) >= 0.0).all()


@PROPERTY
@given(torque=any_vector, frame=any_text)
def test_a_torque_passes_to_the_bit_or_is_refused(torque: tuple, frame: str) -> None:
    admitted = admit_in_body(frame, torque, 'base_link')
    usable = frame == 'base_link' and all(map(math.isfinite, torque))
    assert isinstance(admitted, Refusal) != usable
    if not isinstance(admitted, Refusal):
        assert tuple(admitted) == torque


gaps = st.lists(st.integers(1, 30), min_size=1, max_size=60)


@PROPERTY
@given(first=gaps, second=gaps)
def test_a_writer_that_loses_messages_and_is_started_again_is_one(
    first: list[int], second: list[int],
) -> None:
    watch = PublisherWatch()
    for lost in (first, second):
        number = 0
        for gap in lost:
            number += gap
            assert not watch.note(number)


@PROPERTY
@given(ahead=st.integers(0, 10**6), every=st.integers(1, 40),
       losses=st.lists(st.booleans(), min_size=1, max_size=8))
def test_two_writers_are_seen_whatever_their_numbers_and_rates(
    ahead: int, every: int, losses: list[bool],
) -> None:
    """One message of the second comes after ``every`` of the first, some of which are lost."""
    watch, seen = PublisherWatch(), False
    for count in range(1, 20 * every + 1):
        if not losses[count % len(losses)] or count % every == 0:
            seen = watch.note(ahead + count) or seen
        if count % every == 0:
            seen = watch.note(count // every) or seen
    assert seen


def test_a_middleware_without_numbers_says_nothing() -> None:
    watch = PublisherWatch()
    assert not any(watch.note(None) for _ in range(100))


@PROPERTY
@given(delays=st.lists(st.floats(0.0, 3.0), min_size=1, max_size=30))
def test_every_tick_of_the_grid_is_taken_or_missed(delays: list[float]) -> None:
    """A timer that skips: each tick comes some time after the grid point that it belongs to."""
    timing, step_s = TickTiming(0.5), 0.5
    timing.begin(10.0)
    taken, due_s = 1, 10.0 + step_s
    for delay_s in delays:
        now_s = due_s + delay_s
        timing.begin(now_s)
        taken += 1
        assert -1e-9 <= timing.lateness_s - delay_s <= 1e-9
        due_s += (int(delay_s / step_s + 1e-9) + 1) * step_s
    grid = round((due_s - 10.0) / step_s)
    assert taken + timing.missed == grid
    assert timing.longest_lateness_s == pytest.approx(max(delays), abs=1e-9)


def test_time_that_goes_back_or_leaps_misses_nothing() -> None:
    timing = TickTiming(0.5)
    for now_s in (10.0, 10.5, 2.0, 2.5, 1.8e9, 1.8e9 + 0.5, 10.0):
        timing.begin(now_s)
        assert timing.lateness_s == 0.0
    timing.end(0.25)
    timing.end(0.125)
    values = timing.values()
    assert values == {
        'tick_lateness_us': 0.0, 'tick_lateness_max_us': 0.0, 'tick_time_us': 125000.0,
        'tick_time_max_us': 250000.0, 'missed_ticks': 0}


def test_an_answer_is_timed_from_the_arrival_that_the_middleware_says() -> None:
    for waited_s in (0.0, 0.25):
        before_s = time.monotonic()
        arrived_s = arrival_s({'received_timestamp': time.time_ns() - round(waited_s * 1e9)})
        assert before_s - ROUNDING_S <= arrived_s + waited_s <= time.monotonic() + ROUNDING_S
    for silent in ({}, {'received_timestamp': 0}):
        before_s = time.monotonic()
        assert before_s <= arrival_s(silent) <= time.monotonic()
    timing = AnswerTiming(0.5)
    timing.end(0.25)
    timing.end(0.125)
    assert timing.values() == {'answer_time_us': 125000.0, 'answer_time_max_us': 250000.0}
