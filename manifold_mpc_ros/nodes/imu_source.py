# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The state source ``imu``: sensor_msgs/Imu with an orientation, its axes the body's."""

from __future__ import annotations

from sensor_msgs.msg import Imu

from manifold_mpc_ros.control.input_gate import RawState
from manifold_mpc_ros.nodes.messages import (
    NOT_PROVIDED,
    nanoseconds,
    quaternion_values,
    vector_values,
)


class ImuSource:
    """Orientation and angular velocity; the message names no inertial frame.

    A covariance whose first element is -1 says that the quantity is not there (REP-145).
    """

    def forget(self) -> None:
        """Do nothing: every message is complete."""

    def read(self, _topic: str, message: Imu) -> RawState:
        """Map a message to the state in it."""
        return RawState(
            stamp_ns=nanoseconds(message.header.stamp),
            inertial_frame_id=None,
            body_frame_id=message.header.frame_id,
            quaternion_xyzw=quaternion_values(message.orientation),
            omega_BN_B=vector_values(message.angular_velocity),
            has_attitude=message.orientation_covariance[0] != NOT_PROVIDED,
            has_rate=message.angular_velocity_covariance[0] != NOT_PROVIDED,
        )
