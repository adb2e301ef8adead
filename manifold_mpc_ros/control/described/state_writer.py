# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States in the messages of any stack, by their description; messages are any objects."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from manifold_mpc_ros.config.description import Part, StateDescription
from manifold_mpc_ros.control.described.conversions import write_attitude, write_rate
from manifold_mpc_ros.control.described.fields import put, put_numbers, put_stamp, value_at
from manifold_mpc_ros.control.input_gate import StateSample
from manifold_mpc_ros.lie import so3


class StateWriter:
    """Fills the messages of a state, which `DescribedSource` reads.

    Arguments
    ---------
    described
        What they say.
    frames
        Of the inertial axes and of the body.
    variances
        Of the attitude [rad^2] and of the rate [rad^2/s^2], about each body axis.

    """

    def __init__(
        self, described: StateDescription, frames: tuple[str, str],
        variances: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Keep what is needed."""
        self._described, self._frames, self._variances = described, frames, variances

    def fill(self, messages: Mapping[str, Any], sample: StateSample) -> None:
        """Put a state into an empty message of each topic.

        Raises IndexError and what is in WRONG_FIELD.
        """
        w, x, y, z = so3.quaternion_from_rotation(sample.R_NB).tolist()
        rate_x, rate_y, rate_z = sample.omega_BN_B.tolist()
        attitude, rate = self._described.attitude, self._described.rate
        for part, values, variance in (
            (attitude, write_attitude(attitude.convention, (x, y, z, w)), self._variances[0]),
            (rate, write_rate(rate.convention, (rate_x, rate_y, rate_z), (x, y, z, w)),
             self._variances[1]),
        ):
            message = messages[part.topic]
            write_part(part, message, sample.stamp_ns, values, self._frames)
            if part.covariance:
                side = math.isqrt(len(value_at(message, part.covariance)))
                put(message, part.covariance, np.diag(
                    [0.0] * (side - 3) + [variance] * 3).ravel())


def write_part(
    part: Part, message: Any, stamp_ns: int, values: Sequence[float], frames: tuple[str, str],
) -> None:
    """Put numbers, stamp [ns] and frames into a message, where `read_part` reads them."""
    for steps, value in part.constants.items():
        put(message, steps, value)
    put_numbers(message, part.fields, part.convention.names, values)
    put_stamp(message, part.stamp, part.stamp_unit_ns, stamp_ns)
    for steps, frame in zip(
            (part.inertial_frame_id, part.body_frame_id), frames, strict=True):
        if steps:
            put(message, steps, frame)
