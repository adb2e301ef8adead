# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States from the messages of any stack, by their description; messages are any objects."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from manifold_mpc_ros.config.description import Part, StateDescription, Steps
from manifold_mpc_ros.control.described.conversions import read_attitude, read_rate
from manifold_mpc_ros.control.described.fields import (
    WRONG_FIELD,
    number_paths,
    numbers_at,
    stamp_at,
    stamp_paths,
    value_at,
)
from manifold_mpc_ros.control.input_gate import NANOSECONDS, RawState, Reason, Refusal
from manifold_mpc_ros.errors import ConfigurationError

#: First element of a covariance: the quantity is not provided (REP-145).
NOT_PROVIDED = -1.0
#: Two clocks go apart by no more than this part of the time that passes.
CLOCK_DRIFT = 2e-4
#: A clock that is not farther from ROS time at first is ROS time [ns].
NEAR_NS = NANOSECONDS
#: A clock that goes back by more has started again [ns]; messages out of order go back too.
LARGEST_STEP_BACK_NS = NANOSECONDS // 10
#: So many messages of either topic wait for the other's, as many as queues of inputs hold.
WAITING = 10


class ForeignClock:
    """Maps the time of another computer's clock to ROS time [ns].

    One that starts near ROS time is ROS time, as of an agent that synchronises, or of one
    simulation. Else, of a clock from boot on, the offset is the smallest difference of receipt
    and stamp, that of the message with the least delay; it may grow by CLOCK_DRIFT.
    """

    def __init__(self) -> None:
        """Start with nothing known."""
        self._latest_ns: int | None = None
        self._offset_ns = 0
        self._same = False

    def to_ros_ns(self, foreign_ns: int, received_ns: int) -> int:
        """Map a stamp, of a message that was received at a ROS time [ns].

        A simulated clock that has not begun, at 0, tells nothing: the stamp stays as it is.
        """
        if not received_ns:
            return foreign_ns
        difference_ns, latest_ns = received_ns - foreign_ns, self._latest_ns
        if latest_ns is None or foreign_ns < latest_ns - LARGEST_STEP_BACK_NS:
            self._offset_ns, latest_ns = difference_ns, foreign_ns
            self._same = abs(difference_ns) < NEAR_NS
        self._same = self._same and abs(difference_ns) < 2 * NEAR_NS
        passed_ns = max(0, foreign_ns - latest_ns)
        self._latest_ns = latest_ns + passed_ns
        self._offset_ns = min(difference_ns, self._offset_ns + round(CLOCK_DRIFT * passed_ns))
        return foreign_ns if self._same else foreign_ns + self._offset_ns


@dataclass(frozen=True)
class ReadPart:
    """What a message says of a part of a state: numbers, frames, stamp by its own clock [ns]."""

    stamp_ns: int
    received_ns: int
    values: tuple[float, ...]
    there: bool
    inertial_frame_id: str | None
    body_frame_id: str | None


class DescribedSource:
    """Joins the newest attitude and the newest rate whose stamps are near each other.

    Each of the two is part of one state at most; the stamp of the state is that of the attitude.
    Some of each wait for the other: two full queues of a reader that lags do not begin with the
    same state.
    """

    def __init__(self, description: StateDescription) -> None:
        """Start with no message."""
        self._description = description
        self.forget()

    def forget(self) -> None:
        """Forget the messages that wait for others, and what is known of another clock."""
        self._attitudes: list[ReadPart] = []
        self._rates: list[ReadPart] = []
        self._clock = ForeignClock()

    def parts(self, topic: str) -> list[Part]:
        """Return what is read of the messages of a topic."""
        both = self._description.attitude, self._description.rate
        return [part for part in both if part.topic == topic]

    def read(self, topic: str, message: Any, received_ns: int) -> RawState | Refusal | None:
        """Map a message to the state that it completes, received at a ROS time [ns].

        None while the other message of the state has not come; a Refusal where the message
        cannot be part of one.
        """
        return self._join(topic, lambda part: read_part(part, message, received_ns))

    def read_numbers(
        self, topic: str, given: Iterable[tuple[Sequence[float], ReadPart]], received_ns: int,
    ) -> RawState | Refusal | None:
        """Do the same with the numbers of a message, as `part_of` takes them, of each of `parts`.

        With the numbers of a part comes what `read_part` made of a message with the same frames.
        """
        each = iter(given)
        return self._join(topic, lambda part: part_of(part, *next(each), received_ns))

    def _join(self, topic: str, read: Callable[[Part], ReadPart]) -> RawState | Refusal | None:
        """Take the parts that a message of a topic has; return the state that they complete."""
        described = self._description
        try:
            if topic == described.attitude.topic:
                self._attitudes.append(read(described.attitude))
            if topic == described.rate.topic:
                self._rates.append(read(described.rate))
        except (IndexError, *WRONG_FIELD) as error:
            return Refusal(Reason.UNREADABLE, f'{topic}: {error}')
        del self._attitudes[:-WAITING], self._rates[:-WAITING]
        pair = self._pair()
        return None if pair is None else self._joined(*pair)

    def _pair(self) -> tuple[ReadPart, ReadPart] | None:
        """Take the newest two that are near each other; those before them wait no longer."""
        for i, attitude in reversed(list(enumerate(self._attitudes))):
            for k, rate in reversed(list(enumerate(self._rates))):
                if abs(attitude.stamp_ns - rate.stamp_ns) <= self._description.join_within_ns:
                    del self._attitudes[:i + 1], self._rates[:k + 1]
                    return attitude, rate
        return None

    def _joined(self, attitude: ReadPart, rate: ReadPart) -> RawState | Refusal:
        """Return the state of both parts in our conventions."""
        described, stamp_ns = self._description, attitude.stamp_ns
        if described.attitude.stamp_unit_ns:
            stamp_ns = self._clock.to_ros_ns(stamp_ns, attitude.received_ns)
        try:
            q_NB = read_attitude(described.attitude.convention, attitude.values)
            x, y, z = rate.values
            omega_BN_B = read_rate(described.rate.convention, (x, y, z), q_NB)
        except ValueError as error:
            return Refusal(Reason.QUATERNION_NORM, str(error))
        return RawState(
            stamp_ns, attitude.inertial_frame_id,
            rate.body_frame_id if attitude.body_frame_id is None else attitude.body_frame_id,
            q_NB, omega_BN_B, attitude.there, rate.there)


def read_part(part: Part, message: Any, received_ns: int) -> ReadPart:
    """Read one part of a state; raises IndexError and what is in WRONG_FIELD."""
    stamp_ns = stamp_at(message, part.stamp, part.stamp_unit_ns)
    return ReadPart(
        received_ns if stamp_ns is None else stamp_ns, received_ns,
        numbers_at(message, part.fields, part.convention.names),
        not part.absent or value_at(message, part.absent) != NOT_PROVIDED,
        _text(message, part.inertial_frame_id), _text(message, part.body_frame_id))


def part_paths(part: Part, message: Any) -> list[Steps]:
    """Return the path of each number that `read_part` reads: values, stamp, what tells absence."""
    paths = (*number_paths(message, part.fields, part.convention.names),
             *stamp_paths(message, part.stamp), part.absent)
    return [steps for steps in paths if steps]


def part_of(part: Part, numbers: Sequence[float], like: ReadPart, received_ns: int) -> ReadPart:
    """Return what `read_part` does, of the numbers of `part_paths`, with frames of another."""
    count, stamp_ns, there = len(part.convention.names), received_ns, True
    if part.stamp and part.stamp_unit_ns:
        stamp_ns = round(numbers[count] * part.stamp_unit_ns)
    elif part.stamp:
        stamp_ns = int(numbers[count]) * NANOSECONDS + int(numbers[count + 1])
    if part.absent:
        there = numbers[-1] != NOT_PROVIDED
    return ReadPart(stamp_ns, received_ns, tuple(map(float, numbers[:count])), there,
                    like.inertial_frame_id, like.body_frame_id)


def check_part(part: Part, message: Any) -> None:
    """Raise ConfigurationError where a message, empty as it is made, lacks a field of a part."""
    try:
        read_part(part, message, 0)
    except IndexError:
        return  # an element of a sequence that is empty as yet
    except WRONG_FIELD as error:
        raise ConfigurationError(
            part.topic, part.message_type, f'a type with the fields described ({error})',
        ) from None


def _text(message: Any, steps: Steps) -> str | None:
    """Return the text of a field, None where it is not described."""
    return str(value_at(message, steps)) if steps else None
