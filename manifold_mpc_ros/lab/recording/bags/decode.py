# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Serialized messages to plain values; needs no ROS, the definitions come with `rosbags`."""

from __future__ import annotations

import functools
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from manifold_mpc_ros.config.description import state_description
from manifold_mpc_ros.control.described.source import read_part
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.lab.recording.bags.contents import RawMessage
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

ODOMETRY, IMU = 'nav_msgs/msg/Odometry', 'sensor_msgs/msg/Imu'
POSE, TWIST = 'geometry_msgs/msg/PoseStamped', 'geometry_msgs/msg/TwistStamped'
WRENCH, DIAGNOSTICS = 'geometry_msgs/msg/WrenchStamped', 'diagnostic_msgs/msg/DiagnosticArray'
ATTITUDE, DIRECTION = 'geometry_msgs/msg/QuaternionStamped', 'geometry_msgs/msg/Vector3Stamped'
PATH, STRING = 'nav_msgs/msg/Path', 'std_msgs/msg/String'
TRAJECTORY = 'trajectory_msgs/msg/MultiDOFJointTrajectory'

Decoded = TypeVar('Decoded')

#: What reading damaged bytes as a message may raise.
DAMAGE = (SerdeError, struct.error, ValueError, IndexError, KeyError, TypeError, AssertionError,
           OverflowError, MemoryError, AttributeError)


@dataclass(frozen=True, eq=False)
class StateValue:
    """Attitude and body rate of one message; a message that lacks one of them has None there."""

    R_NB: Array | None
    omega_BN_B: Array | None


@dataclass(frozen=True)
class Stamped(Generic[Decoded]):
    """A decoded message with the stamp of its header and the time of its receipt."""

    stamp_ns: int
    received_ns: int
    value: Decoded


@functools.cache
def typestore() -> Typestore:
    """Return the standard messages of ROS 2 Jazzy."""
    return get_typestore(Stores.ROS2_JAZZY)


class Unusable(ValueError):
    """A message that can be read, and must not be used: why not."""


def decode(
    messages: Iterable[RawMessage], kind: str, read: Callable[[Any], Decoded],
    damaged: Callable[[str], None], *, stamped: bool = False,
) -> Iterator[Stamped[Decoded]]:
    """Yield what ``read`` makes of each message; ``damaged`` is told why it makes nothing.

    With ``stamped`` a message whose stamp is zero or negative cannot be used.
    """
    for message in messages:
        try:
            content: Any = typestore().deserialize_cdr(message.data, kind)
            stamp_ns = int(content.header.stamp.sec) * NANOSECONDS \
                + int(content.header.stamp.nanosec)
            if stamped and stamp_ns <= 0:
                raise Unusable('the stamp is zero or negative')
            decoded = Stamped(stamp_ns, message.received_ns, read(content))
        except Unusable as error:
            damaged(str(error))
        except DAMAGE as error:
            damaged(f'could not be read as {kind} ({" ".join(str(error).split())[:120]})')
        else:
            yield decoded


def read_text(message: RawMessage) -> str:
    """Return the text of a std_msgs/String; raises ValueError."""
    try:
        content: Any = typestore().deserialize_cdr(message.data, STRING)
        return str(content.data)
    except DAMAGE as error:
        raise ValueError(f'{message.topic}: {error}') from None


def path(content: Any) -> Array:
    """Return the attitudes of a path (N + 1, 3, 3)."""
    return np.array([rotation(each.pose.orientation) for each in content.poses]).reshape(-1, 3, 3)


def rotation(quaternion: Any) -> Array:
    """Return the rotation matrix of a quaternion message; raises ValueError for none."""
    return _rotation(quaternion.x, quaternion.y, quaternion.z, quaternion.w)


def _rotation(x: float, y: float, z: float, w: float) -> Array:
    """Return the rotation matrix of a quaternion; raises Unusable for none."""
    values = np.array([w, x, y, z], dtype=float)
    if not abs(float(np.linalg.norm(values)) - 1.0) < 1e-2:
        raise Unusable(f'the quaternion ({x:g}, {y:g}, {z:g}, {w:g}) is not of unit length')
    return so3.rotation_from_quaternion(values)


def vector(content: Any) -> Array:
    """Return three numbers."""
    return np.array([content.x, content.y, content.z], dtype=float)


def _state_reader(kind: str) -> Callable[[Any], StateValue]:
    """Return what reads the states of a type as the shipped descriptions say."""
    parts = [(part, part is state.attitude) for state in map(state_description, _STANDARD)
             for part in (state.attitude, state.rate) if part.message_type == kind]

    def read(content: Any) -> StateValue:
        R_NB = omega_BN_B = None
        for part, is_attitude in parts:
            found = read_part(part, content, 0)
            if found.there and is_attitude:
                x, y, z, w = found.values
                R_NB = _rotation(x, y, z, w)
            elif found.there:
                omega_BN_B = np.array(found.values)
        return StateValue(R_NB, omega_BN_B)

    return read


#: Shipped descriptions whose types need no further definition.
_STANDARD = ('nav', 'imu', 'pose_twist')
#: What gives a state, by type.
STATE_READERS = {kind: _state_reader(kind) for kind in (ODOMETRY, IMU, POSE, TWIST)}


def odometry_cdr(
    stamp_ns: int, xyzw: Sequence[float], omega_BN_B: Array | Sequence[float],
    frames: tuple[str, str],
) -> bytes:
    """Return an odometry message of a body that turns in place, serialized."""
    types, zeros = typestore().types, np.zeros(36)
    none = types['geometry_msgs/msg/Vector3'](0.0, 0.0, 0.0)
    rate = types['geometry_msgs/msg/Vector3'](*map(float, omega_BN_B))
    attitude = types['geometry_msgs/msg/Quaternion'](*map(float, xyzw))
    origin = types['geometry_msgs/msg/Point'](0.0, 0.0, 0.0)
    return bytes(typestore().serialize_cdr(types[ODOMETRY](
        _header(stamp_ns, frames[0]), frames[1],
        types['geometry_msgs/msg/PoseWithCovariance'](
            types['geometry_msgs/msg/Pose'](origin, attitude), zeros),
        types['geometry_msgs/msg/TwistWithCovariance'](
            types['geometry_msgs/msg/Twist'](none, rate), zeros)), ODOMETRY))


def attitude_cdr(stamp_ns: int, xyzw: Sequence[float], frame_id: str) -> bytes:
    """Return a commanded attitude, serialized."""
    types = typestore().types
    return bytes(typestore().serialize_cdr(types[ATTITUDE](
        _header(stamp_ns, frame_id), types['geometry_msgs/msg/Quaternion'](*map(float, xyzw))),
        ATTITUDE))


def torque_cdr(stamp_ns: int, torque_B_n_m: Sequence[float], frame_id: str) -> bytes:
    """Return a body torque, serialized."""
    types = typestore().types
    none = types['geometry_msgs/msg/Vector3'](0.0, 0.0, 0.0)
    torque = types['geometry_msgs/msg/Vector3'](*map(float, torque_B_n_m))
    return bytes(typestore().serialize_cdr(types[WRENCH](
        _header(stamp_ns, frame_id), types['geometry_msgs/msg/Wrench'](none, torque)), WRENCH))


def _header(stamp_ns: int, frame_id: str) -> Any:
    """Return a header."""
    types = typestore().types
    seconds, rest = divmod(stamp_ns, NANOSECONDS)
    return types['std_msgs/msg/Header'](
        types['builtin_interfaces/msg/Time'](seconds, rest), frame_id)
