# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What stands behind a command: predicted attitudes, estimated torque, plans that do not fit."""

from __future__ import annotations

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Vector3Stamped, WrenchStamped
from nav_msgs.msg import Path

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.control.command import Command
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.managed_node import ManagedNode, Status


class Insight:
    """Publishes ``~/prediction``, ``~/disturbance`` and its standard deviation to who subscribes.

    Says when horizon, period or body do not fit: once in the log each time, and on diagnostics.
    """

    def __init__(self, node: ManagedNode) -> None:
        """Advertise them."""
        self._node = node
        self._prediction = node.advertise(Path, '~/prediction')
        self._disturbance = node.advertise(WrenchStamped, '~/disturbance')
        self._deviation = node.advertise(Vector3Stamped, '~/disturbance_std')
        self._warnings: dict[str, str] = {}

    def close(self) -> None:
        """Publish no more."""
        for each in (self._prediction, self._disturbance, self._deviation):
            self._node.destroy_lifecycle_publisher(each)

    def add_to(self, status: Status) -> None:
        """Add to a status what does not fit."""
        for text in self._warnings.values():
            status.level = max(status.level, DiagnosticStatus.WARN)
            status.message += f'; {text}'

    def publish(self, command: Command, loop: ControlLoop, config: ControllerConfig) -> None:
        """Publish what stands behind a command."""
        found, observer = dict(loop.plan_watch.warnings), loop.observer
        if loop.body_watch.warning:
            found['body'] = loop.body_watch.warning
        for kind in found.keys() - self._warnings.keys():
            self._node.get_logger().warning(found[kind])
        self._warnings = found
        if observer is not None and self._disturbance.get_subscription_count() > 0:
            self._disturbance.publish(messages.to_torque(
                command.stamp_ns, observer.disturbance_B_n_m, config.body_frame_id))
        if observer is not None and self._deviation.get_subscription_count() > 0:
            deviation = messages.to_torque(
                command.stamp_ns, observer.disturbance_std_n_m, config.body_frame_id)
            self._deviation.publish(Vector3Stamped(
                header=deviation.header, vector=deviation.wrench.torque))
        if command.solution is not None and self._prediction.get_subscription_count() > 0:
            pointing = config.mpc.target == 'pointing'
            axis_B = config.mpc.pointing_axis_B if pointing else np.eye(3)[0]
            self._prediction.publish(messages.to_path(
                command.stamp_ns, config.mpc.steps.times_s, command.solution.R_NB,
                config.inertial_frame_id, axis_B))
