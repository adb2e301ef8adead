# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Stands between the two nodes on DDS: every message passes here, as bytes, to be disturbed."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from rclpy._rclpy_pybind11 import RCLError
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from manifold_mpc_ros.lab.fault_injection.disturbances import Channel, Disturbance
from manifold_mpc_ros.lab.fault_injection.fault import BEHIND, SIMULATED_TIME, STATE, TORQUE

KINDS = {STATE: Odometry, TORQUE: WrenchStamped, SIMULATED_TIME: Clock}
#: As the nodes read: nothing waits for a message that is lost.
RELAY_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
PROXY_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
MISFIT_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                        durability=DurabilityPolicy.TRANSIENT_LOCAL)

#: Told (topic, bytes) of every message that came.
Seen = Callable[[str, bytes], None]


@dataclass
class _Way:
    """One topic: its channel, the publisher behind it, and an intruder's when there is one."""

    channel: Channel
    publisher: Publisher | None
    intruder: Publisher | None = None
    intrusion: Disturbance | None = None
    draws: random.Random = field(default_factory=random.Random)


class Proxy:
    """Passes the topics of `KINDS` from one node to the other, disturbed while a fault lasts.

    Arguments
    ---------
    node
        What the proxy belongs to; its executor brings the messages, `poll` the late ones.
    stranger
        A node of another participant, for what an intruder publishes.
    topics
        The topics that are passed.
    seed
        Of everything that is drawn.
    seen
        Called with every message as it came.

    """

    def __init__(
        self, node: Node, stranger: Node, topics: tuple[str, ...], seed: int, seen: Seen,
    ) -> None:
        """Subscribe and advertise."""
        self._node, self._stranger, self._seen = node, stranger, seen
        self._ways: dict[str, _Way] = {}
        self._misfits: list[object] = []
        for topic in topics:
            self._ways[topic] = _Way(
                Channel(seed), self._advertise(node, topic), draws=random.Random(seed))
            node.create_subscription(
                KINDS[topic], f'/{topic}',
                lambda data, name=topic: self._on_message(name, data), RELAY_QOS, raw=True)

    def disturb(self, topic: str, disturbance: Disturbance | None) -> None:
        """Disturb a topic's messages, or let them pass again."""
        self._ways[topic].channel.disturbance = disturbance

    def stretch(self, times: int) -> None:
        """Make all delays so many times as long as they are."""
        for way in self._ways.values():
            way.channel.stretch *= times

    def intrude(self, topic: str, disturbance: Disturbance | None) -> None:
        """Publish disturbed copies of a topic's messages from another participant, or cease."""
        way = self._ways[topic]
        if disturbance is None and way.intruder is not None:
            self._stranger.destroy_publisher(way.intruder)
            way.intruder = None
        elif disturbance is not None:
            way.intruder = self._advertise(self._stranger, topic)
        way.intrusion = disturbance

    def silence(self, topic: str, silent: bool) -> None:
        """Destroy the publisher behind the proxy, or make a new one."""
        way = self._ways[topic]
        if silent and way.publisher is not None:
            self._node.destroy_publisher(way.publisher)
            way.publisher = None
        elif not silent:
            way.publisher = self._advertise(self._node, topic)

    def misfit(self, topic: str, present: bool) -> None:
        """Have a subscriber that asks a node's publisher for what it does not offer, or not."""
        if present:
            self._misfits.append(self._stranger.create_subscription(
                KINDS[topic], f'/{topic}', lambda _: None, MISFIT_QOS))
        else:
            while self._misfits:
                self._stranger.destroy_subscription(self._misfits.pop())

    def poll(self) -> None:
        """Deliver late messages that are due."""
        now_s = time.monotonic()
        for way in self._ways.values():
            for data in way.channel.due(now_s):
                _publish(way.publisher, data)

    def _advertise(self, node: Node, topic: str) -> Publisher:
        """Return a publisher behind the proxy."""
        return node.create_publisher(KINDS[topic], f'/{topic}{BEHIND}', PROXY_QOS)

    def _on_message(self, topic: str, data: bytes) -> None:
        """Pass a message on, or what became of it."""
        way = self._ways[topic]
        for delivered in way.channel.push(data, time.monotonic()):
            _publish(way.publisher, delivered)
        if way.intrusion is not None:
            for _, delivered in way.intrusion(data, way.draws):
                _publish(way.intruder, delivered)
        self._seen(topic, data)


def _publish(publisher: Publisher | None, data: bytes) -> None:
    """Publish bytes where there is a publisher; bytes too long for the type are lost here."""
    if publisher is not None:
        with suppress(RCLError):
            publisher.publish(data)
