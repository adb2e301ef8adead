# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a description of a stack's messages says: topics, types, fields and conventions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from manifold_mpc_ros.config import conventions as to
from manifold_mpc_ros.config.field_path import Steps

RECEIPT = 'receipt'
#: What a message of a command says, and in which unit.
BODY_TORQUE = 'body_torque'
QUANTITIES = (BODY_TORQUE, 'device')
TORQUE_UNITS = ('N m', 'normalised')


@dataclass(frozen=True)
class Stamp:
    """Where a stamp is: no path: on receipt; no unit: a time; else a number of the unit [ns]."""

    steps: Steps = ()
    unit_ns: int = 0

    @property
    def kind(self) -> str:
        """What it is, in words."""
        return 'a number' if self.unit_ns else 'a time' if self.steps else RECEIPT


@dataclass(frozen=True)
class Part:
    """One quantity in the messages of one topic; an empty path is a field that is not there.

    ``absent`` is a field that is -1 where the quantity is not there (REP-145).
    """

    topic: str
    message_type: str
    fields: tuple[Steps, ...]
    stamp: Stamp
    absent: Steps
    inertial_frame_id: Steps
    body_frame_id: Steps

    @property
    def names(self) -> str:
        """One character for each number."""
        return 'xyz'


@dataclass(frozen=True)
class AttitudePart(Part):
    """An attitude in messages."""

    convention: to.AttitudeConvention

    @property
    def names(self) -> str:
        """One character for each number."""
        return to.FORMS[self.convention.form]


@dataclass(frozen=True)
class RatePart(Part):
    """A body rate in messages."""

    convention: to.RateConvention


@dataclass(frozen=True)
class StateDescription:
    """Attitude and rate, of one message or of two whose stamps are within ``join_within_ns``.

    ``install`` says how to get message packages.
    """

    attitude: AttitudePart
    rate: RatePart
    join_within_ns: int
    install: Mapping[str, str]

    @property
    def topics(self) -> dict[str, str]:
        """The type of the messages on each topic."""
        return {part.topic: part.message_type for part in (self.attitude, self.rate)}


@dataclass(frozen=True)
class SetpointDescription:
    """A commanded attitude in messages of one topic; ``install`` as above."""

    attitude: AttitudePart
    install: Mapping[str, str]


@dataclass(frozen=True)
class CommandMessage:
    """What the messages of one topic say of a command; without ``fields`` no number of it.

    ``quantity`` is the body torque or the command to the devices. A normalised torque is divided
    by the full scale. ``stamp`` is that of the state that is answered, ``sent`` when the message
    is published; both in the unit that a `Stamp` has. A message with a period comes by itself.
    """

    topic: str
    message_type: str
    fields: tuple[Steps, ...]
    quantity: str
    normalised: bool
    body: to.Axes | None
    stamp: Stamp
    sent: Stamp
    body_frame_id: Steps
    constants: tuple[tuple[Steps, bool | int | float | str], ...]
    period_s: float


@dataclass(frozen=True)
class CommandDescription:
    """The messages of a command; ``install`` as above."""

    messages: tuple[CommandMessage, ...]
    install: Mapping[str, str]

    @property
    def normalised(self) -> bool:
        """Whether a torque is divided by the full scale."""
        return any(message.normalised for message in self.messages)

    @property
    def torque(self) -> CommandMessage | None:
        """The message that has the body torque, None where none has it."""
        return next((message for message in self.messages
                     if message.fields and message.quantity == BODY_TORQUE), None)
