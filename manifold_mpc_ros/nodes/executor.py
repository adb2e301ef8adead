# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What runs the callbacks of a node: messages and timers at once, the rest now and then."""

from __future__ import annotations

import time

from rclpy.executors import SingleThreadedExecutor, TimeoutException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.subscription import Subscription
from rclpy.timer import Timer
from rclpy.utilities import timeout_sec_to_nsec

from manifold_mpc_ros.nodes.barrier import Barrier


class GuardedExecutor(SingleThreadedExecutor):
    """An executor that is quick with messages, and that an error leaves in working order.

    rclpy's own looks at everything that a node has, QoS events included, twice for each message,
    which takes as long as a control tick. Here messages and timers are waited for and run by
    themselves; all else is run by rclpy's executor, when a service is asked for and now and
    then. Nor does it call an entity again whose message could not be taken, or the others of its
    callback group: what was marked as executing stays so.
    """

    def __init__(self, barrier: Barrier) -> None:
        """Wait for nodes."""
        super().__init__()
        for take in ('timer', 'subscription', 'client', 'service', 'waitable'):
            name = f'_take_{take}'
            setattr(self, name, barrier.guarded(f'taking a {take}', getattr(self, name)))
        self._guarded = barrier.guarded
        self._all_run_s = 0.0

    def spin_some(self, longest_s: float) -> None:
        """Wait so long at most [s] and run what has come; all else no less often."""
        asked = self._guarded('the executor', self._run_messages)(longest_s)
        if asked or time.monotonic() - self._all_run_s >= longest_s:
            self._guarded('the executor', self._run_all)()
            self._all_run_s = time.monotonic()

    def _run_messages(self, longest_s: float) -> bool:
        """Wait; run timers that are due and what messages call; return whether more has come."""
        nodes = self.get_nodes()
        subscriptions = [each for node in nodes for each in node.subscriptions]
        timers = [each for node in nodes for each in node.timers]
        services = [each for node in nodes for each in node.services]
        wait_set = rclpy_implementation.WaitSet(
            len(subscriptions), 1, len(timers), 0, len(services), 0, self.context.handle)
        wait_set.clear_entities()
        for add, entities in ((wait_set.add_subscription, subscriptions),
                              (wait_set.add_timer, timers), (wait_set.add_service, services),
                              (wait_set.add_guard_condition, [self._guard])):
            for each in entities:
                add(each.handle)
        wait_set.wait(timeout_sec_to_nsec(longest_s))
        heard, due, *others = map(wait_set.get_ready_entities, (
            'subscription', 'timer', 'service', 'guard_condition'))
        for timer in timers if due else ():
            if timer.handle.pointer in due:
                self._guarded('taking a timer', _run_timer)(timer)
        for subscription in subscriptions if heard else ():
            if subscription.handle.pointer in heard:
                self._guarded('taking a subscription', _run_subscription)(subscription)
        return any(others)

    def _run_all(self) -> None:
        """Run everything that is ready, once."""
        while True:
            try:
                handler, _, _ = self.wait_for_ready_callbacks(0)
            except TimeoutException:
                return
            handler()
            handler.result()  # raises what the callback did


def _run_timer(timer: Timer) -> None:
    """Call what a timer calls, if it is due still and not cancelled."""
    if timer.handle.is_timer_ready():
        timer.handle.call_timer()
        timer.callback()


def _run_subscription(subscription: Subscription) -> None:
    """Take the message of a subscription, if it is there still, and call what it calls."""
    taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
    if taken is not None:
        bare = subscription._callback_type is Subscription.CallbackType.MessageOnly
        subscription.callback(*taken[:1] if bare else taken)
