# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What stands behind a command: predicted attitudes, estimated torque, plans that do not fit."""

from __future__ import annotations

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Path

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.control.command import Command
from manifold_mpc_ros.control.response.observer import ResponseObserver
from manifold_mpc_ros.mpc.plan_watch import PlanWatch
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.managed_node import ManagedNode, Status


class Insight:
    """Publishes ``~/prediction`` and ``~/disturbance`` while somebody subscribes.

    Says when horizon or period do not fit: once in the log each time, and on diagnostics.
    """

    def __init__(self, node: ManagedNode) -> None:
        """Advertise both."""
        self._node = node
        self._prediction = node.advertise(Path, '~/prediction')
        self._disturbance = node.advertise(WrenchStamped, '~/disturbance')
        self._watch: tuple[object, PlanWatch] | None = None
        self._warnings: dict[str, str] = {}

    def close(self) -> None:
        """Publish no more."""
        self._node.destroy_lifecycle_publisher(self._prediction)
        self._node.destroy_lifecycle_publisher(self._disturbance)

    def add_to(self, status: Status) -> None:
        """Add to a status what does not fit."""
        for text in self._warnings.values():
            status.level = max(status.level, DiagnosticStatus.WARN)
            status.message += f'; {text}'

    def _judge(self, solution: AttitudeMpcSolution, config: AttitudeMpcConfig) -> None:
        """Take a solve; a new configuration begins anew."""
        if self._watch is None or self._watch[0] is not config:
            self._watch = config, PlanWatch(config)
        watch = self._watch[1]
        watch.see(solution.status, solution.solve_time_s)
        found = watch.warnings
        for kind in found.keys() - self._warnings.keys():
            self._node.get_logger().warning(found[kind])
        self._warnings = found

    def publish(
        self, command: Command, observer: ResponseObserver | None, config: ControllerConfig,
    ) -> None:
        """Publish what stands behind a command."""
        if command.solution is not None:
            self._judge(command.solution, config.mpc)
        if observer is not None and self._disturbance.get_subscription_count() > 0:
            self._disturbance.publish(messages.to_torque(
                command.stamp_ns, observer.disturbance_B_n_m, config.body_frame_id))
        if command.solution is not None and self._prediction.get_subscription_count() > 0:
            pointing = config.mpc.target == 'pointing'
            axis_B = config.mpc.pointing_axis_B if pointing else np.eye(3)[0]
            self._prediction.publish(messages.to_path(
                command.stamp_ns, config.mpc.step_s, command.solution.R_NB,
                config.inertial_frame_id, axis_B))
