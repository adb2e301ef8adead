# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who publishes the clock: nobody, one, or two whose times contradict each other."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rosgraph_msgs.msg import Clock

from manifold_mpc_ros.nodes.managed_node import INPUT_QOS, ManagedNode
from manifold_mpc_ros.nodes.publisher_watch import PublisherWatch

TOPIC = '/clock'
#: A publisher is found before its name is; without every name it is said after this [s].
LONGEST_NAMING_S = 1.0
UNKNOWN = 'a program without a name'


class ClockWatch:
    """Finds two programs that publish one clock.

    The discovery graph names the publishers, but keeps a killed one for seconds. So while it
    shows several, their messages are read: two that are alive take turns.

    Arguments
    ---------
    node
        Whose remapping rules say what becomes of ``/clock``.
    ignored
        Whether the node follows the system clock, so that a clock that is there is a mistake.

    """

    def __init__(self, node: ManagedNode, *, ignored: bool) -> None:
        """Watch the topic."""
        self._node = node
        self._ignored = ignored
        self._topic = node.resolve_topic_name(TOPIC)
        self._turns = PublisherWatch()
        self._subscription: Subscription | None = None
        self.publishers: list[str] = []
        self.ignores = ''
        self.conflict, self._said, self._since_s = '', False, 0.0

    def look(self) -> None:
        """Read the graph; read the messages too while there are several publishers."""
        self.publishers = sorted(map(
            _name, self._node.get_publishers_info_by_topic(self._topic)))
        if self._ignored:
            self._say_ignored()
        elif len(self.publishers) < 2:
            self._ignore_messages()
        elif self.conflict:
            self._say_conflict()
        elif self._subscription is None:
            self._subscription = self._node.listen(Clock, TOPIC, self._on_clock, INPUT_QOS)

    def forget(self) -> None:
        """Forget a conflict and the messages that showed it."""
        self._turns.forget()
        self.conflict, self._said = '', False

    def close(self) -> None:
        """Remove the subscription."""
        self._ignore_messages()

    def _say_ignored(self) -> None:
        """Note, and say once, that there is a clock which this node does not follow."""
        before, self.ignores = self.ignores, ''
        if not self.publishers:
            self._said = False
            return
        self.ignores = (f'stamps follow the system clock, not {self._topic} of '
                        f'{" and ".join(self.publishers)}; use_sim_time: true follows it')
        if not before:
            self._since_s = time.monotonic()
        if self._is_time_to_say():
            self._node.get_logger().warning(self.ignores)

    def _ignore_messages(self) -> None:
        """Stop reading the clock's messages."""
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None
            self._turns.forget()

    def _on_clock(self, _message: Clock, info: Mapping[str, Any]) -> None:
        """Note a conflict, once."""
        turns = self._turns.note(info.get('publication_sequence_number'))
        if turns and not self.conflict:
            self._since_s = time.monotonic()
            self.conflict = self._words()
            self._say_conflict()

    def _words(self) -> str:
        """Return the conflict in words."""
        return f'two publishers of {self._topic}: {" and ".join(self.publishers)}'

    def _say_conflict(self) -> None:
        """Say the conflict once, with every name, or without when it does not become known."""
        if self._is_time_to_say():
            self.conflict = self._words()
            self._node.get_logger().error(
                f'{self.conflict}; simulated time stands still here until ~/reset')

    def _is_time_to_say(self) -> bool:
        """Return True once, when every publisher's name is known or does not become known."""
        late = time.monotonic() - self._since_s > LONGEST_NAMING_S
        if self._said or (UNKNOWN in self.publishers and not late):
            return False
        self._said = True
        return True


def _name(publisher: TopicEndpointInfo) -> str:
    """Return the full name of a publisher's node, as far as it is known."""
    if 'UNKNOWN' in publisher.node_name:
        return UNKNOWN
    return f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'
