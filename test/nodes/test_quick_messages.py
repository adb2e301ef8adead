# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is read quickly is what rclpy makes of the same bytes, whatever comes after whatever."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from properties import PROPERTY
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Imu
from std_msgs.msg import Float64MultiArray

from manifold_mpc_ros.config.description import Part, command_description, state_description
from manifold_mpc_ros.control.actuator import Actuation
from manifold_mpc_ros.control.described.command import CommandWriter
from manifold_mpc_ros.control.described.source import (
    DescribedSource,
    ReadPart,
    part_of,
    read_part,
)
from manifold_mpc_ros.nodes import quick_messages
from manifold_mpc_ros.nodes.quick_messages import QuickMessages, QuickWriter

KINDS = {('odometry', 'odometry'): Odometry, ('imu', 'imu'): Imu,
         ('pose_twist', 'pose'): PoseStamped, ('pose_twist', 'twist'): TwistStamped}
NUMBERS = st.lists(st.floats(allow_nan=False), min_size=20, max_size=20)
STAMPS = st.tuples(st.integers(-2**31, 2**31 - 1), st.integers(0, 2**32 - 1))
FRAMES = st.tuples(*[st.sampled_from(['', 'a', 'inertial', 'bödy'])] * 2)


def reader(description: str, topic: str) -> tuple[QuickMessages, list[Part]]:
    parts = DescribedSource(state_description(description)).parts(topic)
    return QuickMessages(KINDS[description, topic], parts), parts


def parts_in(quick: QuickMessages, parts: list[Part], data: bytes, received_ns: int = 0
             ) -> list[ReadPart]:
    """Return the parts that bytes have, of a known form or not."""
    numbers = quick.numbers(data)
    if numbers is None:
        message = quick.message(data)
        return [read_part(part, message, received_ns) for part in parts]
    assert len(numbers) == len(parts)
    return [part_of(part, *seen, received_ns) for part, seen in zip(parts, numbers)]


def filled(kind: type, values: list[float], stamp: tuple[int, int], frames: tuple[str, str]
           ) -> Any:
    """Return a message with numbers everywhere."""
    message, left = kind(), iter(values)

    def fill(part: Any) -> None:
        for name, is_of in part.get_fields_and_field_types().items():
            value = getattr(part, name)
            if hasattr(value, 'get_fields_and_field_types'):
                fill(value)
            elif is_of == 'double':
                setattr(part, name, next(left))
            elif is_of.startswith('double['):
                value[:] = next(left)

    fill(message)
    message.header.frame_id = frames[0]
    message.header.stamp.sec, message.header.stamp.nanosec = stamp
    if hasattr(message, 'child_frame_id'):
        message.child_frame_id = frames[1]
    return message


@pytest.mark.parametrize(('description', 'topic'), KINDS)
@settings(PROPERTY, max_examples=100)
@given(data=st.data())
def test_parts_are_those_of_the_message_that_rclpy_makes(
        description: str, topic: str, data: st.DataObject) -> None:
    quick, parts = reader(description, topic)
    for number in range(data.draw(st.integers(1, 6))):
        message = filled(KINDS[description, topic], data.draw(NUMBERS), data.draw(STAMPS),
                         data.draw(FRAMES))
        assert parts_in(quick, parts, bytes(serialize_message(message)), number) == [
            read_part(part, message, number) for part in parts]


@pytest.mark.parametrize(('description', 'topic'), KINDS)
def test_only_the_first_message_is_made_by_rclpy(
        description: str, topic: str, monkeypatch: pytest.MonkeyPatch) -> None:
    quick, parts = reader(description, topic)
    data = [bytes(serialize_message(filled(KINDS[description, topic], [float(i)] * 20, (i, i),
                                           ('inertial', 'base_link')))) for i in range(4)]
    quick.message(data[0])
    monkeypatch.setattr(quick_messages, 'deserialize_message', None)
    stamps_ns = [parts_in(quick, parts, each)[0].stamp_ns for each in data[1:]]
    assert stamps_ns == [i * 1_000_000_001 for i in (1, 2, 3)]


def test_messages_whose_length_varies_are_made_by_rclpy() -> None:
    part = DescribedSource(state_description('pose_twist')).parts('pose')[0]
    stamped = replace(part, fields=(('header', 'stamp', 'sec'),) * 4)
    quick, message = QuickMessages(DiagnosticArray, [stamped]), DiagnosticArray()
    for sec in range(3):
        message.header.stamp.sec = sec
        read, = parts_in(quick, [stamped], bytes(serialize_message(message)))
        assert (read.values, read.stamp_ns) == ((sec,) * 4, sec * 1_000_000_000)


def test_padding_that_differs_is_the_same_form(monkeypatch: pytest.MonkeyPatch) -> None:
    quick, parts = reader('odometry', 'odometry')
    data = bytearray(serialize_message(filled(
        Odometry, np.arange(20.0).tolist(), (1, 2), ('inertial', 'base_link'))))
    first = parts_in(quick, parts, bytes(data))
    data[25:28] = b'abc'  # between the two texts
    monkeypatch.setattr(quick_messages, 'deserialize_message', None)
    assert parts_in(quick, parts, bytes(data)) == first


@settings(PROPERTY, max_examples=100)
@given(torques=st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 3), min_size=2, max_size=5),
       stamp_ns=st.integers(0, 2**60))
def test_what_is_written_quickly_is_the_filled_message(
        torques: list[tuple[float, ...]], stamp_ns: int) -> None:
    described, = command_description('nav')
    writer, message = CommandWriter(described, 'base_link', (1.0,)), WrenchStamped()
    writer.fill(message, 1, 2, Actuation(np.zeros(3), np.zeros(3), np.zeros(3)))
    quick = QuickWriter(message, writer.paths(message))
    for torque in torques:
        actuation = Actuation(np.array(torque), np.zeros(3), np.zeros(3))
        data = quick.bytes_of(writer.numbers(message, stamp_ns, 7, actuation))
        assert deserialize_message(data, WrenchStamped) == writer.fill(
            WrenchStamped(), stamp_ns, 7, actuation)


def test_the_same_numbers_have_the_same_bytes() -> None:
    described, = command_description('nav')
    writer, message = CommandWriter(described, 'base_link', (1.0,)), WrenchStamped()
    actuation, written = Actuation(np.ones(3), np.zeros(3), np.zeros(3)), set()
    for size in range(1, 400):  # other memory, whose bytes would be in the padding
        held = [b'\xff' * size for _ in range(20)]
        writer.fill(message, 1, 2, actuation)
        del held
        written.add(QuickWriter(message, writer.paths(message)).bytes_of(
            writer.numbers(message, 1, 2, actuation)))
    assert len(written) == 1


def test_devices_and_sequences_are_not_written_quickly() -> None:
    described, = command_description('wheels')
    with pytest.raises(ValueError, match='device'):
        CommandWriter(described, 'base_link', (1.0,)).paths(Float64MultiArray())
    with pytest.raises(ValueError, match='sequence'):
        QuickWriter(Float64MultiArray(data=[1.0]), [('data', 0)])


def test_bytes_that_are_none_raise() -> None:
    quick, _ = reader('odometry', 'odometry')
    with pytest.raises(RuntimeError, match='deserialize'):
        quick.message(b'\x00\x01\x00\x00\x01')
