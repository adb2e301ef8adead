# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What both nodes have in common: lifecycle, parameters, diagnostics, reset and pause."""

from __future__ import annotations

import functools
import os
import time
from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.lifecycle import (
    LifecycleNode,
    LifecyclePublisher,
    LifecycleState,
    TransitionCallbackReturn,
)
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_policy_name_from_kind
from rclpy.subscription import Subscription
from rclpy.timer import Timer
from std_srvs.srv import SetBool, Trigger

from manifold_mpc_ros.config.parameter import Value
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.nodes.barrier import Barrier
from manifold_mpc_ros.nodes.bond import Bond
from manifold_mpc_ros.nodes.description import Description
from manifold_mpc_ros.nodes.messages import to_diagnostics
from manifold_mpc_ros.nodes.mode_log import ModeLog, RefusalLog
from manifold_mpc_ros.nodes.parameter_requests import make_requests_safe, make_transitions_safe
from manifold_mpc_ros.nodes.parameters import NodeParameters
from manifold_mpc_ros.nodes.security import demand_enforcement
from manifold_mpc_ros.nodes.usage import Program

DIAGNOSTICS_PERIOD_S = 0.2

#: Best effort matches every publisher. Of states only the newest counts.
STATE_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
INPUT_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
OUTPUT_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)


@dataclass
class Status:
    """What a node says about itself on /diagnostics."""

    level: bytes
    message: str
    values: dict[str, object] = field(default_factory=dict)


Transition = Callable[[Any, LifecycleState], TransitionCallbackReturn]


def noted(transition: Transition) -> Transition:
    """Let an error of our own in a transition be noted; rclpy would drop it unsaid."""
    @functools.wraps(transition)
    def run(node: ManagedNode, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            return transition(node, state)
        except Exception as error:  # noqa: BLE001  (part of the barrier)
            node.barrier.note(transition.__name__, error)
            return TransitionCallbackReturn.ERROR

    return run


class ManagedNode(LifecycleNode):
    """A lifecycle node with checked parameters, diagnostics, ``~/reset`` and ``~/pause``.

    A subclass builds its parts from the parameters, and takes them down again; it acts between
    `start` and `stop`. A mistake in the configuration fails the transition and is logged once.
    """

    #: How the node's solver runs, where it has one.
    backend = ''

    def __init__(self, program: Program, *, complete: bool) -> None:
        """Declare parameters and the interfaces that exist in every lifecycle state."""
        super().__init__(
            program.node_name, automatically_declare_parameters_from_overrides=True)
        self._table = NodeParameters(self, program.parameters, complete=complete)
        self.autostart = self._table.flag('autostart')
        self.configuring = False
        self._built = False
        self.active, self.activations = False, 0
        self.refusals = RefusalLog()
        #: What adds to each status of the active node.
        self.status_parts: list[Callable[[Status], None]] = []
        self._mode_log = ModeLog(self.get_logger(), self.refusals, 'INACTIVE')
        self.barrier = Barrier(self.get_logger().error)
        self.qos_conflicts: dict[str, tuple[str, int]] = {}
        self._failure = ''
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', OUTPUT_QOS)
        # Diagnostics go on when simulated time does not.
        self.steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._description = Description(self)
        self._bond = Bond(self, self.barrier, self.steady_clock)
        self.tick_every(DIAGNOSTICS_PERIOD_S, 'diagnostics', self.publish_diagnostics)
        self.create_service(Trigger, '~/reset', self._on_reset)
        self.create_service(SetBool, '~/pause', self._on_pause)
        make_transitions_safe(self)
        make_requests_safe(self, self._table)
        self.barrier.guard_services(self)

    @abstractmethod
    def build(self, values: Mapping[str, Value]) -> None:
        """Make everything that depends on the parameters; raise ManifoldMpcError."""

    @abstractmethod
    def take_down(self) -> None:
        """Undo `build`."""

    @abstractmethod
    def start(self) -> None:
        """Begin to act."""

    @abstractmethod
    def stop(self) -> None:
        """Cease to act, with a last safe output where there is one."""

    @abstractmethod
    def reset(self) -> None:
        """Return to how it was at the start, while active."""

    @abstractmethod
    def pause(self, *, paused: bool) -> None:
        """Hold or go on, while active."""

    @abstractmethod
    def status(self) -> Status:
        """Say how the active node is doing."""

    def tick_every(
        self, period_s: float, where: str, callback: Callable[[], None], *, ros_time: bool = False,
    ) -> Timer:
        """Call back by the steady clock, or by the node's, behind the barrier."""
        return self.create_timer(
            period_s, self.barrier.guarded(where, callback),
            clock=None if ros_time else self.steady_clock)

    def listen(self, kind: type, topic: str, callback: Callable[..., None], qos: QoSProfile, *,
               raw: bool = False) -> Subscription:
        """Subscribe, behind the barrier, ``raw`` to bytes; publishers of other QoS are noted."""
        return self.create_subscription(
            kind, topic, self.barrier.guarded(topic, callback), qos, raw=raw,
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=self._conflict_on(topic)))

    def advertise(self, kind: type, topic: str) -> LifecyclePublisher:
        """Publish; subscribers whose QoS does not fit are noted."""
        return self.create_lifecycle_publisher(
            kind, topic, OUTPUT_QOS, event_callbacks=PublisherEventCallbacks(
                incompatible_qos=self._conflict_on(topic)))

    def _conflict_on(self, topic: str) -> Callable[[Any], None]:
        """Return what notes the policy that keeps two ends of a topic apart."""
        def note(event: Any) -> None:
            policy = qos_policy_name_from_kind(event.last_policy_kind)
            self.qos_conflicts[topic] = (policy, event.total_count)
            self.get_logger().warning(f'{topic}: an end with another QoS does not match: {policy}')

        return self.barrier.guarded(f'QoS of {topic}', note)

    @noted
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Check all parameters and build; refuse with one message."""
        self.configuring = True
        begun_s = time.monotonic()
        self.get_logger().info('configuring')
        try:
            values = self._table.resolve()
            if values['secure']:
                demand_enforcement(os.environ, self.get_fully_qualified_name())
            self._bond.open(values['bond_period_s'])
            self.build(values)
            self._built = True
            self._description.publish(values, self.backend)
        except ManifoldMpcError as error:
            self._failure = str(error)
            self.get_logger().error(f'refusing to configure: {error}')
            return TransitionCallbackReturn.FAILURE
        finally:
            self.configuring = False
        self._failure = ''
        self._table.changeable = False
        self.get_logger().info(f'configured in {time.monotonic() - begun_s:.1f} s')
        return super().on_configure(state)

    @noted
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to act."""
        result = super().on_activate(state)
        self.start()
        self.active, self.activations = True, self.activations + 1
        self._bond.begin()
        self.get_logger().info('active')
        return result

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Return to unconfigured after an error of our own in a transition."""
        self._cease()
        self._bond.close()
        if self._built:
            self.barrier.guarded('taking down', self.take_down)()
        self._built = False
        self._table.changeable = True
        return super().on_error(state)

    @noted
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Cease to act; publishers stay open until the last output is out."""
        self._cease()
        return super().on_deactivate(state)

    @noted
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the configuration."""
        self._bond.close()
        self.take_down()
        self._built = False
        self._table.changeable = True
        self.get_logger().info('cleaned up')
        return super().on_cleanup(state)

    @noted
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Cease to act for good."""
        self._cease()
        self.get_logger().info('shut down')
        return super().on_shutdown(state)

    def _cease(self) -> None:
        """Stop if active."""
        if self.active:
            self.active = False
            self._bond.end()
            self.stop()

    def publish_diagnostics(self) -> None:
        """Publish the present status and the counters of everything refused."""
        if self.active:
            self.say(self.status())
        elif self._failure:
            self._report(Status(DiagnosticStatus.ERROR, self._failure, {'mode': 'UNCONFIGURED'}))
        else:
            self._note(Status(DiagnosticStatus.OK, 'not active', {'mode': 'INACTIVE'}))

    def say(self, status: Status) -> None:
        """Publish a status of the active node."""
        for add_to in self.status_parts:
            add_to(status)
        self._note(status)

    def _note(self, status: Status) -> None:
        """Publish a status; the log has what is new about it."""
        self._mode_log.note(
            str(status.values['mode']), ord(status.level), status.message, time.monotonic())
        self._report(status)

    def _report(self, status: Status) -> None:
        """Publish a status with the counters of everything refused."""
        self._add_counters(status)
        status.values |= self._bond.values()
        self._diagnostics.publish(to_diagnostics(
            self.get_clock().now().nanoseconds, self.get_fully_qualified_name().lstrip('/'),
            status.level, status.message, status.values))

    def _add_counters(self, status: Status) -> None:
        """Add everything that was refused, caught, or kept apart by its QoS."""
        status.values |= {**self.refusals.values(), **self.barrier.values()}
        for topic, (policy, count) in self.qos_conflicts.items():
            status.values[f'incompatible_qos.{topic}'] = policy
            status.values[f'incompatible_qos_ends.{topic}'] = count

    def _on_reset(
        self, _request: Trigger.Request, response: Trigger.Response,
    ) -> Trigger.Response:
        """Answer ``~/reset``."""
        response.success, response.message = self.active, 'reset' if self.active else 'not active'
        if self.active:
            self.reset()
        return response

    def _on_pause(
        self, request: SetBool.Request, response: SetBool.Response,
    ) -> SetBool.Response:
        """Answer ``~/pause``."""
        response.success, response.message = self.active, 'not active'
        if self.active:
            self.pause(paused=request.data)
            response.message = 'paused' if request.data else 'running'
        return response
