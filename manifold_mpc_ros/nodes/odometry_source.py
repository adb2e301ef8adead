# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The state source ``odometry``: nav_msgs/Odometry, attitude and body rate in one message."""

from __future__ import annotations

from nav_msgs.msg import Odometry

from manifold_mpc_ros.control.input_gate import RawState
from manifold_mpc_ros.nodes.messages import nanoseconds, quaternion_values, vector_values


class OdometrySource:
    """Attitude from the pose; rate from the twist, which is in the child frame, the body's."""

    def forget(self) -> None:
        """Do nothing: every message is complete."""

    def read(self, _topic: str, message: Odometry) -> RawState:
        """Map a message to the state in it."""
        return RawState(
            stamp_ns=nanoseconds(message.header.stamp),
            inertial_frame_id=message.header.frame_id,
            body_frame_id=message.child_frame_id,
            quaternion_xyzw=quaternion_values(message.pose.pose.orientation),
            omega_BN_B=vector_values(message.twist.twist.angular),
        )
