# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The simulator's devices over ROS: commands of wheels or thrusters in; speeds, field out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from sensor_msgs.msg import JointState, MagneticField
from std_msgs.msg import Float64MultiArray

from manifold_mpc_ros.config.interfaces import MAGNETIC_FIELD, WHEEL_STATES, command_topics
from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.control.input_gate import Reason, Refusal
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.managed_node import INPUT_QOS, ManagedNode


class DeviceLink:
    """Commands of devices in place of body torques, where the body has wheels or thrusters.

    In lockstep ``torque_command``, which has the stamp, says what state is answered, and counts
    with the message of ``wheel_commands`` (or ``thruster_commands``) that has the same place in
    its publisher's sequence. Otherwise commands act when they come.

    Arguments
    ---------
    node
        Who publishes and subscribes.
    config
        Of the plant.
    act
        Puts commands in force when they come, not in lockstep.

    """

    def __init__(self, node: ManagedNode, config: SimulatorConfig,
                 act: Callable[[Array], None]) -> None:
        """Open the topics where there are devices."""
        self._node, self._act, self._lockstep = node, act, config.lockstep
        motors = config.wheel_motors
        self._array = config.thrusters if motors is None else motors.wheels
        self._topic = command_topics('thrusters' if motors is None else 'wheels')[0][0]
        self._states = None if motors is None else node.advertise(JointState, WHEEL_STATES[0])
        self._field = None if config.orbit is None else node.advertise(
            MagneticField, MAGNETIC_FIELD[0])
        self._body_frame_id = config.body_frame_id
        self._latest: tuple[Any, Array] | None = None
        self._waiting: tuple[Any, Callable[[], None]] | None = None
        if self._array is not None:
            self._commands = node.listen(
                Float64MultiArray, self._topic, self._on_command, INPUT_QOS)

    def close(self) -> None:
        """Close the topics."""
        if self._array is not None:
            self._node.destroy_subscription(self._commands)
        for publisher in (self._states, self._field):
            if publisher is not None:
                self._node.destroy_lifecycle_publisher(publisher)

    def when_commanded(self, info: Mapping[str, Any], take: Callable[[], None]) -> None:
        """Take a body torque: at once without devices, with their command in lockstep."""
        if self._array is None:
            take()
        elif self._lockstep:
            self._waiting = info.get('publication_sequence_number'), take
            self._take()

    def command(self, torque_B_n_m: Array) -> Array:
        """Return what is commanded to the plant: the body torque (3,), or that of devices (n,)."""
        return torque_B_n_m if self._latest is None else self._latest[1]

    def publish(self, stamp_ns: int, speed_rad_s: Array | None, field_B_t: Array
                ) -> None:
        """Publish the speeds (n,) of the wheels, and the magnetic field (3,), if there are any."""
        if self._field is not None:
            field = MagneticField(magnetic_field=messages.to_vector(field_B_t))
            field.header.stamp = messages.to_stamp(stamp_ns)
            field.header.frame_id = self._body_frame_id
            self._field.publish(field)
        if self._array is not None and self._states is not None and speed_rad_s is not None:
            message = JointState(name=list(self._array.names), velocity=speed_rad_s.tolist())
            message.header.stamp = messages.to_stamp(stamp_ns)
            self._states.publish(message)

    def _on_command(self, message: Float64MultiArray, info: Mapping[str, Any]) -> None:
        """Take a command of devices or count its refusal."""
        assert self._array is not None
        command = np.array(message.data, dtype=float)
        if not self._node.active:
            return
        if command.shape != (len(self._array),) or not np.isfinite(command).all():
            self._node.refusals.add(self._topic, Refusal(
                Reason.UNREADABLE, f'not {len(self._array)} finite numbers'))
            return
        self._latest = info.get('publication_sequence_number'), command
        if self._lockstep:
            self._take()
        else:
            self._act(command)

    def _take(self) -> None:
        """Take the body torque that waits, if the command of the devices has come."""
        if self._waiting and self._latest and self._waiting[0] == self._latest[0]:
            take, self._waiting = self._waiting[1], None
            take()
