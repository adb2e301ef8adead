# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages as bytes, and what happens to them on their way."""

from __future__ import annotations

import itertools
import math
import random
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from manifold_mpc_ros.lab.fault_injection import disturbances as d
from manifold_mpc_ros.lab.fault_injection.cdr import (
    CLOCK,
    ODOMETRY,
    WRENCH,
    Layout,
    StampedMessage,
)

FLOATS = st.floats(allow_nan=False)
TEXTS = st.text(st.characters(codec='utf-8', exclude_characters='\0'), max_size=40)


def messages(layout: Layout, count: int) -> st.SearchStrategy[StampedMessage]:
    return st.builds(
        StampedMessage, st.integers(-2**31, 2**31 - 1), st.integers(0, 2**32 - 1),
        st.tuples(*[TEXTS] * layout.texts), st.tuples(*[FLOATS] * count))


ODOMETRIES = messages(ODOMETRY, 85)
SAMPLE = StampedMessage(7, 8, ('inertial', 'base_link'), tuple(float(i) for i in range(85)))


@given(ODOMETRIES)
def test_a_message_is_the_same_taken_apart_and_put_together(message: StampedMessage) -> None:
    assert StampedMessage.decode(message.encode(), ODOMETRY) == message


def test_ros_reads_what_was_put_together() -> None:
    pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
    from geometry_msgs.msg import WrenchStamped
    from nav_msgs.msg import Odometry
    from rclpy.serialization import deserialize_message, serialize_message
    from rosgraph_msgs.msg import Clock

    odometry = Odometry(child_frame_id='base_link')
    odometry.header.frame_id = 'inertial'
    odometry.header.stamp.sec, odometry.header.stamp.nanosec = -3, 5
    q, rate = odometry.pose.pose.orientation, odometry.twist.twist.angular
    q.x, q.y, q.z, q.w = 0.1, 0.2, 0.3, 0.4
    rate.x, rate.y, rate.z = 1.0, -2.0, math.inf
    wrench = WrenchStamped()
    wrench.header.frame_id = 'b'
    wrench.wrench.torque.y = 4.0
    clock = Clock()
    clock.clock.sec = 9
    decoded = {}
    for message, layout in ((odometry, ODOMETRY), (wrench, WRENCH), (clock, CLOCK)):
        data = serialize_message(message)
        decoded[type(message)] = StampedMessage.decode(data, layout)
        encoded = decoded[type(message)].encode()
        assert len(encoded) == len(data)  # the bytes of padding may be anything
        assert deserialize_message(encoded, type(message)) == message
    assert decoded[Odometry].texts == ('inertial', 'base_link')
    assert (decoded[Odometry].seconds, decoded[Odometry].nanoseconds) == (-3, 5)
    assert decoded[Odometry].part(ODOMETRY.quaternion) == (0.1, 0.2, 0.3, 0.4)
    assert decoded[Odometry].part(ODOMETRY.vector) == (1.0, -2.0, math.inf)
    assert decoded[WrenchStamped].part(WRENCH.vector) == (0.0, 4.0, 0.0)
    assert decoded[Clock].seconds == 9


@given(st.binary(max_size=200))
def test_damaged_bytes_are_said_to_be(data: bytes) -> None:
    try:
        StampedMessage.decode(b'\0\1\0\0' + data, ODOMETRY)
    except (struct.error, ValueError):
        return


def edit(change: d.Edit, seed: int = 0) -> StampedMessage:
    """Return the sample after an edit."""
    disturb = d.edited(ODOMETRY, change)()
    (delay_s, data), = disturb(SAMPLE.encode(), random.Random(seed))
    assert delay_s == 0.0
    return StampedMessage.decode(data, ODOMETRY)


def test_edits_change_what_they_say_and_nothing_else() -> None:
    Q, rate = ODOMETRY.quaternion, ODOMETRY.vector
    assert edit(d.scaled(Q, 2.0)).part(Q) == (6.0, 8.0, 10.0, 12.0)
    assert edit(d.filled(rate, -1.0)).part(rate) == (-1.0, -1.0, -1.0)
    assert sum(map(math.isnan, edit(d.some_part(Q, math.nan)).values)) == 1
    assert edit(d.text(1, '')).texts == ('inertial', '')
    assert edit(d.stamped(-5, 0)).seconds == -5
    later = edit(d.shifted(-7.5))
    assert (later.seconds, later.nanoseconds) == (-1, 500_000_008)
    signs = {edit(d.random_sign(Q), seed).part(Q) for seed in range(20)}
    assert signs == {(3.0, 4.0, 5.0, 6.0), (-3.0, -4.0, -5.0, -6.0)}
    assert math.isclose(math.hypot(*edit(d.noisy(Q, 0.1, unit=True)).part(Q)), 1.0)
    for change in (d.scaled(Q, 2.0), d.noisy(Q, 0.1), d.random_sign(Q)):
        changed = edit(change)
        assert changed.values[:Q.start] == SAMPLE.values[:Q.start]
        assert changed.values[Q.stop:] == SAMPLE.values[Q.stop:]
        assert changed.texts == SAMPLE.texts


def through(make: d.MakeDisturbance, count: int, seed: int = 1) -> list[bytes]:
    """Return what comes of numbered messages, sent every 10 ms, in the order of delivery."""
    channel, arrived = d.Channel(seed), []
    channel.disturbance = make()
    for k in range(count):
        arrived += channel.due(0.01 * k)
        arrived += channel.push(bytes([k]), 0.01 * k)
    return arrived + channel.due(1e9)


def test_a_channel_loses_delays_repeats_and_swaps() -> None:
    sent = [bytes([k]) for k in range(200)]
    assert through(d.lost(0.0), 200) == sent
    assert through(d.lost(1.0), 200) == []
    kept = through(d.lost(0.5), 200)
    assert 60 < len(kept) < 140
    assert kept == sorted(kept)
    numbers = [-1, *(each[0] for each in kept)]
    assert max(b - a for a, b in itertools.pairwise(numbers)) > 5  # more than four in a row
    numbers = [-1, *(each[0] for each in through(d.lost(0.5, most_in_a_row=4), 200))]
    assert max(b - a for a, b in itertools.pairwise(numbers)) == 5
    assert 80 < len(numbers) < 150
    assert through(d.late(0.03, 0.03), 200) == sent
    jittered = through(d.late(0.0, 0.06), 200)
    assert sorted(jittered) == sent
    assert jittered != sent
    assert through(d.repeated(2), 3) == [b'\0'] * 2 + [b'\1'] * 2 + [b'\2'] * 2
    assert through(d.swapped, 4) == [b'\1', b'\0', b'\3', b'\2']
    assert through(d.frozen, 3) == [b'\0'] * 3


def test_without_a_disturbance_what_is_late_still_comes() -> None:
    channel = d.Channel(0)
    channel.disturbance = d.late(0.5, 0.5)()
    assert channel.push(b'a', 0.0) == []
    channel.disturbance = None
    assert channel.push(b'b', 0.1) == [b'b']
    assert channel.due(0.4) == []
    assert channel.due(0.6) == [b'a']


@pytest.mark.parametrize('garble', [
    d.random_bytes, d.truncated, d.huge_length, d.flipped, d.header_flipped])
def test_garbled_bytes_are_no_longer_than_they_were(garble: d.Garble) -> None:
    data, draws = SAMPLE.encode(), random.Random(3)
    results = [garble(data, draws) for _ in range(50)]
    assert all(len(result) <= len(data) for result in results)
    assert sum(result != data for result in results) > 45


def test_delays_are_in_proportion_to_the_steps_of_nodes_that_were_slowed_down() -> None:
    channel = d.Channel(0)
    channel.disturbance = d.late(0.03, 0.03)()
    channel.stretch = 5
    assert channel.push(b'state', 0.0) == []
    assert channel.due(0.149) == []
    assert channel.due(0.151) == [b'state']
