# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node that gives recorded states to a live controller and takes in its torques."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rosgraph_msgs.msg import Clock

from manifold_mpc_ros.config.tables import CONTROLLER_NAME
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.lab.recording.bags.decode import TRAJECTORY
from manifold_mpc_ros.lab.recording.bags.feed import (
    ATTITUDE_TOPIC,
    MOVING,
    REPORTS,
    STATE_TOPICS,
    Feed,
    FeedMessage,
)
from manifold_mpc_ros.lab.recording.nodes.listener import Listener, Watch, setpoints_taken
from manifold_mpc_ros.lab.recording.nodes.raw import DEEP_QOS, message_class
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.setpoint_input import LATCHED_QOS

NODE_NAME = 'bag_replayer'
TORQUE_TOPIC = '/torque_command'
VECTOR = 'geometry_msgs/msg/Vector3Stamped'
#: What has not been answered is published again after this [s of wall clock].
AGAIN_S = 1.0
#: Between two times on /clock [s of wall clock].
CLOCK_PERIOD_S = 0.005
#: A state is there before the time that makes a tick of it [s of wall clock].
AHEAD_S = 0.002
#: A tick comes so long after the state that it answers.
BEHIND_NS = 1_000_000
#: The torques of the last states are on their way for so long [s of wall clock].
SETTLE_S = 0.5

#: Told the time of the newest state since the first [s].
Progress = Callable[[float], None]


class Replayer(Listener):
    """Plays a feed to the controller of a domain; ``torques`` are its answers by stamp [ns]."""

    def __init__(self, domain_id: int, feed: Feed) -> None:
        """Join the domain."""
        super().__init__(NODE_NAME, domain_id)
        self._feed = feed
        self.torques: dict[int, Array] = {}
        self.controller: dict[str, str] = {}
        given = {each.topic for each in feed.setpoints}
        kinds = dict.fromkeys(given, VECTOR) | {
            STATE_TOPICS[feed.state_kind]: feed.state_kind,
            ATTITUDE_TOPIC: 'geometry_msgs/msg/QuaternionStamped'}
        kinds |= {each.topic: REPORTS[each.topic] for each in feed.reports}
        kinds |= {topic: MOVING[topic] for topic in given & MOVING.keys()}
        self._publishers: dict[str, Any] = {
            topic: self.node.create_publisher(
                message_class(kind), topic, LATCHED_QOS if kind == TRAJECTORY else DEEP_QOS)
            for topic, kind in kinds.items()}
        self._clock = self.node.create_publisher(Clock, '/clock', DEEP_QOS)
        self.subscribe(WrenchStamped, TORQUE_TOPIC, self._on_torque, DEEP_QOS)
        self.node.create_subscription(
            DiagnosticArray, '/diagnostics', self._on_diagnostics, DEEP_QOS)

    def __enter__(self) -> Replayer:
        """Return the node."""
        return self

    def meet_controller(self, watch: Watch) -> None:
        """Wait until the active controller reads what it is given and is heard."""
        read = [self._publishers[topic] for topic in (
            STATE_TOPICS[self._feed.state_kind], *REPORTS) if topic in self._publishers]
        self.until(lambda: all(each.get_subscription_count() for each in read)
                   and self.hears([TORQUE_TOPIC]) and 'setpoints' in self.controller, watch)

    def in_lockstep(self, progress: Progress, watch: Watch) -> None:
        """Give one state after the other, each when the one before has been answered.

        A setpoint is given, and counted by the controller, before the state of its time.
        """
        setpoints = list(self._feed.setpoints)
        reports: dict[int, list[FeedMessage]] = {}
        for each in self._feed.reports:
            reports.setdefault(each.stamp_ns, []).append(each)
        for state in self._feed.states:
            while setpoints and setpoints[0].stamp_ns <= state.stamp_ns:
                self._give([setpoints.pop(0)], self._another_setpoint(), watch)
            self._give([*reports.get(state.stamp_ns, []), state],
                       lambda: state.stamp_ns in self.torques, watch)  # noqa: B023
            progress((state.stamp_ns - self._feed.states[0].stamp_ns) / NANOSECONDS)

    def at_pace(
        self, rate: float, first_tick_ns: int, step_s: float, progress: Progress, watch: Watch,
    ) -> None:
        """Give everything when it is due, ``rate`` seconds of its time in one of wall clock.

        The controller follows /clock, which starts so that the controller's ticks fall just
        behind ``first_tick_ns`` and whole steps later, and goes on for one step at the end. Where
        this process is held up the clock goes on by half a step at most, so that it leaves out no
        tick.
        """
        first_ns = self._feed.states[0].stamp_ns
        end_ns = self._feed.states[-1].due_ns + round(step_s * NANOSECONDS)
        waiting = sorted(self._feed.setpoints + self._feed.reports + self._feed.states,
                         key=lambda each: each.due_ns)
        while waiting and waiting[0] in self._feed.setpoints:
            self._give([waiting.pop(0)], self._another_setpoint(), watch)
        now_ns = first_tick_ns - round(step_s * NANOSECONDS) + BEHIND_NS
        seen_s = time.monotonic()
        while now_ns < end_ns:
            watch()
            while waiting and waiting[0].due_ns <= now_ns:
                self._publishers[waiting[0].topic].publish(waiting.pop(0).data)
            self.spin(AHEAD_S)
            self._clock.publish(Clock(clock=messages.to_stamp(now_ns)))
            progress(max(0.0, min(now_ns, self._feed.states[-1].stamp_ns) - first_ns)
                     / NANOSECONDS)
            self.spin(CLOCK_PERIOD_S)
            before_s, seen_s = seen_s, time.monotonic()
            now_ns += round(min((seen_s - before_s) * rate, 0.5 * step_s) * NANOSECONDS)
        self.spin(SETTLE_S)

    def _give(self, given: Sequence[FeedMessage], taken: Callable[[], bool], watch: Watch
              ) -> None:
        """Publish messages until the controller has taken them."""
        published_s = -AGAIN_S

        def look() -> bool:
            nonlocal published_s
            now_s = time.monotonic()
            if now_s - published_s >= AGAIN_S:
                published_s = now_s
                for message in given:
                    self._publishers[message.topic].publish(message.data)
            return taken()

        self.until(look, watch)

    def _another_setpoint(self) -> Callable[[], bool]:
        """Return the condition that the controller has counted one more setpoint."""
        before = setpoints_taken(self.controller)
        return lambda: setpoints_taken(self.controller) > before

    def _on_torque(self, message: WrenchStamped) -> None:
        """Keep the first answer to each state."""
        self.torques.setdefault(messages.nanoseconds(message.header.stamp),
                                np.array(messages.vector_values(message.wrench.torque)))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """Remember what the controller last said about itself."""
        for status in message.status:
            if status.name == CONTROLLER_NAME:
                self.controller = {pair.key: pair.value for pair in status.values}
