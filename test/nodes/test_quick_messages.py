# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages read quickly have the numbers of rclpy's own, whatever comes after whatever."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from properties import PROPERTY
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Imu

from manifold_mpc_ros.config.description import state_description
from manifold_mpc_ros.control.described.fields import value_at
from manifold_mpc_ros.control.described.source import DescribedSource
from manifold_mpc_ros.nodes import quick_messages
from manifold_mpc_ros.nodes.quick_messages import QuickMessages

#: Of each a number that no description names, so that another layout would be noticed.
KINDS = {('odometry', 'odometry'): Odometry, ('imu', 'imu'): Imu,
         ('pose_twist', 'pose'): PoseStamped, ('pose_twist', 'twist'): TwistStamped}
NUMBERS = st.lists(st.floats(allow_nan=False), min_size=12, max_size=12)
STAMPS = st.tuples(st.integers(-2**31, 2**31 - 1), st.integers(0, 2**32 - 1))
FRAMES = st.tuples(*[st.sampled_from(['', 'a', 'inertial', 'bödy'])] * 2)


def reader(description: str, topic: str) -> tuple[QuickMessages, Any]:
    wanted = functools.partial(DescribedSource(state_description(description)).numbers, topic)
    return QuickMessages(KINDS[description, topic], wanted), wanted


def filled(kind: type, wanted: Any, values: list[float], stamp: tuple[int, int],
           frames: tuple[str, str]) -> Any:
    message = kind()
    message.header.frame_id = frames[0]
    message.header.stamp.sec, message.header.stamp.nanosec = stamp
    if hasattr(message, 'child_frame_id'):
        message.child_frame_id = frames[1]
    for steps, value in zip(wanted(message), values):
        owner, last = value_at(message, steps[:-1]), steps[-1]
        if last in ('x', 'y', 'z', 'w'):
            setattr(owner, last, value)
    return message


@pytest.mark.parametrize(('description', 'topic'), KINDS)
@settings(PROPERTY, max_examples=100)
@given(data=st.data())
def test_numbers_and_texts_are_those_of_the_message(
        description: str, topic: str, data: st.DataObject) -> None:
    quick, wanted = reader(description, topic)
    for _ in range(data.draw(st.integers(1, 6))):
        sent = filled(KINDS[description, topic], wanted,
                      data.draw(NUMBERS),
                      data.draw(STAMPS), data.draw(FRAMES))
        read = quick.message(bytes(serialize_message(sent)))
        assert [value_at(read, steps) for steps in wanted(sent)] == [
            value_at(sent, steps) for steps in wanted(sent)]
        assert read.header.frame_id == sent.header.frame_id
        assert getattr(read, 'child_frame_id', '') == getattr(sent, 'child_frame_id', '')


@pytest.mark.parametrize(('description', 'topic'), KINDS)
def test_only_the_first_message_is_made_by_rclpy(
        description: str, topic: str, monkeypatch: pytest.MonkeyPatch) -> None:
    quick, wanted = reader(description, topic)
    data = [bytes(serialize_message(filled(KINDS[description, topic], wanted, [float(i)] * 12,
                                           (i, i), ('inertial', 'base_link')))) for i in range(4)]
    quick.message(data[0])
    monkeypatch.setattr(quick_messages, 'deserialize_message', None)
    assert [quick.message(each).header.stamp.sec for each in data[1:]] == [1, 2, 3]


def test_messages_whose_length_varies_are_made_by_rclpy() -> None:
    quick, message = QuickMessages(DiagnosticArray, lambda _: []), DiagnosticArray()
    for sec in range(3):
        message.header.stamp.sec = sec
        data = bytes(serialize_message(message))
        assert quick.message(data) == deserialize_message(data, DiagnosticArray)


def test_padding_that_differs_is_the_same_form() -> None:
    quick, wanted = reader('odometry', 'odometry')
    data = bytearray(serialize_message(filled(
        Odometry, wanted, np.arange(12.0).tolist(), (1, 2), ('inertial', 'base_link'))))
    first = quick.message(bytes(data)).twist.twist.angular.z
    data[25:28] = b'abc'  # between the two texts
    quick._form = quick._form._replace(numbers=())  # nothing is put where the form is known
    assert quick.message(bytes(data)).twist.twist.angular.z == first
    assert quick._others == 1


def test_bytes_that_are_none_raise() -> None:
    quick, _ = reader('odometry', 'odometry')
    with pytest.raises(RuntimeError, match='deserialize'):
        quick.message(b'\x00\x01\x00\x00\x01')
