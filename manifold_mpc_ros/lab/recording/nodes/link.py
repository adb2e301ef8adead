# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A link between two nodes that loses messages, delivers late, or holds them back."""

from __future__ import annotations

import time
from collections import deque

import numpy as np
from rclpy.node import Node

from manifold_mpc_ros.lab.recording.nodes.raw import DEEP_QOS, StampReader
from manifold_mpc_ros.lab.recording.scenarios.parts import LinkFault


class Link:
    """Passes serialized messages from one topic to another, in order and to the bit.

    Which ones are lost is drawn from the fault's seed, message by message. A message waits until
    its delay is over, and while its stamp is at or beyond `hold_from_ns`.

    Arguments
    ---------
    node
        What the link belongs to; its executor brings the messages, `poll` the late ones.
    kind
        Class of the messages.
    source, target
        Names of the topics.
    fault
        What goes wrong.
    wall_per_s
        Wall clock in one second of simulated time, in which the delay is given [s].
    stamp_of
        Reads the stamp of a message.

    """

    def __init__(
        self, node: Node, kind: type, source: str, target: str, fault: LinkFault,
        wall_per_s: float, stamp_of: StampReader,
    ) -> None:
        """Subscribe and advertise."""
        self._fault, self._stamp_of = fault, stamp_of
        self._delay_s = fault.delay_s * wall_per_s
        self._draws = np.random.default_rng(fault.seed)
        self._waiting: deque[tuple[float, int, bytes]] = deque()
        self.hold_from_ns: int | None = None
        self.passed = self.lost = 0
        self._publisher = node.create_publisher(kind, target, DEEP_QOS)
        node.create_subscription(kind, source, self._on_message, DEEP_QOS, raw=True)

    def _on_message(self, data: bytes) -> None:
        """Lose a message, or let it wait for its time; a repeat of what waits adds nothing."""
        if self._waiting and self._waiting[-1][2] == data:
            return
        if self._draws.random() < self._fault.drop_probability:
            self.lost += 1
            return
        self._waiting.append(
            (time.monotonic() + self._delay_s, self._stamp_of(data, 0), data))
        self.poll()

    def poll(self) -> None:
        """Deliver what is due, in order."""
        while self._waiting:
            due_s, stamp_ns, data = self._waiting[0]
            held = self.hold_from_ns is not None and stamp_ns >= self.hold_from_ns
            if held or time.monotonic() < due_s:
                return
            self._waiting.popleft()
            self._publisher.publish(data)
            self.passed += 1
