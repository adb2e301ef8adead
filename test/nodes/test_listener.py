# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What listens to several topics hears each of them."""

from __future__ import annotations

import time
from contextlib import ExitStack

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

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
