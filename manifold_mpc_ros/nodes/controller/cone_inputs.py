# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Topics that bring the directions of cones; the last direction holds when it grows old."""

from __future__ import annotations

import math
import time
from functools import partial

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Vector3Stamped

from manifold_mpc_ros.config.cones import directions
from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.input_gate import Refusal, admit_direction
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.managed_node import ManagedNode, Status
from manifold_mpc_ros.nodes.setpoint_input import SetpointInput
from manifold_mpc_ros.terminal.cone_cut import target_margins_rad


class ConeInputs:
    """Hands directions to the loop, and says of each cone how near body and target are to it.

    ``config`` is the configuration that is in force.
    """

    def __init__(self, node: ManagedNode, config: ControllerConfig, loop: ControlLoop) -> None:
        """Listen until `close`; directions count from here on until their topics bring others."""
        self._node, self.config, self._loop = node, config, loop
        self._count = 0
        self._received_s = dict.fromkeys(config.cone_topics, time.monotonic())
        self._inputs = [SetpointInput(node, Vector3Stamped, topic, partial(self._take, name))
                        for name, (topic, _) in config.cone_topics.items()]

    def close(self) -> None:
        """Listen no more."""
        for each in self._inputs:
            each.close()

    def add_to(self, status: Status) -> None:
        """Add margins of the body and of its target, and what is wrong with either."""
        mpc, loop = self.config.mpc, self._loop
        if not mpc.cones:
            return
        warnings = []
        directions_N = loop.directions.at(0 if loop.sample is None else loop.sample.stamp_ns)
        for cone in mpc.cones:
            if loop.sample is not None:
                margin = float(cone.margins_rad(loop.sample.R_NB, directions_N.get(cone.name)))
                status.values[f'cone.{cone.name}.margin_deg'] = math.degrees(margin)
        if loop.sample is not None and loop.target is not None:
            R_ND, _ = loop.target.at(loop.sample.stamp_ns)
            seen = directions(mpc.cones, directions_N, 0)
            for name, margin in target_margins_rad(mpc, mpc.kept_cones, R_ND, seen).items():
                status.values[f'cone.{name}.target_margin_deg'] = math.degrees(margin)
                if margin < 0.0:
                    warnings.append(f'the cone {name} forbids the setpoint, which is held off: '
                                    f'{math.degrees(-margin):.3g} degrees are missing')
        if self.config.cone_topics:
            status.values['directions'] = self._count
        for name, (topic, timeout_s) in self.config.cone_topics.items():
            age_s = time.monotonic() - self._received_s[name]
            status.values[f'cone.{name}.direction_age_s'] = age_s
            status.values[f'cone.{name}.direction_rate_deg_s'] = math.degrees(
                loop.directions.rates_rad_s().get(name, 0.0))
            if age_s > timeout_s:
                warnings.append(f'no direction on {topic} for {age_s:.0f} s: the last one holds')
        if warnings:
            status.level = max(status.level, DiagnosticStatus.WARN)
            status.message = '; '.join([status.message, *warnings])

    def _take(self, name: str, message: Vector3Stamped) -> None:
        """Take a direction, or count its refusal."""
        admitted = admit_direction(
            message.header.frame_id, messages.vector_values(message.vector),
            self.config.inertial_frame_id)
        if isinstance(admitted, Refusal):
            self._node.refusals.add(self.config.cone_topics[name][0], admitted)
            return
        self._received_s[name] = time.monotonic()
        self._count += 1
        self._loop.direct(name, admitted, messages.nanoseconds(message.header.stamp))
