# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which messages of moving targets may be followed, decided on their plain values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from manifold_mpc_ros.control.input_gate import (
    LONGEST_AGE_OF_ONE_CLOCK_S,
    NANOSECONDS,
    Quaternion,
    Reason,
    Refusal,
    Vector,
    admit_setpoint,
    not_finite,
    to_ns,
)
from manifold_mpc_ros.control.moving.trajectory import Trajectory
from manifold_mpc_ros.lie.arrays import Array

#: A setpoint that turns by more than this while a plan sees it is a mistake [rad].
LARGEST_VIEW_RAD = 1000.0


class Point(NamedTuple):
    """A point of a trajectory: time after its stamp [ns], attitude x, y, z, w, rate, acceleration.

    Rate and acceleration in the axes of the target [rad/s, rad/s^2]; None where there is none.
    """

    after_ns: int
    quaternion_xyzw: Quaternion
    rate: Vector | None
    acceleration: Vector | None


class Frame(NamedTuple):
    """What a message is checked against: the inertial frame, and the time [ns] if it is known."""

    frame_id: str
    now_ns: int | None


def admit_trajectory(
    frame_id: str, stamp_ns: int, points: Sequence[Point], against: Frame,
) -> Trajectory | Refusal:
    """Return the trajectory of a message, or why it must not be followed; stamp 0 is now."""
    begin_ns = stamp_ns or against.now_ns
    if begin_ns is None:
        return Refusal(Reason.INVALID_STAMP, 'the stamp is zero, and no state has said the time')
    if not points:
        return Refusal(Reason.UNREADABLE, 'there is no point with one transform')
    attitudes: list[Array] = []
    for index, point in enumerate(points):
        refused = _point(index, point, frame_id, against.frame_id)
        if isinstance(refused, Refusal):
            return refused
        attitudes.append(refused)
    after_ns = np.array([point.after_ns for point in points], dtype=np.int64)
    if after_ns[0] < 0 or (np.diff(after_ns) <= 0).any():
        return Refusal(Reason.INVALID_STAMP, 'time_from_start is negative or does not grow')
    rates = np.array([point.rate for point in points], dtype=np.float64)
    given = [point.acceleration for point in points if point.acceleration is not None]
    alpha = np.array(given, dtype=np.float64) if len(given) == len(points) else None
    return (_too_fast(rates, alpha, np.diff(after_ns)[:, None] / NANOSECONDS)
            or _in_time(begin_ns, begin_ns + int(after_ns[-1]), against.now_ns)
            or Trajectory(begin_ns + after_ns, np.array(attitudes), rates, alpha))


def admit_moving(
    frame_id: str, stamp_ns: int, quaternion_xyzw: Quaternion, rate: Vector, against: Frame, *,
    valid_s: float, seen_s: float,
) -> Trajectory | Refusal:
    """Return the trajectory of a setpoint with a rate (`Trajectory.at_rate`), or what is wrong.

    ``rate`` is in the axes of the target [rad/s]; stamp 0 is now.
    """
    begin_ns = stamp_ns or against.now_ns
    if begin_ns is None:
        return Refusal(Reason.INVALID_STAMP, 'the stamp is zero, and no state has said the time')
    R_ND = _point(0, Point(0, quaternion_xyzw, rate, None), frame_id, against.frame_id)
    if isinstance(R_ND, Refusal):
        return R_ND
    if not np.abs(rate).max() * seen_s < LARGEST_VIEW_RAD:
        return Refusal(Reason.TOO_FAST, f'the rate {rate} turns it by {LARGEST_VIEW_RAD:g} rad '
                                        'or more within a horizon')
    return _in_time(begin_ns, begin_ns + to_ns(valid_s), against.now_ns) or (
        Trajectory.at_rate(begin_ns, R_ND, np.array(rate, dtype=np.float64), valid_s=valid_s,
                           seen_s=seen_s))


def _point(index: int, point: Point, frame_id: str, expected: str) -> Array | Refusal:
    """Return the attitude of a point, or what is wrong with it."""
    if point.rate is None:
        return Refusal(Reason.NO_RATE, f'point {index} has no angular velocity')
    return (not_finite(point.rate, f'rate of point {index}')
            or not_finite(point.acceleration or (), f'acceleration of point {index}')
            or admit_setpoint(frame_id, point.quaternion_xyzw, expected))


def _too_fast(rates: Array, alpha: Array | None, T: Array) -> Refusal | None:
    """Refuse points that are half a turn apart or more, T [s], at their rates or accelerations."""
    turns = np.abs((rates[1:] + rates[:-1]) / 2.0 * T).max(axis=1)
    if alpha is not None:
        turns = np.maximum(turns, np.maximum(
            np.abs(alpha[1:]), np.abs(alpha[:-1])).max(axis=1) / 2.0 * T[:, 0] ** 2)
    if (turns < np.pi).all():
        return None
    first = int(np.argmax(turns))
    return Refusal(Reason.TOO_FAST, f'points {first} and {first + 1} are half a turn apart or '
                                    'more about an axis at their rates')


def _in_time(begin_ns: int, end_ns: int, now_ns: int | None) -> Refusal | None:
    """Refuse what is over already, and what begins by another clock."""
    if now_ns is None:
        return None
    if end_ns < now_ns:
        return Refusal(Reason.STALE, f'it was over {(now_ns - end_ns) / NANOSECONDS:.3f} s ago')
    ahead_s = (begin_ns - now_ns) / NANOSECONDS
    if ahead_s > LONGEST_AGE_OF_ONE_CLOCK_S:
        return Refusal(Reason.FUTURE, f'it begins {ahead_s:.0f} s ahead, by another clock')
    return None
