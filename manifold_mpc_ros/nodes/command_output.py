# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node's commands: publishers of the described messages, and the messages of each command."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.duration import Duration

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.description import command_description
from manifold_mpc_ros.config.interfaces import message_class, named_by
from manifold_mpc_ros.control.actuator import Actuation
from manifold_mpc_ros.control.described.command import CommandWriter
from manifold_mpc_ros.nodes.managed_node import ManagedNode, Status
from manifold_mpc_ros.nodes.quick_messages import QuickWriter

#: What fills the messages of a topic, and their type.
Writers = Sequence[tuple[CommandWriter, type]]


def command_writers(config: ControllerConfig) -> Writers:
    """Return what fills the messages of the descriptions of commands.

    Raises ConfigurationError for a message type that is not installed or a field that it lacks.
    """
    writers = []
    for each in config.command_sinks:
        for message in command_description(each):
            writer = CommandWriter(message, config.body_frame_id, config.full_scale_torque_n_m)
            with named_by('command_sink', each):
                kind = message_class(message.message_type, message.install)
                writer.check(kind())
            writers.append((writer, kind))
    return writers


class CommandOutput:
    """Publishes commands of a node on every topic of descriptions."""

    def __init__(self, node: ManagedNode, writers: Writers) -> None:
        """Advertise the topics."""
        self._node = node
        self._outputs = [_Output(node, writer, kind) for writer, kind in writers]
        self._others: list[str] = []
        node.status_parts.append(self.name_others)

    def close(self) -> None:
        """Publish no more."""
        self._node.status_parts.remove(self.name_others)
        for output in self._outputs:
            output.close()

    def send(self, stamp_ns: int, actuation: Actuation) -> None:
        """Publish a command with the stamp of the state that it answers [ns]."""
        for output in self._outputs:
            if output.timer is None:
                output.publish(stamp_ns, actuation)

    def name_others(self, status: Status) -> None:
        """Add to a status who else publishes commands; the log has each change once."""
        topics = [output.publisher.topic_name for output in self._outputs]
        ours = [f'{self._node.get_fully_qualified_name()} on {topic}' for topic in topics]
        named = [f'{info.node_namespace.rstrip("/")}/{info.node_name} on {topic}'
                 for topic in topics if self._node.count_publishers(topic) > 1
                 for info in self._node.get_publishers_info_by_topic(topic)]
        others = sorted((Counter(named) - Counter(ours)).elements())
        if others:
            status.level = max(status.level, DiagnosticStatus.WARN)
            status.values['other_publishers'] = ', '.join(others)
        if others and others != self._others:
            self._node.get_logger().warning(f'commands come from {", ".join(others)} too')
        self._others = others

    def wait_until_read(self, longest_s: float) -> None:
        """Wait until reliable readers have every command, at most so long [s]."""
        for output in self._outputs:
            output.publisher.wait_for_all_acked(Duration(seconds=longest_s))


class _Output:
    """The publisher of one topic, and the timer of messages that come by themselves."""

    def __init__(self, node: ManagedNode, writer: CommandWriter, kind: type) -> None:
        """Advertise the topic."""
        self._node, self._writer, self._message = node, writer, kind()
        self._quick = _quick_writer(writer, self._message)
        described = writer.described
        self.publisher = node.advertise(kind, described.topic)
        self.timer = node.tick_every(
            described.period_s, described.topic, self._on_timer) if described.period_s else None

    def close(self) -> None:
        """Publish no more."""
        if self.timer is not None:
            self._node.destroy_timer(self.timer)
        self._node.destroy_lifecycle_publisher(self.publisher)

    def publish(self, stamp_ns: int, actuation: Actuation | None) -> None:
        """Publish one message, by its bytes where that can be."""
        writer, message = self._writer, self._message
        sent_ns = self._node.get_clock().now().nanoseconds
        if self._quick is None or actuation is None:
            self.publisher.publish(writer.fill(message, stamp_ns, sent_ns, actuation))
        else:
            self.publisher.publish(self._quick.bytes_of(
                writer.numbers(message, stamp_ns, sent_ns, actuation)))

    def _on_timer(self) -> None:
        """Publish what comes by itself, while the node is active."""
        if self._node.active:
            self.publish(self._node.get_clock().now().nanoseconds, None)


def _quick_writer(writer: CommandWriter, message: Any) -> QuickWriter | None:
    """Return what writes a writer's commands by their bytes, None where that cannot be."""
    zero = Actuation(np.zeros(3), np.zeros(3), np.zeros(3))
    try:
        paths = writer.paths(message)
        return QuickWriter(writer.fill(message, 0, 0, zero), paths)
    except (IndexError, KeyError, ValueError):  # a command to devices, or in a sequence
        return None
