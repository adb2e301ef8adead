# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node in a context of its own that watches others: spin until something holds, ask services."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from types import TracebackType
from typing import Any

import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

from manifold_mpc_ros.nodes.log_folder import NO_LOG_FILE

#: Longest wait in the executor between two looks at a condition [s].
LOOK_S = 0.02
#: An answer that does not come is asked for again after this [s].
ASK_AGAIN_S = 1.0

Condition = Callable[[], bool]
#: Called at every look; raises to give up.
Watch = Callable[[], None]


class Listener:
    """A context, a node and its executor; a context manager.

    It does not touch rclpy's default context nor any signal handler.
    """

    def __init__(self, name: str, domain_id: int) -> None:
        """Join a domain."""
        self._context = Context()
        rclpy.init(args=list(NO_LOG_FILE), context=self._context, domain_id=domain_id,
                   signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node(name, context=self._context, enable_rosout=False,
                         start_parameter_services=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._subscriptions: dict[str, Subscription] = {}

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Leave the domain."""
        self._executor.shutdown(timeout_sec=0)
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def subscribe(self, kind: type, topic: str, callback: Callable[..., None], qos: QoSProfile, *,
                  raw: bool = False) -> None:
        """Subscribe to a topic, ``/name``, once, ``raw`` to bytes."""
        self._subscriptions[topic] = self.node.create_subscription(
            kind, topic, callback, qos, raw=raw)

    def hears(self, topics: Iterable[str]) -> bool:
        """Say whether this one knows a publisher of each topic that it subscribes to."""
        return all(self._subscriptions[topic].get_publisher_count() > 0
                   for topic in topics if topic in self._subscriptions)

    def spin(self, duration_s: float) -> None:
        """Take in what comes within a while of wall clock, up to twice that where nothing comes.

        The wait stays the same from call to call: with another one rclpy's executor begins anew
        at the first subscription, and a topic that never rests keeps all others from being heard.
        """
        end_s = time.monotonic() + duration_s
        while time.monotonic() < end_s:
            self._executor.spin_once(timeout_sec=duration_s)

    def until(self, condition: Condition, watch: Watch) -> None:
        """Take in what comes until a condition holds; ``watch`` raises when it never will."""
        while not condition():
            watch()
            self.spin(LOOK_S)

    def ask(self, kind: type, name: str, request: Any, watch: Watch) -> Any:
        """Return the answer of a service, asked again until one comes.

        A client sees a service before the service sees the client, and an answer to somebody
        unknown is lost: for questions only.
        """
        client = self.node.create_client(kind, name)
        try:
            self.until(client.service_is_ready, watch)
            futures: list[Any] = []
            asked_s = time.monotonic() - ASK_AGAIN_S

            def answered() -> bool:
                nonlocal asked_s
                if time.monotonic() - asked_s >= ASK_AGAIN_S:
                    futures.append(client.call_async(request))
                    asked_s = time.monotonic()
                return any(future.done() for future in futures)

            self.until(answered, watch)
            return next(future.result() for future in futures if future.done())
        finally:
            self.node.destroy_client(client)

    def meet(self, node: str, watch: Watch, topics: Iterable[str] = ()) -> None:
        """Wait until nothing is missed of what a lifecycle node publishes on ``topics``.

        Each side finds the other by itself. By its answer the node knows this one's subscriptions,
        which were announced before the client; only they themselves know whether they have found
        its publishers, and what comes of one that is not known is dropped.
        """
        self.until(lambda: self.hears(topics), watch)
        self.ask(GetState, f'/{node}/get_state', GetState.Request(), watch)

    @property
    def middleware(self) -> str:
        """The ROS middleware in use."""
        return str(rclpy.get_rmw_implementation_identifier())

    def configure(self, node: str, watch: Watch) -> bool:
        """Configure a lifecycle node; return whether it did."""
        return self._transition(node, Transition.TRANSITION_CONFIGURE, watch)

    def activate(self, node: str, watch: Watch) -> bool:
        """Activate a lifecycle node; return whether it did."""
        return self._transition(node, Transition.TRANSITION_ACTIVATE, watch)

    def _transition(self, node: str, number: int, watch: Watch) -> bool:
        """Ask a node for a transition, once; return whether it succeeded."""
        client = self.node.create_client(ChangeState, f'/{node}/change_state')
        try:
            self.until(client.service_is_ready, watch)
            # The node's answers find a client only once it has seen that one too.
            self.meet(node, watch)
            future = client.call_async(ChangeState.Request(transition=Transition(id=number)))
            self.until(future.done, watch)
            return bool(future.result().success)
        finally:
            self.node.destroy_client(client)

    def parameters(self, node: str, watch: Watch) -> dict[str, Any]:
        """Return every parameter of a node, as it has them."""
        names = self.ask(ListParameters, f'/{node}/list_parameters', ListParameters.Request(),
                         watch).result.names
        values = self.ask(GetParameters, f'/{node}/get_parameters',
                          GetParameters.Request(names=list(names)), watch).values
        return {str(name): _plain(parameter_value_to_python(value))
                for name, value in sorted(zip(names, values, strict=True))}


def _plain(value: Any) -> Any:
    """Return arrays as lists."""
    return list(value) if hasattr(value, '__len__') and not isinstance(value, (str, bytes)) \
        else value


def setpoints_taken(said: Mapping[str, str]) -> int:
    """Return how many setpoints and directions of cones a controller says that it has taken."""
    return int(said.get('setpoints', 0)) + int(said.get('directions', 0))
