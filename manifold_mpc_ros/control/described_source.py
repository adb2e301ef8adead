# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States from the messages of any stack, by their description; messages are any objects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from manifold_mpc_ros.config.conventions import Quaternion
from manifold_mpc_ros.config.description import (
    AttitudePart,
    Part,
    Stamp,
    StateDescription,
)
from manifold_mpc_ros.config.field_path import Steps, has_field, numbers_at, text_of, value_at
from manifold_mpc_ros.control.input_gate import NANOSECONDS, RawState, Reason, Refusal
from manifold_mpc_ros.errors import ConfigurationError

#: First element of a covariance: the quantity is not provided (REP-145).
NOT_PROVIDED = -1.0
#: Two clocks go apart by no more than this part of the time that passes.
CLOCK_DRIFT = 2e-4
#: A clock that goes back by more has started again [ns]; messages out of order go back too.
LARGEST_STEP_BACK_NS = NANOSECONDS // 10


class ForeignClock:
    """Maps the time of a clock that started at the other computer's boot to ROS time [ns].

    The offset is the smallest difference of receipt and stamp, that of the message with the least
    delay; it may grow by CLOCK_DRIFT.
    """

    def __init__(self) -> None:
        """Start with nothing known."""
        self._latest_ns, self._offset_ns = 0, 0
        self._known = False

    def to_ros_ns(self, foreign_ns: int, received_ns: int) -> int:
        """Map a stamp, of a message that was received at a ROS time [ns]."""
        difference_ns = received_ns - foreign_ns
        if not self._known or foreign_ns < self._latest_ns - LARGEST_STEP_BACK_NS:
            self._offset_ns, self._latest_ns, self._known = difference_ns, foreign_ns, True
        passed_ns = max(0, foreign_ns - self._latest_ns)
        self._latest_ns = max(foreign_ns, self._latest_ns)
        self._offset_ns = min(difference_ns, self._offset_ns + round(CLOCK_DRIFT * passed_ns))
        return foreign_ns + self._offset_ns


@dataclass(frozen=True)
class _Read:
    """The numbers of one part, and its stamp by the clock of the stack [ns]."""

    stamp_ns: int
    received_ns: int
    values: tuple[float, ...]
    there: bool
    inertial_frame_id: str | None
    body_frame_id: str | None


class DescribedSource:
    """Joins the newest attitude and the newest rate whose stamps are near each other.

    Each of the two is part of one state at most; the stamp of the state is that of the attitude.
    """

    def __init__(self, description: StateDescription) -> None:
        """Start with no message."""
        self._description = description
        self.forget()

    def forget(self) -> None:
        """Forget the messages that wait for others, and what is known of another clock."""
        self._attitude: _Read | None = None
        self._rate: _Read | None = None
        self._clock = ForeignClock()

    def read(self, topic: str, message: Any, received_ns: int) -> RawState | Refusal | None:
        """Map a message to the state that it completes, received at a ROS time [ns].

        None while the other message of the state has not come; a Refusal where the message
        cannot be part of one.
        """
        described = self._description
        try:
            if topic == described.attitude.topic:
                self._attitude = _read(described.attitude, message, received_ns)
            if topic == described.rate.topic:
                self._rate = _read(described.rate, message, received_ns)
        except (AttributeError, IndexError, OverflowError, TypeError, ValueError) as error:
            return Refusal(Reason.UNREADABLE, f'{topic}: {error}')
        if self._attitude is None or self._rate is None or abs(
                self._attitude.stamp_ns - self._rate.stamp_ns) > described.join_within_ns:
            return None
        attitude, rate = self._attitude, self._rate
        self._attitude = self._rate = None
        return self._joined(attitude, rate)

    def check(self, topic: str, message: Any) -> None:
        """Raise ConfigurationError where a message of the type of a topic lacks a field."""
        for part in (self._description.attitude, self._description.rate):
            if part.topic == topic:
                check_fields(part, message)

    def _joined(self, attitude: _Read, rate: _Read) -> RawState | Refusal:
        """Return the state of both parts in our conventions."""
        described = self._description
        try:
            q_NB: Quaternion = described.attitude.convention.read(attitude.values)
        except ValueError as error:
            return Refusal(Reason.QUATERNION_NORM, str(error))
        x, y, z = rate.values
        stamp_ns = attitude.stamp_ns
        if described.attitude.stamp.unit_ns:
            stamp_ns = self._clock.to_ros_ns(stamp_ns, attitude.received_ns)
        return RawState(
            stamp_ns, attitude.inertial_frame_id,
            rate.body_frame_id if attitude.body_frame_id is None else attitude.body_frame_id,
            q_NB, described.rate.convention.read((x, y, z), q_NB), attitude.there, rate.there)


def _read(part: Part, message: Any, received_ns: int) -> _Read:
    """Read one part of a state; raises what reading another message raises."""
    return _Read(
        _stamp_ns(part.stamp, message, received_ns), received_ns,
        numbers_at(message, part.fields, part.names),
        not part.absent or value_at(message, part.absent) != NOT_PROVIDED,
        _text(message, part.inertial_frame_id), _text(message, part.body_frame_id))


def read_attitude(
    part: AttitudePart, message: Any,
) -> tuple[str | None, Quaternion] | Refusal:
    """Map a message to its inertial frame, None where none is named, and q_NB as x, y, z, w."""
    try:
        return (_text(message, part.inertial_frame_id),
                part.convention.read(numbers_at(message, part.fields, part.names)))
    except (IndexError, ValueError) as error:
        return Refusal(Reason.UNREADABLE, f'{part.topic}: {error}')


def check_fields(part: Part, message: Any) -> None:
    """Raise ConfigurationError where a message, empty as it is made, lacks a field of a part."""
    for steps in (*part.fields, part.stamp.steps, part.absent, part.inertial_frame_id,
                  part.body_frame_id):
        if not has_field(message, steps):
            raise ConfigurationError(
                part.topic, text_of(steps), f'a field of {part.message_type}')
    try:
        _read(part, message, 0)
    except IndexError:
        return  # a sequence that is empty as yet
    except (AttributeError, TypeError, ValueError) as error:
        raise ConfigurationError(
            part.topic, [text_of(steps) for steps in part.fields],
            f'{len(part.names)} numbers, and a stamp, in {part.message_type} ({error})') from None


def _stamp_ns(stamp: Stamp, message: Any, received_ns: int) -> int:
    """Return the stamp of a message by the clock that it is of [ns]."""
    if not stamp.steps:
        return received_ns
    value = value_at(message, stamp.steps)
    if stamp.unit_ns:
        return round(value * stamp.unit_ns)
    return int(value.sec) * NANOSECONDS + int(value.nanosec)


def _text(message: Any, steps: Steps) -> str | None:
    """Return the text of a field, None where it is not described."""
    return str(value_at(message, steps)) if steps else None
