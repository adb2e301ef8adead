# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What stands behind a command, for those who look: predicted attitudes, estimated torque."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Path

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.control.command import Command
from manifold_mpc_ros.control.response.observer import ResponseObserver
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.managed_node import ManagedNode


class Insight:
    """Publishes ``~/prediction`` and ``~/disturbance`` while somebody subscribes."""

    def __init__(self, node: ManagedNode) -> None:
        """Advertise both."""
        self._node = node
        self._prediction = node.advertise(Path, '~/prediction')
        self._disturbance = node.advertise(WrenchStamped, '~/disturbance')

    def close(self) -> None:
        """Publish no more."""
        self._node.destroy_lifecycle_publisher(self._prediction)
        self._node.destroy_lifecycle_publisher(self._disturbance)

    def publish(
        self, command: Command, observer: ResponseObserver | None, config: ControllerConfig,
    ) -> None:
        """Publish what stands behind a command."""
        if observer is not None and self._disturbance.get_subscription_count() > 0:
            self._disturbance.publish(messages.to_torque(
                command.stamp_ns, observer.disturbance_B_n_m, config.body_frame_id))
        if command.solution is not None and self._prediction.get_subscription_count() > 0:
            pointing = config.mpc.target == 'pointing'
            axis_B = config.mpc.pointing_axis_B if pointing else np.eye(3)[0]
            self._prediction.publish(messages.to_path(
                command.stamp_ns, config.mpc.step_s, command.solution.R_NB,
                config.inertial_frame_id, axis_B))
