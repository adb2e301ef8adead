# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The closed loop as it looks from outside: commands, true states, what the nodes report."""

from __future__ import annotations

import math
import time
from bisect import bisect_right, insort
from collections import deque
from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node

from manifold_mpc_ros.config.tables import CONTROLLER_NAME, SIMULATOR_NAME
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.lab.fault_injection.cdr import ODOMETRY, WRENCH, StampedMessage
from manifold_mpc_ros.lab.fault_injection.evidence import Command, Report
from manifold_mpc_ros.lab.fault_injection.fault import CONTROLLER, SIMULATOR, STATE, TORQUE
from manifold_mpc_ros.lab.recording.nodes.raw import DEEP_QOS
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

NODES = {CONTROLLER_NAME: CONTROLLER, SIMULATOR_NAME: SIMULATOR}
#: Reports that are kept for a look back.
_KEPT = 64
#: What was published earlier than a report has come when the report is so old [s].
_ON_THE_WAY_S = 0.1


class Observer:
    """Keeps what a trial needs: everything since `clear`, and the latest of each."""

    def __init__(self, node: Node) -> None:
        """Subscribe; the proxy hands over what passes there."""
        node.create_subscription(DiagnosticArray, '/diagnostics', self._on_report, DEEP_QOS)
        node.create_subscription(
            WrenchStamped, f'/{TORQUE}', self._on_command, DEEP_QOS, raw=True)
        self.latest: dict[str, Report] = {}
        self.commands: list[Command] = []
        self.reports: list[Report] = []
        self.R_NB: Array | None = None
        self.omega_BN_B: tuple[float, ...] = (0.0, 0.0, 0.0)
        self.state_s = self.command_s = -math.inf
        self._monotonic_zero_s = time.time() - time.monotonic()
        self.new_life()

    def clear(self, until_s: float = math.inf) -> None:
        """Forget commands and reports up to a time."""
        self.commands = [c for c in self.commands if c.time_s > until_s]
        self.reports = [r for r in self.reports if r.time_s > until_s]

    def new_life(self) -> None:
        """Count the controller's commands anew: it was started again."""
        self.usual_surplus: int | None = None
        self._published_ns: list[int] = []
        self._ticks: deque[tuple[float, int, int]] = deque(maxlen=_KEPT)

    @property
    def surplus(self) -> int | None:
        """Commands received less ticks reported; constant while each tick has exactly one.

        Those count that the controller had published before the report, which is old enough for
        them to have come; None before there is one. What it is at first depends on which commands
        came before this side was known to the controller.
        """
        before_s = time.monotonic() - _ON_THE_WAY_S
        for time_s, published_ns, ticks in reversed(self._ticks):
            if time_s <= before_s:
                return bisect_right(self._published_ns, published_ns) - ticks
        return None

    @property
    def recorded_s(self) -> float:
        """When the newest command that was recorded had been published [s]."""
        return self.commands[-1].time_s if self.commands else -math.inf

    def see(self, topic: str, data: bytes) -> None:
        """Take in what passes the proxy."""
        if topic == TORQUE:
            self.command_s = time.monotonic()
        elif topic == STATE:
            self._see_state(data)

    def _on_command(self, data: bytes, info: Mapping[str, int]) -> None:
        """Record a command; every one comes, though a lost one holds up those behind it."""
        published_ns = info['source_timestamp']
        insort(self._published_ns, published_ns)
        published_s = published_ns / NANOSECONDS - self._monotonic_zero_s
        torque = StampedMessage.decode(data, WRENCH).part(WRENCH.vector)
        self.commands.append(Command(published_s, torque))

    def _see_state(self, data: bytes) -> None:
        """Keep the latest true state."""
        message = StampedMessage.decode(data, ODOMETRY)
        x, y, z, w = message.part(ODOMETRY.quaternion)
        self.R_NB = so3.rotation_from_quaternion([w, x, y, z])
        self.omega_BN_B = message.part(ODOMETRY.vector)
        self.state_s = time.monotonic()

    def _on_report(self, message: DiagnosticArray, info: Mapping[str, int]) -> None:
        """Keep what the nodes say."""
        for status in message.status:
            node = NODES.get(status.name)
            if node is None:
                continue
            report = Report(time.monotonic(), node, {
                'message': status.message, **{pair.key: pair.value for pair in status.values}})
            self.latest[node] = report
            self.reports.append(report)
            if node == CONTROLLER and 'ticks' in report.values:
                self._ticks.append((
                    report.time_s, info['source_timestamp'], int(report.values['ticks'])))
