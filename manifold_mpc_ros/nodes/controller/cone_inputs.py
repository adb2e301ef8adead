# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Topics that bring the directions of cones; the last direction holds when it grows old."""

from __future__ import annotations

import math
import time
from functools import partial

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Vector3Stamped

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.input_gate import Refusal, admit_direction
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.managed_node import ManagedNode, Status
from manifold_mpc_ros.nodes.setpoint_input import SetpointInput


class ConeInputs:
    """Hands directions to the loop, and says of each cone how near the body is to it."""

    def __init__(self, node: ManagedNode, config: ControllerConfig, loop: ControlLoop) -> None:
        """Listen until `close`; directions count from here on until their topics bring others."""
        self._node, self._config, self._loop = node, config, loop
        self._received_s = dict.fromkeys(config.cone_topics, time.monotonic())
        self._inputs = [SetpointInput(node, Vector3Stamped, topic, partial(self._take, name))
                        for name, (topic, _) in config.cone_topics.items()]

    def close(self) -> None:
        """Listen no more."""
        for each in self._inputs:
            each.close()

    def add_to(self, status: Status) -> None:
        """Add the margin of each cone, and the warning of directions that are stale."""
        for cone in self._config.mpc.cones:
            if self._loop.sample is not None:
                margin = cone.margins_rad(
                    self._loop.sample.R_NB, self._loop.directions_N.get(cone.name))
                status.values[f'cone.{cone.name}.margin_deg'] = math.degrees(float(margin))
        for name, (topic, timeout_s) in self._config.cone_topics.items():
            age_s = time.monotonic() - self._received_s[name]
            status.values[f'cone.{name}.direction_age_s'] = age_s
            if age_s > timeout_s and status.level == DiagnosticStatus.OK:
                status.level = DiagnosticStatus.WARN
                status.message = f'no direction on {topic} for {age_s:.0f} s: the last one holds'

    def _take(self, name: str, message: Vector3Stamped) -> None:
        """Take a direction, or count its refusal."""
        admitted = admit_direction(
            message.header.frame_id, messages.vector_values(message.vector),
            self._config.inertial_frame_id)
        if isinstance(admitted, Refusal):
            self._node.refusals.add(self._config.cone_topics[name][0], admitted)
            return
        self._received_s[name] = time.monotonic()
        self._loop.directions_N = {**self._loop.directions_N, name: np.asarray(admitted)}
