# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The node attitude_markers: what the other two say, as markers, when somebody looks."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Path
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.subscription import Subscription
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from manifold_mpc_ros.config.cones import cone_topics, cones_from
from manifold_mpc_ros.config.parameter import Value
from manifold_mpc_ros.control.input_gate import (
    RawState,
    Refusal,
    StateGate,
    admit_direction,
)
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.described_inputs import DescribedSetpoint, DescribedTorque
from manifold_mpc_ros.nodes.managed_node import INPUT_QOS, OUTPUT_QOS, ManagedNode, Status
from manifold_mpc_ros.nodes.markers.shapes import Picture, markers
from manifold_mpc_ros.nodes.state_input import StateInput, state_kinds

DESCRIPTION_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: A viewer needs no more pictures than this [s].
PERIOD_S = 0.05

Callback = Callable[[Any], None]


class AttitudeMarkersNode(ManagedNode):
    """States, setpoints, torques and plans in, one MarkerArray out, at most 20 times a second.

    While nobody subscribes to ``~/markers`` nothing is published, and nothing but setpoints is
    listened to: the controller then publishes no prediction for it.
    """

    def build(self, values: Mapping[str, Value]) -> None:
        """Make the interfaces."""
        self._frames = (str(values['inertial_frame_id']), str(values['body_frame_id']))
        self._scale = float(values['torque_length_per_n_m'])  # type: ignore[arg-type]
        self._state_source = str(values['state_source'])
        state_kinds(self._state_source)
        self._states: StateInput | None = None
        setpoint = DescribedSetpoint(str(values['setpoint_source']), self._frames[0])
        torque = DescribedTorque(
            str(values['command_sink']), self._frames[1],
            values['full_scale_torque_n_m'])  # type: ignore[arg-type]
        self._publisher = self.create_lifecycle_publisher(MarkerArray, '~/markers', OUTPUT_QOS)
        # Setpoints come seldom: one that nobody saw coming is drawn all the same.
        self._always = self._subscribe((
            (setpoint.kind, setpoint.topic, lambda message: self._take(
                'attitude_setpoint', 'R_ND', setpoint.admit(message), 'direction_N')),
            (Vector3Stamped, 'direction_setpoint', self._on_direction)))
        self._streams = (
            (torque.kind, torque.topic, lambda message: self._take(
                'torque_command', 'torque_B_n_m', torque.admit(message))),
            (Path, 'attitude_controller/prediction', self._on_prediction))
        self._while_looked_at: list[Subscription] = []
        self._directions: list[Subscription] = []
        self._described = ''
        self._always.append(self.create_subscription(
            String, 'attitude_controller/description', self._on_description, DESCRIPTION_QOS))

    def take_down(self) -> None:
        """Remove the interfaces."""
        self._unsubscribe(self._always)
        self._unsubscribe(self._directions)
        self._look_away()
        self.destroy_lifecycle_publisher(self._publisher)

    def start(self) -> None:
        """Draw from now on."""
        self.reset()
        self._paused = False
        self._timer = self.create_timer(PERIOD_S, self._on_timer, clock=self.steady_clock)

    def stop(self) -> None:
        """Draw no more."""
        self.destroy_timer(self._timer)

    def reset(self) -> None:
        """Forget what was seen."""
        self._picture = Picture(self._frames[0], torque_length_per_n_m=self._scale)
        self._gate = StateGate(*self._frames, step_s=1.0, timeout_s=1.0, timed=False)
        self._fresh = False
        self._drawn = 0
        self._draw_cones()

    def pause(self, *, paused: bool) -> None:
        """Hold the picture, or let it go on."""
        self._paused = paused

    def status(self) -> Status:
        """Say how many pictures somebody has seen."""
        looked_at = self._publisher.get_subscription_count() > 0
        return Status(
            DiagnosticStatus.OK, 'drawing' if looked_at else 'nobody looks',
            {'mode': 'PAUSED' if self._paused else 'RUN', 'pictures': self._drawn})

    def _on_timer(self) -> None:
        """Listen while somebody looks, and publish the picture when it is new."""
        looked_at = self._publisher.get_subscription_count() > 0
        if looked_at and self._states is None:
            self._states = StateInput(self, self._state_source, INPUT_QOS, self._on_state)
            self._while_looked_at = self._subscribe(self._streams)
        elif not looked_at:
            self._look_away()
        if looked_at and self._fresh and not self._paused:
            self._publisher.publish(markers(self._picture))
            self._fresh = False
            self._drawn += 1

    def _look_away(self) -> None:
        """Listen to nothing but setpoints."""
        self._unsubscribe(self._while_looked_at)
        if self._states is not None:
            self._states.close()
            self._states = None

    def _subscribe(self, wanted: Iterable[tuple[type, str, Callback]]) -> list[Subscription]:
        """Subscribe to topics, each with its type and callback."""
        return [self.create_subscription(kind, topic, callback, INPUT_QOS)
                for kind, topic, callback in wanted]

    def _unsubscribe(self, subscriptions: list[Subscription]) -> None:
        """Subscribe to these no more."""
        while subscriptions:
            self.destroy_subscription(subscriptions.pop())

    def _on_state(self, read: RawState | Refusal, _info: Mapping[str, Any]) -> None:
        """Take a state."""
        admitted = read if isinstance(read, Refusal) else self._gate.admit(read, 0)
        if isinstance(admitted, Refusal):
            self.refusals.add('state', admitted)
            return
        self._picture.R_NB, self._picture.stamp_ns = admitted.R_NB, admitted.stamp_ns
        self._fresh = True

    def _on_direction(self, message: Vector3Stamped) -> None:
        """Take a commanded direction."""
        self._take('direction_setpoint', 'direction_N', admit_direction(
            message.header.frame_id, messages.vector_values(message.vector),
            self._frames[0]), 'R_ND')

    def _on_description(self, message: String) -> None:
        """Take the cones that the controller works with."""
        self._described = message.data
        if self.active:
            self._draw_cones()

    def _draw_cones(self) -> None:
        """Draw the cones of the controller's description, and listen to their directions."""
        values = json.loads(self._described)['parameters'] if self._described else {}
        self._unsubscribe(self._directions)
        self._picture.cones, self._picture.directions_N = cones_from(values), {}
        self._directions = self._subscribe(
            (Vector3Stamped, topic, partial(self._on_cone_direction, name))
            for name, (topic, _) in cone_topics(values).items())
        self._fresh = True

    def _on_cone_direction(self, name: str, message: Vector3Stamped) -> None:
        """Take the direction of a cone."""
        admitted = admit_direction(message.header.frame_id, messages.vector_values(
            message.vector), self._frames[0])
        if not isinstance(admitted, Refusal):
            self._take(name, 'directions_N', {**self._picture.directions_N, name: admitted})

    def _on_prediction(self, message: Path) -> None:
        """Take a plan; its positions are the path of a body axis on the unit sphere."""
        points = [pose.pose.position for pose in message.poses]
        finite = all(np.isfinite((point.x, point.y, point.z)).all() for point in points)
        if self.active and finite and message.header.frame_id == self._frames[0]:
            self._picture.prediction_N = points
            self._fresh = True

    def _take(
        self, topic: str, field: str, admitted: Any, instead: str = '',
    ) -> None:
        """Put a value that passed the gate into the picture; another one ends with it."""
        if not self.active:
            return
        if isinstance(admitted, Refusal):
            self.refusals.add(topic, admitted)
            return
        setattr(self._picture, field, admitted)
        if instead:
            setattr(self._picture, instead, None)
        self._fresh = True
