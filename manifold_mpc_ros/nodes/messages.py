# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Between ROS messages and plain values; quaternions are x, y, z, w in messages only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, PoseStamped, Quaternion, Vector3, WrenchStamped
from nav_msgs.msg import Path

from manifold_mpc_ros.control.input_gate import NANOSECONDS, to_ns
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array


def nanoseconds(stamp: Time) -> int:
    """Return a stamp in nanoseconds."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def to_stamp(stamp_ns: int) -> Time:
    """Return nanoseconds as a stamp."""
    seconds, rest = divmod(stamp_ns, NANOSECONDS)
    return Time(sec=seconds, nanosec=rest)


def quaternion_values(quaternion: Quaternion) -> tuple[float, float, float, float]:
    """Return the components x, y, z, w."""
    return (quaternion.x, quaternion.y, quaternion.z, quaternion.w)


def to_quaternion(R: Array) -> Quaternion:
    """Return a rotation matrix as a quaternion message, w >= 0."""
    w, x, y, z = map(float, so3.quaternion_from_rotation(R))
    return Quaternion(x=x, y=y, z=z, w=w)


def to_torque(stamp_ns: int, torque_B: Array, body_frame_id: str) -> WrenchStamped:
    """Return a body torque as a wrench without force."""
    message = WrenchStamped()
    message.header.stamp = to_stamp(stamp_ns)
    message.header.frame_id = body_frame_id
    message.wrench.torque = to_vector(torque_B)
    return message


def vector_values(vector: Vector3) -> tuple[float, float, float]:
    """Return the components x, y, z."""
    return (vector.x, vector.y, vector.z)


def to_vector(values: Array) -> Vector3:
    """Return three numbers as a vector message."""
    x, y, z = map(float, values)
    return Vector3(x=x, y=y, z=z)


def to_path(
    stamp_ns: int, times_s: Array, attitudes: Array, inertial_frame_id: str,
    axis_B: Sequence[float] | Array = (1.0, 0.0, 0.0),
) -> Path:
    """Return predicted attitudes (N+1, 3, 3) as poses with the stamps they are predicted for.

    Each position is the tip of a body axis, so that a viewer draws the slew as a curve on the
    unit sphere about the origin.
    """
    path = Path()
    path.header.frame_id = inertial_frame_id
    path.header.stamp = to_stamp(stamp_ns)
    for time_s, R_NB in zip(times_s.tolist(), attitudes):
        pose = PoseStamped()
        pose.header.frame_id = inertial_frame_id
        pose.header.stamp = to_stamp(stamp_ns + to_ns(time_s))
        pose.pose.orientation = to_quaternion(R_NB)
        x, y, z = map(float, R_NB @ np.asarray(axis_B))
        pose.pose.position = Point(x=x, y=y, z=z)
        path.poses.append(pose)
    return path


def to_diagnostics(
    stamp_ns: int, name: str, level: bytes, message: str, values: Mapping[str, object],
) -> DiagnosticArray:
    """Return one status as a diagnostic array."""
    array = DiagnosticArray()
    array.header.stamp = to_stamp(stamp_ns)
    pairs: Sequence[KeyValue] = [
        KeyValue(key=key, value=_text(value)) for key, value in values.items()]
    array.status = [DiagnosticStatus(
        level=level, name=name, message=message, hardware_id='', values=pairs)]
    return array


def _text(value: object) -> str:
    """Return a diagnostic value as text; numbers short enough to read."""
    return f'{value:.6g}' if isinstance(value, float) else str(value)
