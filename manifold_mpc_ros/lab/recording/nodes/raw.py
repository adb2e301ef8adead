# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages as bytes: stamps, classes by name, and offered profiles as rosbag2 writes them."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from manifold_mpc_ros.config import interfaces
from manifold_mpc_ros.config.description import CommandMessage, Part
from manifold_mpc_ros.control.described.fields import stamp_at
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.lab.recording.bags.contents import stamp_ns_of

StampReader = Callable[[bytes, int], int]

#: Nothing is lost between two looks; a publisher offers reliability.
DEEP_QOS = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.RELIABLE)


def message_class(kind: str) -> type | None:
    """Return the class of ``package/msg/Name``, None where it is not installed."""
    package, _, name = kind.partition('/msg/')
    try:
        return getattr(importlib.import_module(f'{package}.msg'), name, None)
    except ImportError:
        return None


def stamp_reader(described: Part | CommandMessage) -> StampReader:
    """Return what maps a serialized message and the time of its receipt to its stamp [ns].

    A message without a stamp has the time of its receipt. Raises ConfigurationError for a type
    that is not installed.
    """
    kind = interfaces.message_class(described.message_type, described.install)
    if described.stamp == ('header', 'stamp'):
        return leading_stamp

    def read(data: bytes, received_ns: int) -> int:
        stamp_ns = stamp_at(
            deserialize_message(data, kind), described.stamp, described.stamp_unit_ns)
        return received_ns if stamp_ns is None else stamp_ns

    return read


def leading_stamp(data: bytes, _received_ns: int) -> int:
    """Return the stamp of a message that begins with a header [ns]."""
    return stamp_ns_of(data)


def qos_mapping(profile: QoSProfile) -> dict[str, Any]:
    """Return a profile by the names that rosbag2's metadata uses."""
    return {
        'history': profile.history.name.lower(),
        'depth': int(profile.depth),
        'reliability': profile.reliability.name.lower(),
        'durability': profile.durability.name.lower(),
        'deadline': _duration(profile.deadline.nanoseconds),
        'lifespan': _duration(profile.lifespan.nanoseconds),
        'liveliness': profile.liveliness.name.lower(),
        'liveliness_lease_duration': _duration(profile.liveliness_lease_duration.nanoseconds),
        'avoid_ros_namespace_conventions': bool(profile.avoid_ros_namespace_conventions),
    }


def _duration(nanoseconds: int) -> dict[str, int]:
    """Return a duration in the two parts that rosbag2 writes."""
    seconds, rest = divmod(int(nanoseconds), NANOSECONDS)
    return {'sec': seconds, 'nsec': rest}
