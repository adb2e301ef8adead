# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The gate at the door: which messages may be acted on, decided on their plain values.

Nothing here knows ROS or a clock. Every refusal has a reason that is counted, and a sentence that
says what was wrong; quaternions arrive as x, y, z, w and leave as rotation matrices.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]

NANOSECONDS = 1_000_000_000

#: A quaternion whose norm is off by more is refused, the others are normalised.
QUATERNION_NORM_TOLERANCE = 1e-2
#: The least time that a stamp may lie ahead of the clock [s].
SHORTEST_FUTURE_TOLERANCE_S = 0.01
#: Stamps that are older, or lie farther ahead, are of another clock [s].
LONGEST_AGE_OF_ONE_CLOCK_S = 86400.0


def to_ns(seconds: float) -> int:
    """Return seconds in whole nanoseconds."""
    return round(seconds * NANOSECONDS)


class Reason(str, Enum):
    """Why a message was refused."""

    NON_FINITE = 'non_finite'
    ZERO_DIRECTION = 'zero_direction'
    QUATERNION_NORM = 'quaternion_norm'
    WRONG_FRAME = 'wrong_frame'
    NO_ATTITUDE = 'no_attitude'
    NO_RATE = 'no_rate'
    INVALID_STAMP = 'invalid_stamp'
    DUPLICATE = 'duplicate'
    OUT_OF_ORDER = 'out_of_order'
    FUTURE = 'future'
    STALE = 'stale'
    UNEXPECTED_ANSWER = 'unexpected_answer'
    UNREADABLE = 'unreadable'
    TOO_FAST = 'too_fast'


@dataclass(frozen=True)
class Refusal:
    """A message that must not be acted on: the reason to count, the sentence for people."""

    reason: Reason
    detail: str


@dataclass(frozen=True)
class RawState:
    """One state as a source read it from its message or messages: complete, but unchecked.

    ``stamp_ns`` [ns]; the attitude as x, y, z, w, body to inertial; the rate of the body in body
    components [rad/s]. A frame that the source does not name is None. ``has_attitude`` and
    ``has_rate`` are false where the message itself says that it has none (REP-145).
    """

    stamp_ns: int
    inertial_frame_id: str | None
    body_frame_id: str | None
    quaternion_xyzw: Quaternion
    omega_BN_B: Vector
    has_attitude: bool = True
    has_rate: bool = True


@dataclass(frozen=True)
class StateSample:
    """One complete state that may be acted on, whatever source it comes from.

    ``stamp_ns`` is when it was true [ns], by the clock of the stamps; R_NB (3, 3) maps body to
    inertial components; omega_BN_B (3,) is the body rate [rad/s]; ``received_ns`` is when it
    came [ns], by a monotonic clock, None where only the stamp tells its age.
    """

    stamp_ns: int
    R_NB: Array
    omega_BN_B: Array
    received_ns: int | None = None


class StateGate:
    """Admits states whose every field is usable, in the order of their stamps.

    Arguments
    ---------
    inertial_frame_id, body_frame_id
        The frames that a message has to name, exactly.
    step_s, timeout_s
        Control step, and the age above which a state is stale [s].
    timed
        False in lockstep: stamps are then the simulator's own time, which no clock here follows,
        and any step back in them is a new start.

    """

    def __init__(
        self, inertial_frame_id: str, body_frame_id: str, *, step_s: float, timeout_s: float,
        timed: bool,
    ) -> None:
        """Start with no state seen."""
        self._frames = (inertial_frame_id, body_frame_id)
        self._timed = timed
        self.set_timeout(timeout_s)
        self._future_ns = to_ns(max(step_s / 2.0, SHORTEST_FUTURE_TOLERANCE_S))
        self.forget()

    def set_timeout(self, timeout_s: float) -> None:
        """Set the age above which a state is stale [s]."""
        self._timeout_ns = to_ns(timeout_s)

    def forget(self) -> None:
        """Forget the order of stamps, as at the start."""
        self._last_ns: int | None = None
        self.restarted = False

    def admit(
        self, raw: RawState, now_ns: int, received_ns: int | None = None,
    ) -> StateSample | Refusal:
        """Return the checked state, or why it must not be used.

        ``now_ns`` is the clock of the stamps [ns], ``received_ns`` when the state came [ns].

        Sets ``restarted`` when time has jumped back by more than the timeout (a bag that loops, a
        simulator that was started again): what was kept from before is then void.
        """
        refusal = (
            _wrong_frame(raw.body_frame_id, self._frames[1], 'body')
            or _wrong_frame(raw.inertial_frame_id, self._frames[0], 'inertial')
            or _absent(raw)
            or _bad_quaternion(raw.quaternion_xyzw)
            or not_finite(raw.omega_BN_B, 'body rate')
            or self._bad_stamp(raw.stamp_ns, now_ns)
        )
        if refusal is not None:
            return refusal
        self.restarted = self._last_ns is not None and raw.stamp_ns < self._last_ns
        self._last_ns = raw.stamp_ns
        omega_BN_B = np.array(raw.omega_BN_B, dtype=np.float64)
        return StateSample(
            raw.stamp_ns, _rotation(raw.quaternion_xyzw), omega_BN_B, received_ns)

    def _bad_stamp(self, stamp_ns: int, now_ns: int) -> Refusal | None:
        """Return why a stamp cannot be trusted, None when it can."""
        if stamp_ns <= 0:
            return Refusal(Reason.INVALID_STAMP, 'the stamp is zero or negative')
        age_ns = now_ns - stamp_ns
        if self._timed and age_ns < -self._future_ns:
            return Refusal(Reason.FUTURE, _age(-age_ns, 'ahead'))
        if self._timed and age_ns > self._timeout_ns:
            return Refusal(Reason.STALE, _age(age_ns, 'old'))
        if self._last_ns is None or stamp_ns > self._last_ns:
            return None
        if stamp_ns == self._last_ns:
            return Refusal(Reason.DUPLICATE, 'the stamp has been seen before')
        if self._timed and self._last_ns - stamp_ns <= self._timeout_ns:
            return Refusal(Reason.OUT_OF_ORDER, 'a later stamp has been seen before')
        return None


def admit_setpoint(
    frame_id: str | None, quaternion_xyzw: Quaternion, inertial_frame_id: str,
) -> Array | Refusal:
    """Return the commanded attitude R_ND of a setpoint, or why it must not be used."""
    refusal = (_wrong_frame(frame_id, inertial_frame_id, 'inertial')
               or _bad_quaternion(quaternion_xyzw))
    return _rotation(quaternion_xyzw) if refusal is None else refusal


def admit_direction(
    frame_id: str, direction_N: Vector, inertial_frame_id: str,
) -> Array | Refusal:
    """Return the commanded direction as a unit vector, or why it must not be used.

    Any length will do that has a direction: a vector to a target is one, the zero vector is none.
    """
    refusal = (_wrong_frame(frame_id, inertial_frame_id, 'inertial')
               or not_finite(direction_N, 'direction'))
    if refusal is not None:
        return refusal
    largest = max(map(abs, direction_N))
    if largest == 0.0:
        return Refusal(Reason.ZERO_DIRECTION, 'the zero vector has no direction')
    scaled = np.array(direction_N) / largest  # neither overflow nor underflow in the norm
    return scaled / np.linalg.norm(scaled)


def admit_in_body(
    frame_id: str | None, vector_B: Vector, body_frame_id: str, what: str = 'torque',
) -> Array | Refusal:
    """Return a vector in body axes, a torque at the plant for one, or why it must not be used."""
    refusal = (_wrong_frame(frame_id, body_frame_id, 'body')
               or not_finite(vector_B, what))
    return np.array(vector_B, dtype=np.float64) if refusal is None else refusal


def _age(age_ns: int, which: str) -> str:
    """Say how old a stamp is, or how far ahead."""
    age_s = age_ns / NANOSECONDS
    another = age_s > LONGEST_AGE_OF_ONE_CLOCK_S
    return f'the stamp is {age_s:.3f} s {which}' + (
        ', by another clock than the one here: see use_sim_time of both' if another else '')


def _wrong_frame(frame_id: str | None, expected: str, which: str) -> Refusal | None:
    """Refuse another frame than the expected one; None is a message without that field."""
    if frame_id is None or frame_id == expected:
        return None
    return Refusal(Reason.WRONG_FRAME, f'{which} frame is {frame_id!r}, expected {expected!r}')


def _absent(raw: RawState) -> Refusal | None:
    """Refuse a message that says itself that it has no attitude or no rate (REP-145)."""
    if not raw.has_attitude:
        return Refusal(Reason.NO_ATTITUDE, 'orientation_covariance[0] is -1: no attitude')
    if not raw.has_rate:
        return Refusal(Reason.NO_RATE, 'angular_velocity_covariance[0] is -1: no rate')
    return None


def not_finite(values: Sequence[float], what: str) -> Refusal | None:
    """Refuse NaN and infinities."""
    if all(map(math.isfinite, values)):
        return None
    return Refusal(Reason.NON_FINITE, f'{what} {tuple(values)} is not finite')


def _bad_quaternion(quaternion_xyzw: Quaternion) -> Refusal | None:
    """Refuse a quaternion that is not finite, or whose norm is off by more than 1e-2."""
    refusal = not_finite(quaternion_xyzw, 'quaternion')
    norm = math.hypot(*quaternion_xyzw)
    if refusal is None and abs(norm - 1.0) > QUATERNION_NORM_TOLERANCE:
        return Refusal(Reason.QUATERNION_NORM, f'the norm of the quaternion is {norm:.6g}')
    return refusal


def _rotation(quaternion_xyzw: Quaternion) -> Array:
    """Return the rotation of a quaternion x, y, z, w; q and -q give the same bits."""
    x, y, z, w = quaternion_xyzw
    return so3.rotation_from_quaternion([w, x, y, z])
