# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States from messages by description: joining, stamps of three kinds, what is refused."""

from __future__ import annotations

import random
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml

from manifold_mpc_ros.config.description import StateDescription, state_description
from manifold_mpc_ros.control.described.source import DescribedSource, ForeignClock, check_part
from manifold_mpc_ros.control.input_gate import NANOSECONDS, RawState, Reason, Refusal
from manifold_mpc_ros.errors import ConfigurationError

SECOND = NANOSECONDS


def description(
    folder: Path, attitude: dict[str, Any], rate: dict[str, Any], **more: Any,
) -> StateDescription:
    """Write a description and read it."""
    path = folder / 'mine.yaml'
    path.write_text(yaml.safe_dump({'state': {
        'attitude': {'topic': 'a', 'type': 'my_msgs/msg/A', 'field': 'q', **attitude},
        'rate': {'topic': 'r', 'type': 'my_msgs/msg/R', 'field': 'w', **rate}, **more}}))
    state_description.cache_clear()
    return state_description(str(path))


def source(*parts: Any, **more: Any) -> DescribedSource:
    """Return the source of a description."""
    return DescribedSource(description(*parts, **more))


def attitude_at(stamp: Any, q: Any = (0.0, 0.0, 0.0, 1.0)) -> SimpleNamespace:
    return SimpleNamespace(q=q, t=stamp)


def rate_at(stamp: Any, w: Any = (0.1, 0.2, 0.3)) -> SimpleNamespace:
    return SimpleNamespace(w=w, t=stamp)


def test_newest_of_both_are_joined_once_when_their_stamps_are_near(tmp_path: Path) -> None:
    stamp = {'stamp': 't', 'stamp_unit': 's'}
    joined = source(tmp_path, stamp, {}, join_within_s=0.01)
    assert joined.read('a', attitude_at(1.0), SECOND) is None
    assert joined.read('r', rate_at(1.02), SECOND) is None   # too far apart
    state = joined.read('a', attitude_at(1.015), SECOND)
    assert isinstance(state, RawState)
    assert (state.omega_BN_B, state.inertial_frame_id) == ((0.1, 0.2, 0.3), None)
    assert joined.read('r', rate_at(1.016), SECOND) is None  # that attitude has been used
    joined.forget()
    assert joined.read('a', attitude_at(1.016), SECOND) is None  # and this rate is forgotten


@pytest.mark.parametrize('behind', range(-9, 10))
def test_two_topics_of_which_one_lags_are_joined_all_the_same(tmp_path: Path, behind: int) -> None:
    """As from full queues that have lost different messages: attitude k comes with rate k + n."""
    joined = source(tmp_path, {'stamp': 't'}, {'stamp': 't'}, join_within_s=0.01)
    states = []
    for k in range(10, 40):
        late = k + behind
        states += [joined.read('a', attitude_at(SimpleNamespace(sec=k, nanosec=0)), SECOND),
                   joined.read('r', rate_at(SimpleNamespace(sec=late, nanosec=0), (late, 0, 0)),
                               SECOND)]
    found = [(state.stamp_ns, state.omega_BN_B[0]) for state in states
             if isinstance(state, RawState)]
    assert found == [(k * SECOND, k) for k in range(max(10, 10 + behind), min(40, 40 + behind))]


@pytest.mark.parametrize(('stamp', 'given', 'expected_ns'), [
    ({'stamp': 't'}, SimpleNamespace(sec=3, nanosec=4), 3 * SECOND + 4),
    ({'stamp': 't', 'stamp_unit': 'us'}, 3_000_000, 7 * SECOND),  # boot time: received now
    ({'stamp': 'receipt'}, None, 7 * SECOND)])
def test_stamps_of_three_kinds(
    tmp_path: Path, stamp: dict[str, str], given: Any, expected_ns: int,
) -> None:
    joined = source(tmp_path, stamp, {})
    joined.read('r', rate_at(given), 7 * SECOND)
    state = joined.read('a', attitude_at(given), 7 * SECOND)
    assert isinstance(state, RawState)
    assert state.stamp_ns == expected_ns


@pytest.mark.parametrize('drift', [-1e-4, 0.0, 1e-4])
@pytest.mark.parametrize('boot_ns', [-10**12, -10**10, 10**18])
def test_boot_time_is_mapped_by_the_message_with_the_least_delay(
    drift: float, boot_ns: int,
) -> None:
    """The age is wrong by the least delay (0.1 ms here) and the drift since, no more."""
    draw, clock = random.Random(boot_ns), ForeignClock()
    for k in range(200):
        true_ns = k * SECOND // 50
        delay_ns = 100_000 if k % 10 == 0 else draw.randrange(100_000, 40_000_000)
        foreign_ns = boot_ns + round(true_ns * (1.0 + drift))
        error_ns = clock.to_ros_ns(foreign_ns, true_ns + delay_ns) - true_ns
        assert -60_000 <= error_ns <= 200_000


def test_a_clock_that_started_again_is_mapped_anew() -> None:
    clock = ForeignClock()
    clock.to_ros_ns(100 * SECOND, 1000 * SECOND)
    assert clock.to_ros_ns(1 * SECOND, 1002 * SECOND) == 1002 * SECOND
    # And one that is set to ROS time while it runs: the smaller difference counts at once.
    assert clock.to_ros_ns(1003 * SECOND, 1003 * SECOND + 5) == 1003 * SECOND + 5


def test_a_clock_that_is_ros_time_is_taken_as_it_is_and_time_0_tells_nothing() -> None:
    clock = ForeignClock()
    assert clock.to_ros_ns(3 * SECOND, 0) == 3 * SECOND  # simulated time has not begun
    for late_ns in (-40_000_000, 700_000_000, 1_400_000_000, 10):  # late messages of /clock too
        assert clock.to_ros_ns(4 * SECOND, 4 * SECOND + late_ns) == 4 * SECOND


def test_what_cannot_be_read_is_refused_with_the_reason(tmp_path: Path) -> None:
    joined = source(tmp_path, {'stamp': 'receipt', 'form': 'matrix', 'absent': 'there'}, {})
    short = joined.read('r', rate_at(0, (1.0,)), 1)
    assert isinstance(short, Refusal)
    assert (short.reason, short.detail) == (Reason.UNREADABLE, 'r: 1 numbers, not 3')
    joined.read('r', rate_at(0), 1)
    skewed = joined.read('a', SimpleNamespace(q=[1.0] * 9, there=0), 1)
    assert isinstance(skewed, Refusal)
    assert skewed.reason is Reason.QUATERNION_NORM
    joined.read('r', rate_at(0), 1)
    absent = joined.read('a', SimpleNamespace(q=(1.0, 0, 0, 0, 1, 0, 0, 0, 1), there=-1), 1)
    assert isinstance(absent, RawState)
    assert (absent.has_attitude, absent.has_rate) == (False, True)


@pytest.mark.parametrize(('attitude', 'message', 'says'), [
    ({'field': 'p.q'}, attitude_at(1), "a: 'my_msgs/msg/A'.*has no attribute 'p'"),
    ({'stamp': 'time'}, attitude_at(1), "no attribute 'time'"),
    ({'field': 'q[4]'}, attitude_at(1, np.zeros(4)), 'it has 4 elements, not 5'),
    ({}, attitude_at(1, (1.0, 0.0)), '2 numbers, not 4'),
    ({'stamp_unit': 'time'}, attitude_at(1), 'a number, whose stamp_unit is not given'),
    ({}, attitude_at('now'), 'fields described')])
def test_a_path_that_a_message_lacks_is_named(
    tmp_path: Path, attitude: dict[str, str], message: Any, says: str,
) -> None:
    described = description(tmp_path, {'stamp': 't', 'stamp_unit': 's', **attitude}, {})
    with pytest.raises(ConfigurationError, match=says):
        check_part(described.attitude, message)


def test_a_sequence_that_is_empty_as_yet_may_have_what_is_asked(tmp_path: Path) -> None:
    for field in ('q', ['q[0]', 'q[1]', 'q[2]', 'q[7]']):
        described = description(tmp_path, {'stamp': 'receipt', 'field': field}, {})
        check_part(described.attitude, attitude_at(1, []))
