# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The node attitude_guidance: a timer around `Guidance`."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Transform, Twist, Vector3Stamped
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from manifold_mpc_ros.config.guidance import GuidanceConfig
from manifold_mpc_ros.config.parameter import Value
from manifold_mpc_ros.control.guidance.laws import Guidance
from manifold_mpc_ros.control.guidance.orbit import sun_direction_N
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.managed_node import ManagedNode, Status
from manifold_mpc_ros.nodes.usage import Program

#: Points of a reference are at whole multiples of this, the same ones in every message.
SPACING_NS = NANOSECONDS


class AttitudeGuidanceNode(ManagedNode):
    """Publishes every ``period_s`` the attitudes of the next ``ahead_s``, and where the Sun is.

    Parameters that may change, the mode among them, count from the next publication on, which is
    at once.
    """

    def __init__(self, program: Program, *, complete: bool) -> None:
        """Declare parameters and the interfaces that exist in every lifecycle state."""
        super().__init__(program, complete=complete)
        self._table.take_at_run_time(self._guidance, self._change)

    def build(self, values: Mapping[str, Value]) -> None:
        """Find the orbit, then make the interfaces."""
        self._set = self._guidance(values)
        self._reference = self.advertise(MultiDOFJointTrajectory, 'reference')
        self._sun = self.advertise(Vector3Stamped, 'sun_direction')

    def take_down(self) -> None:
        """Remove the interfaces."""
        self.destroy_lifecycle_publisher(self._reference)
        self.destroy_lifecycle_publisher(self._sun)

    def start(self) -> None:
        """Publish from now on."""
        self._published, self._paused = 0, False
        self._rate_rad_s = math.nan
        self._timer = self.tick_every(self._set[0].period_s, 'publish', self._publish)
        self._publish()

    def stop(self) -> None:
        """Publish no more."""
        self.destroy_timer(self._timer)

    def reset(self) -> None:
        """Publish at once."""
        self._publish()

    def pause(self, *, paused: bool) -> None:
        """Publish nothing, or go on."""
        self._paused = paused

    def status(self) -> Status:
        """Say what is commanded, and whether the target on the ground can be seen."""
        config, guidance = self._set
        status = Status(DiagnosticStatus.OK, config.mode, {
            'mode': 'PAUSED' if self._paused else config.mode, 'published': self._published,
            'rate_rad_s': self._rate_rad_s})
        if config.mode == 'target':
            elevation = float(guidance.elevation_rad(np.array([self._now_ns()]))[0])
            status.values['elevation_deg'] = math.degrees(elevation)
            if elevation < 0.0:
                status.level = DiagnosticStatus.WARN
                status.message = 'the Earth hides the target: it is below the horizon'
        return status

    @staticmethod
    def _guidance(values: Mapping[str, Value]) -> tuple[GuidanceConfig, Guidance]:
        """Return a configuration and its attitudes."""
        config = GuidanceConfig.from_parameters(values)
        return config, Guidance(config)

    def _change(self, values: dict[str, Value]) -> None:
        """Command what new parameters say."""
        self._set = self._guidance(values)
        if self.active:
            self._publish()

    def _now_ns(self) -> int:
        """Return the time of the node's clock."""
        return int(self.get_clock().now().nanoseconds)

    def _publish(self) -> None:
        """Publish a reference that has begun already, and the direction of the Sun."""
        if self._paused:
            return
        (config, guidance), now_ns = self._set, self._now_ns()
        begin_ns = now_ns // SPACING_NS * SPACING_NS
        reference = to_reference(guidance, begin_ns, SPACING_NS, math.ceil(
            config.ahead_s * NANOSECONDS / SPACING_NS) + 2, config.inertial_frame_id)
        self._reference.publish(reference)
        self._sun.publish(to_sun_direction(now_ns, config.inertial_frame_id))
        self._published += 1
        rate = reference.points[0].velocities[0].angular
        self._rate_rad_s = math.hypot(*messages.vector_values(rate))


def to_reference(
    guidance: Guidance, begin_ns: int, spacing_ns: int, count: int, frame_id: str,
) -> MultiDOFJointTrajectory:
    """Return so many points of what guidance commands, from a time on [ns], so far apart [ns]."""
    after_ns = np.arange(count) * spacing_ns
    reference = MultiDOFJointTrajectory(joint_names=['body'])
    reference.header.frame_id = frame_id
    reference.header.stamp = messages.to_stamp(begin_ns)
    for after, R_ND, omega, alpha in zip(
            after_ns.tolist(), *guidance.points(begin_ns + after_ns), strict=True):
        seconds, rest = divmod(after, NANOSECONDS)
        reference.points.append(MultiDOFJointTrajectoryPoint(
            transforms=[Transform(rotation=messages.to_quaternion(R_ND))],
            velocities=[Twist(angular=messages.to_vector(omega))],
            accelerations=[Twist(angular=messages.to_vector(alpha))],
            time_from_start=Duration(sec=seconds, nanosec=rest)))
    return reference


def to_sun_direction(time_ns: int, frame_id: str) -> Vector3Stamped:
    """Return where the Sun is at a time [ns since 1970]."""
    sun = Vector3Stamped(vector=messages.to_vector(sun_direction_N(np.array([time_ns]))[0]))
    sun.header.frame_id, sun.header.stamp = frame_id, messages.to_stamp(time_ns)
    return sun
