# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Commands in the messages of any stack, by their description; messages are any objects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from manifold_mpc_ros.config.conventions import Vector
from manifold_mpc_ros.config.description import CommandMessage, Steps
from manifold_mpc_ros.control.actuator import Actuation
from manifold_mpc_ros.control.described.conversions import to_ours, to_theirs
from manifold_mpc_ros.control.described.fields import (
    WRONG_FIELD,
    number_paths,
    numbers_at,
    put,
    put_numbers,
    put_stamp,
    stamp_numbers,
    stamp_paths,
    value_at,
)
from manifold_mpc_ros.errors import ConfigurationError


class CommandWriter:
    """Fills the messages of one topic.

    Arguments
    ---------
    described
        What they say.
    body_frame_id
        The frame of the spacecraft body.
    full_scale_n_m
        Torque about each body axis of the stack that is 1 where normalised (1 or 3) [N m].

    Raises ConfigurationError where the full scale is needed and not given.

    """

    def __init__(
        self, described: CommandMessage, body_frame_id: str, full_scale_n_m: Sequence[float],
    ) -> None:
        """Keep what is needed."""
        self.described, self._body_frame_id = described, body_frame_id
        scale = np.broadcast_to(full_scale_n_m, 3) if described.normalised else np.ones(3)
        self._scale = scale.tolist()
        if not (np.isfinite(scale).all() and (scale > 0.0).all()):
            raise ConfigurationError(
                'full_scale_torque_n_m', list(full_scale_n_m),
                f'the torque that is 1 on {described.topic}, about each body axis there')

    def fill(
        self, message: Any, stamp_ns: int, sent_ns: int, actuation: Actuation | None,
    ) -> Any:
        """Put a command, or what comes without one, into a message; return the message.

        ``stamp_ns`` is the stamp of the state that is answered, ``sent_ns`` the time now [ns].
        """
        described = self.described
        for steps, value in described.constants.items():
            put(message, steps, value)
        for steps, time_ns in ((described.stamp, stamp_ns), (described.sent, sent_ns)):
            put_stamp(message, steps, described.stamp_unit_ns, time_ns)
        if described.body_frame_id:
            put(message, described.body_frame_id, self._body_frame_id)
        if actuation is not None and described.fields:
            put_numbers(message, described.fields, self._names, self._values(actuation))
        return message

    def paths(self, message: Any) -> list[Steps]:
        """Return the paths of the numbers that `fill` puts into every message.

        Raises ValueError for those of devices, which may be any number of them.
        """
        described = self.described
        if not self._names:
            raise ValueError(described.quantity)
        return [*stamp_paths(message, described.stamp), *stamp_paths(message, described.sent),
                *number_paths(message, described.fields, self._names)]

    def numbers(self, message: Any, stamp_ns: int, sent_ns: int, actuation: Actuation
                ) -> list[float]:
        """Return the numbers of `paths`."""
        described, unit_ns = self.described, self.described.stamp_unit_ns
        return [*stamp_numbers(message, described.stamp, unit_ns, stamp_ns),
                *stamp_numbers(message, described.sent, unit_ns, sent_ns),
                *self._values(actuation)]

    @property
    def _names(self) -> str:
        """The names of the numbers; those of devices have none, and may be any number."""
        return '' if self.described.quantity == 'device' else 'xyz'

    def _values(self, actuation: Actuation) -> list[float]:
        """Return the numbers of a command."""
        described = self.described
        if described.quantity == 'device':
            return actuation.device.tolist()
        x, y, z = (actuation.dipole_B_a_m2 if described.quantity == 'dipole'
                   else actuation.torque_B_n_m).tolist()
        return [each / scale for each, scale in zip(
            to_theirs(described.body, (x, y, z)), self._scale)]

    def read(self, message: Any) -> Vector:
        """Map a message to the body torque in it [N m]; inverse of `fill`.

        Raises IndexError and what is in WRONG_FIELD.
        """
        x, y, z = (np.array(numbers_at(message, self.described.fields, 'xyz'))
                   * self._scale).tolist()
        return to_ours(self.described.body, (x, y, z))

    def check(self, message: Any) -> None:
        """Raise ConfigurationError where a message, empty as it is made, lacks a field."""
        zero = Actuation(np.zeros(3), np.zeros(3), np.zeros(3))
        try:
            for steps in self.described.fields:
                value_at(message, steps)
            self.fill(message, 0, 0, None if self.described.quantity == 'device' else zero)
        except IndexError:
            return  # an element of a sequence that is empty as yet
        except WRONG_FIELD as error:
            raise ConfigurationError(
                self.described.topic, self.described.message_type,
                f'a type with the fields described ({error})') from None
