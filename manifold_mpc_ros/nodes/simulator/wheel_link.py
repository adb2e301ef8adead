# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The simulator's reaction wheels over ROS: wheel_commands in, wheel_states out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from manifold_mpc_ros.config.checks import FloatArray
from manifold_mpc_ros.config.interfaces import WHEEL_STATES, command_topics
from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.control.input_gate import Reason, Refusal
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.managed_node import INPUT_QOS, ManagedNode

_TOPIC = command_topics('wheels')[0][0]


class WheelLink:
    """Motor torques in place of body torques, where the body has wheels.

    In lockstep ``torque_command``, which has the stamp, says what state is answered, and counts
    with the message of ``wheel_commands`` that has the same place in its publisher's sequence.
    Otherwise motor torques act when they come.

    Arguments
    ---------
    node
        Who publishes and subscribes.
    config
        Of the plant.
    act
        Puts motor torques in force when they come, not in lockstep.

    """

    def __init__(self, node: ManagedNode, config: SimulatorConfig,
                 act: Callable[[FloatArray], None]) -> None:
        """Open the topics where there are wheels."""
        self._node, self._motors, self._lockstep = node, config.wheel_motors, config.lockstep
        self._act = act
        self._latest: tuple[Any, FloatArray] | None = None
        self._waiting: tuple[Any, Callable[[], None]] | None = None
        if self._motors is not None:
            self._states = node.advertise(JointState, WHEEL_STATES[0])
            self._commands = node.listen(Float64MultiArray, _TOPIC, self._on_command, INPUT_QOS)

    def close(self) -> None:
        """Close the topics."""
        if self._motors is not None:
            self._node.destroy_subscription(self._commands)
            self._node.destroy_lifecycle_publisher(self._states)

    def when_commanded(self, info: Mapping[str, Any], take: Callable[[], None]) -> None:
        """Take a body torque: at once without wheels, with its motor torques in lockstep."""
        if self._motors is None:
            take()
        elif self._lockstep:
            self._waiting = info.get('publication_sequence_number'), take
            self._take()

    def command(self, torque_B_n_m: FloatArray) -> FloatArray:
        """Return what is commanded to the plant: the body torque (3,), or motor torques (n,)."""
        return torque_B_n_m if self._latest is None else self._latest[1]

    def publish(self, stamp_ns: int, speed_rad_s: FloatArray | None) -> None:
        """Publish the speeds (n,) of the wheels, if there are any."""
        if self._motors is not None and speed_rad_s is not None:
            message = JointState(name=list(self._motors.wheels.names),
                                 velocity=speed_rad_s.tolist())
            message.header.stamp = messages.to_stamp(stamp_ns)
            self._states.publish(message)

    def _on_command(self, message: Float64MultiArray, info: Mapping[str, Any]) -> None:
        """Take motor torques or count their refusal."""
        assert self._motors is not None
        motors = np.array(message.data, dtype=float)
        if not self._node.active:
            return
        if motors.shape != (len(self._motors.wheels),) or not np.isfinite(motors).all():
            self._node.refusals.add(_TOPIC, Refusal(
                Reason.UNREADABLE, f'not {len(self._motors.wheels)} finite numbers'))
            return
        self._latest = info.get('publication_sequence_number'), motors
        if self._lockstep:
            self._take()
        else:
            self._act(motors)

    def _take(self) -> None:
        """Take the body torque that waits, if its motor torques have come."""
        if self._waiting and self._latest and self._waiting[0] == self._latest[0]:
            take, self._waiting = self._waiting[1], None
            take()
