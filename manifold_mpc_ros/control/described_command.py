# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Commands in the messages of any stack, by their description; messages are any objects.

A normalised torque is the torque about each body axis of the stack, divided by the full scale of
that axis (3 numbers [N m]).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from manifold_mpc_ros.config.conventions import Vector
from manifold_mpc_ros.config.description import (
    BODY_TORQUE,
    CommandMessage,
    Stamp,
)
from manifold_mpc_ros.config.field_path import (
    has_field,
    numbers_at,
    put,
    put_numbers,
    text_of,
    value_at,
)
from manifold_mpc_ros.control.actuator import Actuation
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.errors import ConfigurationError


@dataclass(frozen=True)
class CommandWriter:
    """Fills the messages of one topic; ``full_scale_n_m`` is of the axes of the stack."""

    described: CommandMessage
    body_frame_id: str
    full_scale_n_m: Vector

    def __post_init__(self) -> None:
        """Raise ConfigurationError where the full scale is needed and not given."""
        if self.described.normalised and not np.isfinite(self.full_scale_n_m).all():
            raise ConfigurationError(
                'full_scale_torque_n_m', list(self.full_scale_n_m),
                f'the torque that is 1 on {self.described.topic}, about each body axis there')

    def fill(
        self, message: Any, stamp_ns: int, sent_ns: int, actuation: Actuation | None,
    ) -> Any:
        """Put a command, or what comes without one, into a message; return the message.

        ``stamp_ns`` is the stamp of the state that is answered, ``sent_ns`` the time now [ns].
        """
        described = self.described
        for steps, value in described.constants:
            put(message, steps, value)
        _put_stamp(message, described.stamp, stamp_ns)
        _put_stamp(message, described.sent, sent_ns)
        if described.body_frame_id:
            put(message, described.body_frame_id, self.body_frame_id)
        if actuation is not None and described.quantity == BODY_TORQUE:
            put_numbers(message, described.fields, 'xyz', self._torque(actuation))
        elif actuation is not None:
            put_numbers(message, described.fields, '', actuation.device.tolist())
        return message

    def read(self, message: Any) -> Vector:
        """Map a message to the body torque in it [N m]; inverse of `fill`."""
        torque = numbers_at(message, self.described.fields, 'xyz')
        if self.described.normalised:
            torque = tuple(part * full for part, full in zip(
                torque, self.full_scale_n_m, strict=True))
        x, y, z = torque
        return (x, y, z) if self.described.body is None else self.described.body.to_ours((x, y, z))

    def check(self, message: Any) -> None:
        """Raise ConfigurationError where a message, empty as it is made, lacks a field."""
        described = self.described
        for steps in (*described.fields, described.stamp.steps, described.sent.steps,
                      described.body_frame_id, *(steps for steps, _ in described.constants)):
            if not has_field(message, steps):
                raise ConfigurationError(
                    described.topic, text_of(steps), f'a field of {described.message_type}')
        zero = Actuation(np.zeros(3), np.zeros(3), np.zeros(3)) if (
            described.fields and described.quantity == BODY_TORQUE) else None
        try:
            self.fill(message, 0, 0, zero)
        except (AssertionError, AttributeError, IndexError, TypeError, ValueError) as error:
            raise ConfigurationError(
                described.topic, [text_of(steps) for steps in described.fields],
                f'fields of {described.message_type} for what is put there ({error})') from None

    def _torque(self, actuation: Actuation) -> Vector:
        """Return the torque as the stack says it."""
        x, y, z = actuation.torque_B_n_m.tolist()
        if self.described.body is not None:
            x, y, z = self.described.body.to_theirs((x, y, z))
        if not self.described.normalised:
            return (x, y, z)
        a, b, c = self.full_scale_n_m
        return (x / a, y / b, z / c)


def _put_stamp(message: Any, stamp: Stamp, time_ns: int) -> None:
    """Put a time [ns] where the description says."""
    if stamp.unit_ns:
        value = time_ns / stamp.unit_ns
        whole = isinstance(value_at(message, stamp.steps), int)
        put(message, stamp.steps, time_ns // stamp.unit_ns if whole else value)
    elif stamp.steps:
        time = value_at(message, stamp.steps)
        time.sec, time.nanosec = divmod(time_ns, NANOSECONDS)
