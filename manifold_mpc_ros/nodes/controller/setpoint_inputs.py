# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Topics that command what to aim at: attitudes, directions, and what moves."""

from __future__ import annotations

from collections.abc import Callable

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Twist, Vector3Stamped
from nav_msgs.msg import Odometry
from trajectory_msgs.msg import MultiDOFJointTrajectory

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.input_gate import NANOSECONDS, Refusal, Vector, admit_direction
from manifold_mpc_ros.control.moving.gate import (
    Frame,
    Point,
    admit_moving,
    admit_trajectory,
)
from manifold_mpc_ros.control.target import FixedTarget, Target
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.target import attitude_towards
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.described_inputs import DescribedSetpoint
from manifold_mpc_ros.nodes.managed_node import ManagedNode
from manifold_mpc_ros.nodes.setpoint_input import SetpointInput


class SetpointInputs:
    """Hands to the loop what is commanded while the node is active; refusals are counted.

    ``now_ns`` returns the clock of the stamps [ns], None while nothing tells it. ``count`` is how
    many setpoints were taken.
    """

    def __init__(
        self, node: ManagedNode, config: ControllerConfig, loop: ControlLoop,
        now_ns: Callable[[], int | None],
    ) -> None:
        """Listen until `close`."""
        self._node, self._config, self._loop, self._now_ns = node, config, loop, now_ns
        self.count = 0
        setpoint = DescribedSetpoint(config.setpoint_source, config.inertial_frame_id)
        self._inputs = [SetpointInput(
            node, setpoint.kind, setpoint.topic, lambda message: self._aim(
                'attitude_setpoint', _fixed(setpoint.admit(message))))]
        if config.mpc.target == 'pointing':
            self._listen(Vector3Stamped, 'direction_setpoint', self._direction)
        if config.reference_timeout_s:
            self._listen(Odometry, 'odometry_setpoint', self._odometry)
            self._listen(MultiDOFJointTrajectory, 'reference', self._trajectory)

    def close(self) -> None:
        """Listen no more."""
        for each in self._inputs:
            each.close()

    def _listen(self, kind: type, topic: str, read: Callable[..., Target | Refusal]) -> None:
        """Aim at what is read from the messages of a topic."""
        self._inputs.append(SetpointInput(
            self._node, kind, topic, lambda message: self._aim(topic, read(message))))

    def _aim(self, topic: str, admitted: Target | Refusal) -> None:
        """Take what is commanded while active, or count why it is not."""
        if not self._node.active:
            return
        if isinstance(admitted, Refusal):
            self._node.refusals.add(topic, admitted)
        else:
            self._loop.aim(admitted)
            self.count += 1

    def _direction(self, message: Vector3Stamped) -> Target | Refusal:
        """Return the attitude that points the axis along a direction."""
        admitted = admit_direction(
            message.header.frame_id, messages.vector_values(message.vector),
            self._config.inertial_frame_id)
        return admitted if isinstance(admitted, Refusal) else FixedTarget(
            attitude_towards(self._config.mpc, admitted))

    def _odometry(self, message: Odometry) -> Target | Refusal:
        """Return an attitude that goes on at its rate, which is in its own axes."""
        mpc = self._config.mpc
        return admit_moving(
            message.header.frame_id, messages.nanoseconds(message.header.stamp),
            messages.quaternion_values(message.pose.pose.orientation),
            messages.vector_values(message.twist.twist.angular), self._against(),
            valid_s=self._config.reference_timeout_s, seen_s=mpc.steps.in_periods * mpc.step_s)

    def _trajectory(self, message: MultiDOFJointTrajectory) -> Target | Refusal:
        """Return a trajectory of one body; rates and accelerations are in its own axes."""
        one = all(len(point.transforms) == 1 for point in message.points)
        points = [Point(
            _ns(point.time_from_start),
            messages.quaternion_values(point.transforms[0].rotation),
            _angular(point.velocities), _angular(point.accelerations))
            for point in message.points] if one else []
        return admit_trajectory(
            message.header.frame_id, messages.nanoseconds(message.header.stamp), points,
            self._against())

    def _against(self) -> Frame:
        """Return what moving targets are checked against."""
        return Frame(self._config.inertial_frame_id, self._now_ns())


def _fixed(admitted: Array | Refusal) -> Target | Refusal:
    """Return an attitude as a target, a refusal as it is."""
    return admitted if isinstance(admitted, Refusal) else FixedTarget(admitted)


def _angular(given: list[Twist]) -> Vector | None:
    """Return the angular part of the one that is given, None where there is none."""
    return messages.vector_values(given[0].angular) if len(given) == 1 else None


def _ns(duration: Duration) -> int:
    """Return a duration in nanoseconds."""
    return int(duration.sec) * NANOSECONDS + int(duration.nanosec)
