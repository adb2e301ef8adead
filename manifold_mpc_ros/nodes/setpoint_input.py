# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A topic of setpoints: those of every publisher, and the one that a latched publisher keeps.

Only a subscription that asks for transient local messages is sent those from before it, and it
matches none but latched publishers, which it would warn of the others. So there is one of best
effort for all, and a second one while a latched publisher is there.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from manifold_mpc_ros.nodes.managed_node import INPUT_QOS, ManagedNode

#: The graph is looked at for latched publishers so often [s].
LOOK_PERIOD_S = 0.2
LATCHED_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                         durability=DurabilityPolicy.TRANSIENT_LOCAL)


class SetpointInput:
    """Gives each setpoint of a topic to ``on_setpoint``, once, while the node is active.

    A latched setpoint is given again after each activation.
    """

    def __init__(
        self, node: ManagedNode, kind: type, topic: str, on_setpoint: Callable[[Any], None],
    ) -> None:
        """Listen until `close`."""
        self._node, self._kind, self._topic = node, kind, topic
        self._on_setpoint = on_setpoint
        self._given_ns: deque[int] = deque(maxlen=INPUT_QOS.depth)
        self._latched: Subscription | None = None
        self._activation = 0
        self._subscription = node.listen(kind, topic, self._on_message, INPUT_QOS)
        self._timer = node.tick_every(LOOK_PERIOD_S, f'latched {topic}', self._look)

    def close(self) -> None:
        """Listen no more."""
        self._node.destroy_timer(self._timer)
        self._node.destroy_subscription(self._subscription)
        self._drop_latched()

    def _look(self) -> None:
        """Ask for what a latched publisher keeps, once in an activation."""
        if self._activation != self._node.activations:
            self._drop_latched()
            self._activation = self._node.activations
        if self._node.active and self._latched is None and any(
                each.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
                for each in self._node.get_publishers_info_by_topic(
                    self._subscription.topic_name)):
            self._latched = self._node.create_subscription(
                self._kind, self._topic, self._node.barrier.guarded(
                    f'latched {self._topic}', self._on_latched), LATCHED_QOS,
                event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False))

    def _drop_latched(self) -> None:
        """Forget what was given."""
        self._given_ns.clear()
        if self._latched is not None:
            self._node.destroy_subscription(self._latched)
            self._latched = None

    def _on_message(self, message: Any, info: Mapping[str, Any]) -> None:
        """Hand a message on that the other subscription has not."""
        published_ns = info.get('source_timestamp') or 0
        if self._latched is None or published_ns not in self._given_ns:
            self._given_ns.append(published_ns)
            self._on_setpoint(message)

    def _on_latched(self, message: Any, info: Mapping[str, Any]) -> None:
        """Hand a kept message on, unless a later one has come."""
        if (info.get('source_timestamp') or 0) > max(self._given_ns, default=0):
            self._on_message(message, info)
