# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Setpoints and commands as nodes hear them: one described topic each, and what passes the gate.

Each raises ConfigurationError for a message type that is not installed or a field that it lacks.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from manifold_mpc_ros.config.description import command_description, setpoint_description
from manifold_mpc_ros.config.interfaces import message_class, named_by
from manifold_mpc_ros.control.described.command import CommandWriter
from manifold_mpc_ros.control.described.conversions import read_attitude
from manifold_mpc_ros.control.described.fields import WRONG_FIELD, stamp_at, value_at
from manifold_mpc_ros.control.described.source import check_part, read_part
from manifold_mpc_ros.control.input_gate import Reason, Refusal, admit_in_body, admit_setpoint
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array


class DescribedSetpoint:
    """Commanded attitudes of a description, the name of a shipped one or a YAML file."""

    def __init__(self, given: str, inertial_frame_id: str) -> None:
        """Find the type of the messages, `kind`."""
        self._part = setpoint_description(given)
        self.topic, self._inertial_frame_id = self._part.topic, inertial_frame_id
        with named_by('setpoint_source', given):
            self.kind = message_class(self._part.message_type, self._part.install)
            check_part(self._part, self.kind())

    def admit(self, message: Any) -> Array | Refusal:
        """Return the commanded attitude R_ND (3, 3) of a message, or why it must not be used."""
        try:
            read = read_part(self._part, message, 0)
            q_ND = read_attitude(self._part.convention, read.values)
        except (IndexError, *WRONG_FIELD) as error:
            return Refusal(Reason.UNREADABLE, str(error))
        return admit_setpoint(read.inertial_frame_id, q_ND, self._inertial_frame_id)


class DescribedTorque:
    """Body torques of a description, the name of a shipped one or a YAML file."""

    def __init__(
        self, given: str, body_frame_id: str, full_scale_n_m: Sequence[float],
        parameter: str = 'command_sink',
    ) -> None:
        """Find the type of the messages, `kind`."""
        torques = [each for each in command_description(given, parameter)
                   if each.fields and each.quantity == 'body_torque']
        if not torques:
            raise ConfigurationError(parameter, given, 'a description with a body torque')
        self._writer, self._body_frame_id = CommandWriter(
            torques[0], body_frame_id, full_scale_n_m), body_frame_id
        self.topic = torques[0].topic
        with named_by(parameter, given):
            self.kind = message_class(torques[0].message_type, torques[0].install)
            self._writer.check(self.kind())

    def admit(self, message: Any) -> Array | Refusal:
        """Return the body torque (3,) [N m] of a message, or why it must not be used."""
        frame = self._writer.described.body_frame_id
        try:
            torque = self._writer.read(message)
        except (IndexError, *WRONG_FIELD) as error:
            return Refusal(Reason.UNREADABLE, str(error))
        return admit_in_body(
            str(value_at(message, frame)) if frame else None, torque, self._body_frame_id)

    def stamp_ns(self, message: Any) -> int | None:
        """Return the stamp of the state that a message answers [ns], None where it has none."""
        described = self._writer.described
        return stamp_at(message, described.stamp, described.stamp_unit_ns)
