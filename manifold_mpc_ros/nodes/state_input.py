# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node's state source: subscriptions to its topics, and the states that their messages make.

A kind of source is one file beside this one, with a class that is a `StateSource`, and one entry
in the table `STATE_SOURCES` (config/interfaces.py), which names the class and the topics. What
it reads is checked by `StateGate` (control/input_gate.py).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from rclpy.qos import QoSProfile

from manifold_mpc_ros.config.interfaces import STATE_SOURCES, message_class
from manifold_mpc_ros.control.input_gate import RawState, Refusal
from manifold_mpc_ros.nodes.managed_node import ManagedNode
from manifold_mpc_ros.nodes.publisher_watch import PublisherWatch

#: What a node does with a state, or with the reason why a message makes none; and what the
#: middleware says about the message that completed it.
OnState = Callable[[RawState | Refusal, Mapping[str, Any]], None]


class StateSource(Protocol):
    """Makes states of the messages of one topic or of several."""

    def read(self, topic: str, message: Any) -> RawState | Refusal | None:
        """Map a message to the state that it completes.

        None while another message of the state has not come; a Refusal where the message cannot
        be part of one.
        """

    def forget(self) -> None:
        """Forget the messages that wait for others, as at the start."""


class StateInput:
    """One state source of a node, listened to until `close`.

    Arguments
    ---------
    node
        Who subscribes; messages that come while it is not active are dropped.
    kind
        The key in `STATE_SOURCES`, and the name under which refusals are counted.
    qos
        Of the subscriptions.
    on_state
        Called with each state.
    on_duplicate
        Called with the topic when two publishers of it take turns.

    """

    def __init__(
        self, node: ManagedNode, kind: str, qos: QoSProfile, on_state: OnState,
        on_duplicate: Callable[[str], None] = lambda _topic: None,
    ) -> None:
        """Subscribe to the topics of the kind."""
        self.kind = kind
        self._node = node
        self._on_state, self._on_duplicate = on_state, on_duplicate
        self._source: StateSource = STATE_SOURCES[kind].load()()
        topics = STATE_SOURCES[kind].topics
        self._watches = {topic.name: PublisherWatch() for topic in topics}
        self._subscriptions = {
            topic.name: node.listen(
                message_class(topic.message_type), topic.name, self._callback(topic.name), qos)
            for topic in topics}

    def close(self) -> None:
        """Subscribe no more."""
        for subscription in self._subscriptions.values():
            self._node.destroy_subscription(subscription)

    def forget(self) -> None:
        """Forget messages and publishers, as at the start."""
        self._source.forget()
        for watch in self._watches.values():
            watch.forget()

    def _callback(self, topic: str) -> Callable[[Any, Mapping[str, Any]], None]:
        """Return the callback of a topic's messages."""
        def on_message(message: Any, info: Mapping[str, Any]) -> None:
            if not self._node.active:
                return
            in_turn = self._watches[topic].note(info.get('publication_sequence_number'))
            if in_turn and self._subscriptions[topic].get_publisher_count() > 1:
                self._on_duplicate(topic)
            read = self._source.read(topic, message)
            if read is not None:
                self._on_state(read, info)

        return on_message
