# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Setpoints and commands as nodes hear them: one described topic each, and what passes the gate.

Each raises ConfigurationError for a message type that is not installed or a field that it lacks.
"""

from __future__ import annotations

from typing import Any

from manifold_mpc_ros.config.checks import FloatArray
from manifold_mpc_ros.config.conventions import Vector
from manifold_mpc_ros.config.description_file import (
    command_description,
    setpoint_description,
)
from manifold_mpc_ros.config.field_path import value_at
from manifold_mpc_ros.config.interfaces import message_class
from manifold_mpc_ros.control.described_command import CommandWriter
from manifold_mpc_ros.control.described_source import check_fields, read_attitude
from manifold_mpc_ros.control.input_gate import (
    Reason,
    Refusal,
    admit_setpoint,
    admit_torque,
)
from manifold_mpc_ros.errors import ConfigurationError


class DescribedSetpoint:
    """Commanded attitudes of a description, the name of a shipped one or a YAML file."""

    def __init__(self, given: str, inertial_frame_id: str) -> None:
        """Find the type of the messages, `kind`."""
        described = setpoint_description(given)
        self._part, self.topic = described.attitude, described.attitude.topic
        self._inertial_frame_id = inertial_frame_id
        self.kind = message_class(self._part.message_type, described.install)
        check_fields(self._part, self.kind())

    def admit(self, message: Any) -> FloatArray | Refusal:
        """Return the commanded attitude R_ND (3, 3) of a message, or why it must not be used."""
        read = read_attitude(self._part, message)
        return read if isinstance(read, Refusal) else admit_setpoint(
            *read, self._inertial_frame_id)


class DescribedTorque:
    """Body torques of a description, the name of a shipped one or a YAML file."""

    def __init__(self, given: str, body_frame_id: str, full_scale_n_m: Vector) -> None:
        """Find the type of the messages, `kind`."""
        described = command_description(given)
        if described.torque is None:
            raise ConfigurationError('command_sink', given, 'a description with a body torque')
        self._message, self.topic = described.torque, described.torque.topic
        self._body_frame_id = body_frame_id
        self._writer = CommandWriter(self._message, body_frame_id, full_scale_n_m)
        self.kind = message_class(self._message.message_type, described.install)
        self._writer.check(self.kind())

    def admit(self, message: Any) -> FloatArray | Refusal:
        """Return the body torque (3,) [N m] of a message, or why it must not be used."""
        frame = self._message.body_frame_id
        try:
            torque = self._writer.read(message)
        except (IndexError, ValueError) as error:
            return Refusal(Reason.UNREADABLE, f'{self.topic}: {error}')
        return admit_torque(
            str(value_at(message, frame)) if frame else None, torque, self._body_frame_id)
