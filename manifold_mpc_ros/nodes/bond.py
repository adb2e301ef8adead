# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bond of a node with its lifecycle manager: each tells the other that it lives.

Both ends publish messages of the package ``bond`` on one topic, every period: the name of the bond
(that of the node), a name of the end's own, and whether the bond is in force. One that says it is
not, or falls silent, ends it; what follows is the manager's to decide. This end goes on without.
"""

from __future__ import annotations

import math
import uuid
from typing import Any

from rclpy.clock import Clock
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import QoSProfile, ReliabilityPolicy

from manifold_mpc_ros.config.interfaces import BOND, message_class
from manifold_mpc_ros.config.parameter import Value
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.nodes.barrier import Barrier

TOPIC, MESSAGE_TYPE, _ = BOND
_DEPTH = 10


class Bond:
    """One end of a bond, in force while the node is active."""

    def __init__(self, node: LifecycleNode, barrier: Barrier, clock: Clock) -> None:
        """Keep the node, what guards its callbacks, and the clock of the heartbeat."""
        self._node, self._barrier, self._clock = node, barrier, clock
        self._interfaces: tuple[Any, ...] = ()
        self._state = 'ended'

    def open(self, period_s: Value) -> None:
        """Make the interfaces, none with a period of zero; raise ConfigurationError."""
        self.close()
        if not period_s:
            return
        try:
            self._kind = message_class(MESSAGE_TYPE, 'apt-get install ros-jazzy-bond')
        except ConfigurationError as error:
            raise ConfigurationError(
                'bond_period_s', period_s, f'0, or {MESSAGE_TYPE} to be {error.valid}') from None
        best_effort = QoSProfile(depth=_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._publisher = self._node.create_publisher(self._kind, TOPIC, _DEPTH)
        self._interfaces = (
            self._publisher,
            self._node.create_subscription(
                self._kind, TOPIC, self._barrier.guarded(TOPIC, self._on_status), best_effort),
            self._node.create_timer(
                period_s, self._barrier.guarded(TOPIC, self._beat), clock=self._clock))
        self._period_s = period_s

    def close(self) -> None:
        """Remove the interfaces."""
        for interface, remove in zip(self._interfaces, (
                self._node.destroy_publisher, self._node.destroy_subscription,
                self._node.destroy_timer)):
            remove(interface)
        self._interfaces = ()

    def begin(self) -> None:
        """Let a new bond be in force."""
        self._state, self._instance = 'waits for a manager', str(uuid.uuid4())

    def end(self) -> None:
        """Tell the manager that the bond is no more."""
        if self._interfaces and self._state != 'ended':
            self._say(active=False)
        self._state = 'ended'

    def values(self) -> dict[str, object]:
        """Return what /diagnostics says of the bond, nothing where there is none."""
        return {TOPIC: self._state} if self._interfaces else {}

    def _beat(self) -> None:
        """Say that the bond is in force, while it is."""
        if self._state != 'ended':
            self._say(active=True)

    def _on_status(self, status: Any) -> None:
        """Hear the other end; its end of the bond is acknowledged."""
        other = status.id == self._node.get_name() and self._state != 'ended' and (
            status.instance_id != self._instance)
        if other and status.active:
            self._state = 'formed'
        elif other:
            self.end()

    def _say(self, *, active: bool) -> None:
        """Publish whether the bond is in force."""
        status = self._kind(
            id=self._node.get_name(), instance_id=self._instance, active=active,
            heartbeat_timeout=math.inf, heartbeat_period=self._period_s)
        status.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(status)
