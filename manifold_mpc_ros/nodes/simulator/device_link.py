# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The simulator's devices over ROS: wheels, thrusters, dipoles commanded; speeds, field out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from geometry_msgs.msg import Vector3Stamped
from sensor_msgs.msg import JointState, MagneticField
from std_msgs.msg import Float64MultiArray

from manifold_mpc_ros.config.interfaces import MAGNETIC_FIELD, WHEEL_STATES, command_topics
from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.control.input_gate import Reason, Refusal
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.managed_node import INPUT_QOS, ManagedNode
from manifold_mpc_ros.sim.plant_loop import PlantLoop


class DeviceLink:
    """Commands of devices in place of body torques, or beside them, where the body has devices.

    In lockstep ``torque_command``, which has the stamp, says what state is answered, and counts
    with the message of ``wheel_commands``, ``thruster_commands`` and ``dipole_command`` that has
    the same place in its publisher's sequence. Otherwise commands act when they come.

    Arguments
    ---------
    node
        Who publishes and subscribes.
    config
        Of the plant.
    loop
        Returns the plant, which commands that come act on when it is not in lockstep.

    """

    def __init__(self, node: ManagedNode, config: SimulatorConfig,
                 loop: Callable[[], PlantLoop]) -> None:
        """Open the topics where there are devices."""
        self._node, self._loop, self._lockstep = node, loop, config.lockstep
        motors = config.wheel_motors
        self._array = config.thrusters if motors is None else motors.wheels
        self._devices = command_topics('thrusters' if motors is None else 'wheels')[0][0]
        self._dipole = command_topics('magnetorquers')[0][0]
        self._states = None if motors is None else node.advertise(JointState, WHEEL_STATES[0])
        self._field = None if config.orbit is None else node.advertise(
            MagneticField, MAGNETIC_FIELD[0])
        self._body_frame_id = config.body_frame_id
        self._waiting: tuple[Any, Callable[[], None]] | None = None
        self._latest: dict[str, tuple[Any, Array]] = {}
        self._subscriptions = {}
        if self._array is not None:
            self._subscriptions[self._devices] = node.listen(
                Float64MultiArray, self._devices, lambda message, info: self._on_command(
                    self._devices, message.data, info), INPUT_QOS)
        if config.max_dipole_a_m2.any():
            self._subscriptions[self._dipole] = node.listen(
                Vector3Stamped, self._dipole, lambda message, info: self._on_command(
                    self._dipole, messages.vector_values(message.vector), info), INPUT_QOS)

    def close(self) -> None:
        """Close the topics."""
        for subscription in self._subscriptions.values():
            self._node.destroy_subscription(subscription)
        for publisher in (self._states, self._field):
            if publisher is not None:
                self._node.destroy_lifecycle_publisher(publisher)

    def when_commanded(self, info: Mapping[str, Any], take: Callable[[], None]) -> None:
        """Take a body torque: at once without devices, with their commands in lockstep."""
        if self._lockstep and self._subscriptions:
            self._waiting = info.get('publication_sequence_number'), take
            self._take()
        elif self._array is None:
            take()

    def command(self, torque_B_n_m: Array) -> None:
        """Command the plant: the body torque (3,), or devices (n,); and the dipole (3,)."""
        loop = self._loop()
        loop.command(self._latest[self._devices][1] if self._devices in self._latest
                     else torque_B_n_m)
        if self._dipole in self._latest:
            loop.magnetise(self._latest[self._dipole][1])

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

    def _on_command(self, topic: str, values: Any, info: Mapping[str, Any]) -> None:
        """Take a command of devices or count its refusal."""
        command = np.array(values, dtype=float)
        if not self._node.active:
            return
        n = 3 if self._array is None or topic == self._dipole else len(self._array)
        if command.shape != (n,) or not np.isfinite(command).all():
            self._node.refusals.add(topic, Refusal(
                Reason.UNREADABLE, f'not {n} finite numbers'))
            return
        self._latest[topic] = info.get('publication_sequence_number'), command
        if self._lockstep:
            self._take()
        elif topic == self._dipole:
            self._loop().magnetise(command)
        else:
            self._loop().command(command)

    def _take(self) -> None:
        """Take the body torque that waits, if the commands of all devices have come."""
        if self._waiting and all(self._latest.get(topic, (None,))[0] == self._waiting[0]
                                 for topic in self._subscriptions):
            take, self._waiting = self._waiting[1], None
            take()
