# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One participant in a process of its own; says as JSON who matched it and what it received.

python secured_client.py TASK [--ros-args ...]
"""

from __future__ import annotations

import functools
import json
import math
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

import rclpy
from rclpy.node import Node
from std_srvs.srv import Trigger

from manifold_mpc_ros.config.interfaces import message_class


@dataclass(frozen=True)
class Task:
    """What to open, and how long to wait until all of it has matched and received.

    A bare node has no services of its own and does not write to /rosout.
    """

    name: str
    publishes: dict[str, str] = field(default_factory=dict)
    subscribes: dict[str, str] = field(default_factory=dict)
    replies: list[str] = field(default_factory=list)
    bare: bool = False
    until_aligned: bool = False
    seconds: float = 8.0


class Client:
    """The participant."""

    def __init__(self, task: Task) -> None:
        options: dict[str, Any] = {}
        if task.bare:
            options = {'enable_rosout': False, 'start_parameter_services': False,
                       'cli_args': ['--ros-args', '-p', 'start_type_description_service:=false']}
        self.task = task
        self.node = Node(task.name, **options)
        self.received = dict.fromkeys(task.subscribes, 0)
        self.angle_deg = 360.0
        self._publishers = {topic: self.node.create_publisher(message_class(kind), topic, 10)
                            for topic, kind in task.publishes.items()}
        for topic, kind in task.subscribes.items():
            self.node.create_subscription(
                message_class(kind), topic, functools.partial(self._take, topic), 10)
        for name in task.replies:
            self.node.create_service(Trigger, name, lambda _request, response: response)

    def _take(self, topic: str, message: Any) -> None:
        self.received[topic] += 1
        if self.task.until_aligned and topic.endswith('odometry'):
            w = abs(message.pose.pose.orientation.w)
            self.angle_deg = math.degrees(2.0 * math.acos(min(1.0, w)))

    def matched(self) -> dict[str, int]:
        """Return how many subscriptions each publisher has found."""
        return {topic: publisher.get_subscription_count()
                for topic, publisher in self._publishers.items()}

    def complete(self) -> bool:
        """Whether there is nothing more to wait for."""
        aligned = not self.task.until_aligned or self.angle_deg < 0.5
        return aligned and all(self.matched().values()) and all(self.received.values())

    def spin(self, until: Callable[[], bool]) -> None:
        """Take in what comes until a condition holds or time is up."""
        end = time.monotonic() + self.task.seconds
        while not until() and time.monotonic() < end:
            rclpy.spin_once(self.node, timeout_sec=0.1)


def main() -> None:
    """Run a task."""
    rclpy.init(args=sys.argv)
    client = Client(Task(**json.loads(sys.argv[1])))
    client.spin(client.complete)
    print(json.dumps({'matched': client.matched(), 'received': client.received,
                      'angle_deg': client.angle_deg}), flush=True)


def arguments(task: Task) -> list[str]:
    """Return what runs a task."""
    return [__file__, json.dumps(asdict(task))]


if __name__ == '__main__':
    main()
