# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The controller's actuator on the ROS side: its topics, and the messages of each command."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import WrenchStamped
from rclpy.duration import Duration

from manifold_mpc_ros.config.interfaces import ACTUATORS, message_class
from manifold_mpc_ros.control.actuator import Actuation
from manifold_mpc_ros.nodes.managed_node import ManagedNode
from manifold_mpc_ros.nodes.messages import to_torque

#: Maps the stamp [ns] and the body frame of a command, and the command, to a message.
Writer = Callable[[int, str, Actuation], Any]


def _wrench(stamp_ns: int, body_frame_id: str, actuation: Actuation) -> WrenchStamped:
    """Return the body torque that is asked for, as a wrench without force."""
    return to_torque(stamp_ns, actuation.torque_B_n_m, body_frame_id)


#: What a message type says of a command.
WRITERS: dict[str, Writer] = {'geometry_msgs/msg/WrenchStamped': _wrench}


class CommandOutput:
    """Publishes commands on every topic of an actuator.

    Arguments
    ---------
    node
        Who publishes.
    kind
        The key in `ACTUATORS`.
    body_frame_id
        The frame of the spacecraft body.

    """

    def __init__(self, node: ManagedNode, kind: str, body_frame_id: str) -> None:
        """Advertise the topics of the kind."""
        self._node = node
        self._body_frame_id = body_frame_id
        self._outputs = [
            (WRITERS[topic.message_type],
             node.advertise(message_class(topic.message_type), topic.name))
            for topic in ACTUATORS[kind].topics]

    def close(self) -> None:
        """Publish no more."""
        for _, publisher in self._outputs:
            self._node.destroy_lifecycle_publisher(publisher)

    def send(self, stamp_ns: int, actuation: Actuation) -> None:
        """Publish a command with the stamp of the state that it answers [ns]."""
        for write, publisher in self._outputs:
            publisher.publish(write(stamp_ns, self._body_frame_id, actuation))

    def wait_until_read(self, longest_s: float) -> None:
        """Wait until reliable readers have every command, at most so long [s]."""
        for _, publisher in self._outputs:
            publisher.wait_for_all_acked(Duration(seconds=longest_s))
