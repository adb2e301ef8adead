# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What listens to several topics hears each of them."""

from __future__ import annotations

import itertools
import time
from contextlib import ExitStack

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from lifecycle_msgs.srv import GetState
from std_msgs.msg import String

from manifold_mpc_ros.cli.processes import reserved_domain
from manifold_mpc_ros.lab.recording.nodes.listener import Listener


def test_a_topic_that_never_rests_keeps_no_other_from_being_heard() -> None:
    with ExitStack() as stack:
        listener = Listener('listener', stack.enter_context(reserved_domain()))
        stack.push(listener.__exit__)
        node, heard = listener.node, []
        busy = node.create_publisher(String, 'busy', 100)
        rare = node.create_publisher(String, 'rare', 100)
        node.create_subscription(String, 'busy', busy.publish, 100)
        node.create_subscription(String, 'rare', heard.append, 100)

        def watch() -> None:
            assert time.monotonic() < end_s, 'not heard'

        end_s = time.monotonic() + 30.0
        listener.until(lambda: min(busy.get_subscription_count(),
                                   rare.get_subscription_count()) > 0, watch)
        for _ in range(50):
            busy.publish(String())
        rare.publish(String())
        listener.until(lambda: bool(heard), watch)


def test_a_node_is_met_when_each_side_knows_the_other() -> None:
    """Its answer does not tell that its publisher is known: here there is none until later."""
    with ExitStack() as stack:
        domain = stack.enter_context(reserved_domain())
        listener, node = (Listener(name, domain) for name in ('listener', 'late'))
        for each in (listener, node):
            stack.push(each.__exit__)
        answers: list[GetState.Response] = []
        heard: list[String] = []
        publishers = []
        listener.subscribe(String, '/topic', heard.append, 100)

        def answer(_: GetState.Request, response: GetState.Response) -> GetState.Response:
            answers.append(response)
            return response

        def watch() -> None:
            assert time.monotonic() < end_s, 'not met'
            node.spin(0.001)

        def watch_and_publish() -> None:
            watch()
            if next(looks) == 50:
                publishers.append(node.node.create_publisher(String, '/topic', 100))

        node.node.create_service(GetState, '/late/get_state', answer)
        end_s, looks = time.monotonic() + 60.0, itertools.count()
        listener.meet('late', watch)
        assert answers
        assert not listener.hears(['/topic'])
        listener.meet('late', watch_and_publish, ['/topic'])
        assert listener.hears(['/topic'])
        assert publishers[0].get_subscription_count() == 1
        publishers[0].publish(String())
        listener.until(lambda: bool(heard), watch)
