# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node's state source: subscriptions to its topics, and the states that their messages make.

Which topics, and what their messages say, is a description (config/description.py). What is read
is checked by `StateGate` (control/input_gate.py).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.qos import QoSProfile

from manifold_mpc_ros.config.description import state_description
from manifold_mpc_ros.config.interfaces import message_class, named_by
from manifold_mpc_ros.control.described.source import DescribedSource, check_part
from manifold_mpc_ros.control.input_gate import RawState, Refusal
from manifold_mpc_ros.nodes.managed_node import ManagedNode
from manifold_mpc_ros.nodes.publisher_watch import PublisherWatch
from manifold_mpc_ros.nodes.quick_messages import QuickMessages

#: What a node does with a state, or with the reason why a message makes none; and what the
#: middleware says about the message that completed it.
OnState = Callable[[RawState | Refusal, Mapping[str, Any]], None]


def state_kinds(given: str, parameter: str = 'state_source') -> dict[str, type]:
    """Return the types of the messages of a description by topic.

    Raises ConfigurationError for a message type that is not installed or a field that it lacks.
    """
    described, kinds = state_description(given, parameter), {}
    for part in (described.attitude, described.rate):
        with named_by(parameter, given):
            kinds[part.topic] = message_class(part.message_type, part.install)
            check_part(part, kinds[part.topic]())
    return kinds


class StateInput:
    """One state source of a node, listened to until `close`.

    Arguments
    ---------
    node
        Who subscribes; messages that come while it is not active are dropped.
    given
        The description: the name of a shipped one, or a YAML file.
    qos
        Of the subscriptions.
    on_state
        Called with each state.
    on_duplicate
        Called with the topic when two publishers of it take turns.

    Raises what `state_kinds` raises.

    """

    def __init__(
        self, node: ManagedNode, given: str, qos: QoSProfile, on_state: OnState,
        on_duplicate: Callable[[str], None] = lambda _topic: None,
    ) -> None:
        """Subscribe to the topics of the description."""
        self._node = node
        self._on_state, self._on_duplicate = on_state, on_duplicate
        self._source = DescribedSource(state_description(given))
        kinds = state_kinds(given)
        self._watches = {topic: PublisherWatch() for topic in kinds}
        self._subscriptions = {
            topic: node.listen(kind, topic, self._callback(topic, kind), qos, raw=True)
            for topic, kind in kinds.items()}

    def close(self) -> None:
        """Subscribe no more."""
        for subscription in self._subscriptions.values():
            self._node.destroy_subscription(subscription)

    def forget(self) -> None:
        """Forget messages and publishers, as at the start."""
        self._source.forget()
        for watch in self._watches.values():
            watch.forget()

    def _callback(self, topic: str, kind: type) -> Callable[[bytes, Mapping[str, Any]], None]:
        """Return the callback of a topic's messages."""
        messages = QuickMessages(kind, self._source.parts(topic))

        def on_message(data: bytes, info: Mapping[str, Any]) -> None:
            if not self._node.active:
                return
            in_turn = self._watches[topic].note(info.get('publication_sequence_number'))
            if in_turn and self._subscriptions[topic].get_publisher_count() > 1:
                self._on_duplicate(topic)
            received_ns = self._node.get_clock().now().nanoseconds
            numbers = messages.numbers(data)
            if numbers is None:
                read = self._source.read(topic, messages.message(data), received_ns)
            else:
                read = self._source.read_numbers(topic, numbers, received_ns)
            if read is not None:
                self._on_state(read, info)

        return on_message
