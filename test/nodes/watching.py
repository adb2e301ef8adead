# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the tests look at: attitude errors, settling, diagnostics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import Quaternion
from harness import stamp_ns
from nav_msgs.msg import Odometry

from manifold_mpc_ros.lie import so3

IDENTITY = (0.0, 0.0, 0.0, 1.0)
SETTLED_RAD = math.radians(0.1)
SETTLED_RAD_S = 1e-3


def attitude(quaternion: Quaternion) -> np.ndarray:
    """Return the rotation matrix of a quaternion message."""
    return so3.rotation_from_quaternion(
        [quaternion.w, quaternion.x, quaternion.y, quaternion.z])


def error_rad(message: Odometry, target_xyzw: Sequence[float] = IDENTITY) -> float:
    """Return the angle between a measured attitude and a target."""
    x, y, z, w = target_xyzw
    R_ND = so3.rotation_from_quaternion([w, x, y, z])
    return float(so3.angle(R_ND.T @ attitude(message.pose.pose.orientation)))


def rate_rad_s(message: Odometry) -> np.ndarray:
    """Return the measured body rate."""
    rate = message.twist.twist.angular
    return np.array([rate.x, rate.y, rate.z])


def is_settled(
    states: list[Odometry], target_xyzw: Sequence[float] = IDENTITY, duration_s: float = 5.0,
) -> bool:
    """Whether the last states, over ``duration_s`` of simulated time, are all at the target."""
    if not states or stamp_ns(states[-1]) - stamp_ns(states[0]) < duration_s * 1e9:
        return False
    since = stamp_ns(states[-1]) - duration_s * 1e9
    for state in reversed(states):
        if stamp_ns(state) < since:
            return True
        if not is_at(state, target_xyzw):
            return False
    return False


def is_at(state: Odometry, target_xyzw: Sequence[float]) -> bool:
    """Whether a state is within 0.1 degree and 1e-3 rad/s of rest at the target."""
    return (error_rad(state, target_xyzw) < SETTLED_RAD
            and float(np.linalg.norm(rate_rad_s(state))) < SETTLED_RAD_S)


def settling_time_s(states: list[Odometry], target_xyzw: Sequence[float] = IDENTITY) -> float:
    """Return simulated time from the first state to the last one that is not at the target."""
    late = [state for state in states if not is_at(state, target_xyzw)]
    return (stamp_ns(late[-1]) - stamp_ns(states[0])) / 1e9 if late else 0.0


def values_of(diagnostics: list[Any], node: str) -> dict[str, str]:
    """Return the latest values that a node put on /diagnostics, its message under 'message'."""
    for array in reversed(diagnostics):
        for status in array.status:
            if status.name == node:
                return {'message': status.message,
                        **{pair.key: pair.value for pair in status.values}}
    return {}
