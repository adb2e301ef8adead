# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a scenario puts into a run from outside: setpoints at their times, links with faults."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence

from geometry_msgs.msg import Vector3, Vector3Stamped
from trajectory_msgs.msg import MultiDOFJointTrajectory

from manifold_mpc_ros.config.description import Part
from manifold_mpc_ros.control.described.conversions import write_attitude
from manifold_mpc_ros.control.described.state_writer import write_part
from manifold_mpc_ros.control.guidance.laws import Guidance
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.lab.recording.nodes.bag_recorder import BagRecorder
from manifold_mpc_ros.lab.recording.nodes.link import Link
from manifold_mpc_ros.lab.recording.nodes.listener import LOOK_S, Watch, setpoints_taken
from manifold_mpc_ros.lab.recording.nodes.raw import DEEP_QOS, StampReader, message_class
from manifold_mpc_ros.lab.recording.record_plan import REFERENCE
from manifold_mpc_ros.lab.recording.scenarios.parts import LinkFault, Setpoint
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.guidance.node import to_reference, to_sun_direction
from manifold_mpc_ros.nodes.setpoint_input import LATCHED_QOS
from manifold_mpc_ros.nodes.simulator.node import SIMULATED_EPOCH_NS

#: A setpoint that the controller has not counted is published again after this [s].
PUBLISH_AGAIN_S = 1.0
#: Between two looks at a link's late messages [s].
LINK_LOOK_S = 0.002
#: A reference has no more points than this, whole seconds apart.
MOST_POINTS = 1500
SUN_DIRECTION = '/sun_direction'


class RunInputs:
    """Publishes setpoints, and passes messages between the nodes where a link stands.

    A setpoint carries the simulated time that it is meant for as its stamp. In lockstep the
    state of that time is held back until the controller has counted the setpoint.

    Arguments
    ---------
    recorder
        Whose node publishes, and which hears what the controller says.
    setpoints
        In the order of time.
    links
        By source: target, type and fault of each link, and what reads the stamps.
    state_topic
        The source of the link that lockstep holds back.
    lockstep, wall_clock, wall_per_s
        How time goes; wall clock in a second of simulated time [s].
    frames
        Of the inertial axes and of the body.
    setpoint
        How commanded attitudes are said.
    cone_topics
        The topics of directions of cones, by cone.
    guidance, end_s
        What commands attitudes that move, by mode, and until when [s]. A cone whose topic is
        ``/sun_direction`` has the direction of the Sun with each.

    """

    def __init__(
        self, recorder: BagRecorder, setpoints: Sequence[Setpoint],
        links: Mapping[str, tuple[str, str, LinkFault, StampReader]], state_topic: str, *,
        lockstep: bool, wall_clock: bool, wall_per_s: float, frames: tuple[str, str],
        setpoint: Part, cone_topics: Mapping[str, str], guidance: Mapping[str, Guidance],
        end_s: float,
    ) -> None:
        """Make publishers and links."""
        self._recorder = recorder
        self._setpoints = list(setpoints)
        self._lockstep = lockstep
        self._frames, self._described = frames, setpoint
        self._epoch_ns: int | None = None if wall_clock else SIMULATED_EPOCH_NS
        self._counted_before = 0
        self._published_s: float | None = None
        node = recorder.node
        self._kind = message_class(setpoint.message_type)
        self._attitude = node.create_publisher(self._kind, setpoint.topic, DEEP_QOS)
        topics: dict[str | None, str] = {None: '/direction_setpoint'}
        topics.update(cone_topics.items())
        self._directions = {cone: node.create_publisher(Vector3Stamped, topic, DEEP_QOS)
                            for cone, topic in topics.items()}
        self._guidance, self._end_s = guidance, end_s
        self._reference = node.create_publisher(
            MultiDOFJointTrajectory, REFERENCE, LATCHED_QOS) if guidance else None
        self._sun = next((self._directions[cone] for cone, topic in cone_topics.items()
                          if topic == SUN_DIRECTION), None)
        self._links: dict[str, Link] = {}
        for source, (target, kind, fault, stamp_of) in links.items():
            message = message_class(kind)
            assert message is not None
            self._links[source] = Link(
                node, message, source, target, fault, wall_per_s, stamp_of)
        self._gate = self._links.get(state_topic)

    @property
    def lost(self) -> dict[str, int]:
        """Return how many messages each link lost."""
        return {source: link.lost for source, link in self._links.items()}

    def command_first(self, watch: Watch) -> None:
        """Publish the setpoint of time 0 and wait until the controller has counted it."""
        if self._setpoints and self._setpoints[0].at_s == 0.0:
            self._recorder.until(self._controller_listens, watch)
            self._recorder.until(self._counted, watch)
        self._hold_back()

    def begin(self, first_ns: int) -> None:
        """Count time from the first state."""
        self._epoch_ns = first_ns

    def tend(self, elapsed_s: float) -> None:
        """Publish what is due, deliver what was late."""
        while self._setpoints and self._due(elapsed_s):
            if self._lockstep:
                if not self._counted():
                    break
                self._hold_back()
            else:
                self._publish(self._setpoints.pop(0))
        for link in self._links.values():
            link.poll()

    def wait(self, recorder: BagRecorder) -> None:
        """Take in what comes for a short while."""
        recorder.spin(LINK_LOOK_S if self._links else LOOK_S)

    def _due(self, elapsed_s: float) -> bool:
        """Say whether the next setpoint's time has come."""
        return elapsed_s >= self._setpoints[0].at_s - 1e-9

    def _hold_back(self) -> None:
        """Let states pass up to the next setpoint, in lockstep."""
        if self._gate is not None and self._lockstep:
            self._gate.hold_from_ns = (
                self._stamp_ns(self._setpoints[0]) if self._setpoints else None)

    def _controller_listens(self) -> bool:
        """Say whether somebody but the recorder reads the setpoints."""
        return all(each.get_subscription_count() > 1 for each in (
            self._attitude, self._reference, self._sun) if each is not None)

    def _counted(self) -> bool:
        """Publish the next setpoint, now and then again; true once the controller counted it."""
        count = setpoints_taken(self._recorder.controller)
        now_s = time.monotonic()
        if self._published_s is None:
            self._counted_before = count
        elif count >= self._counted_before + self._messages(self._setpoints[0]):
            self._published_s = None
            self._setpoints.pop(0)
            return True
        if self._published_s is None or now_s - self._published_s > PUBLISH_AGAIN_S:
            self._published_s = now_s
            self._publish(self._setpoints[0])
        return False

    def _messages(self, setpoint: Setpoint) -> int:
        """Return of how many messages a setpoint is."""
        return 1 + (setpoint.guidance is not None and self._sun is not None)

    def _publish(self, setpoint: Setpoint) -> None:
        """Publish one setpoint."""
        stamp_ns = self._stamp_ns(setpoint)
        if setpoint.guidance is not None:
            assert self._reference is not None
            if self._sun is not None:
                self._sun.publish(to_sun_direction(stamp_ns, self._frames[0]))
            seconds = self._end_s - setpoint.at_s
            spacing_s = math.ceil(seconds / MOST_POINTS)
            self._reference.publish(to_reference(
                self._guidance[setpoint.guidance], stamp_ns, spacing_s * NANOSECONDS,
                math.ceil(seconds / spacing_s) + 1, self._frames[0]))
        elif setpoint.attitude_xyzw is not None:
            x, y, z, w = map(float, setpoint.attitude_xyzw)
            assert self._kind is not None
            attitude = self._kind()
            write_part(self._described, attitude, stamp_ns, write_attitude(
                self._described.convention, (x, y, z, w)), self._frames)
            self._attitude.publish(attitude)
        elif setpoint.direction_N is not None:
            x, y, z = map(float, setpoint.direction_N)
            direction = Vector3Stamped(vector=Vector3(x=x, y=y, z=z))
            direction.header.stamp = messages.to_stamp(stamp_ns)
            direction.header.frame_id = self._frames[0]
            self._directions[setpoint.cone].publish(direction)

    def _stamp_ns(self, setpoint: Setpoint) -> int:
        """Return the time that a setpoint is meant for; now, where none has begun [ns]."""
        if self._epoch_ns is None:
            return time.time_ns()
        return self._epoch_ns + round(setpoint.at_s * NANOSECONDS)
