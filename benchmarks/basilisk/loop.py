# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The installed controller over DDS around a spacecraft in Basilisk, in lockstep.

The controller is the executable, in a process of its own. This program speaks the topics of a
plant (docs/nodes.md): a state, and the speeds of wheels, with one stamp a control period; then it
waits for the torque that has that stamp, and with devices for their command of the same place in
the publisher's sequence, and moves Basilisk on under it.
"""

from __future__ import annotations

import json
import math
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import rclpy
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Transform, Twist, WrenchStamped
from link import BasiliskProcess, PlantState
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from manifold_mpc_ros.cli.processes import NodeProcesses, node_environment, reserved_domain
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.nodes import messages

#: Stamp of the first state [ns].
START_NS = 1_800_000_000 * 10**9
#: A state is said again after this, and given up after that [s of wall clock].
AGAIN_S, PATIENCE_S = 1.0, 300.0
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@dataclass
class History:
    """A run: the states (n + 1), and between them the commands (n, ...) of the devices.

    These are motor torques [N m], on-times [s], or (n, 0) without devices.
    """

    states: list[PlantState]
    device: list[Array] = field(default_factory=list)


class Controller:
    """The executable ``controller`` in lockstep, and this end of its topics; a context manager.

    Arguments
    ---------
    parameters
        ROS parameters that are not as shipped, by name.
    device
        Topic of the devices' commands, '' for body torques.
    wheels
        Names of the wheels, whose speeds are reported.

    ``said`` is the last of /diagnostics, ``ticks`` mode and solver status of each tick.
    """

    def __init__(self, parameters: Mapping[str, Any], device: str = '',
                 wheels: Sequence[str] = ()) -> None:
        """Know what is to be started."""
        self._parameters, self._wheels = parameters, list(wheels)
        self._topic = device
        self._torque: tuple[int, int, Array] = (0, -1, np.zeros(3))
        self._device: tuple[int, Array] = (-1, np.zeros(0))
        self.said: dict[str, str] = {}
        self.ticks: dict[int, tuple[str, str]] = {}

    def __enter__(self) -> Controller:
        """Start the process and the node."""
        self._reserved = reserved_domain()
        domain = self._reserved.__enter__()
        self._folder = tempfile.TemporaryDirectory()
        file = Path(self._folder.name) / 'parameters.yaml'
        file.write_text(json.dumps({'/**': {'ros__parameters': {
            'lockstep': True, **self._parameters}}}), encoding='utf-8')
        rclpy.init(domain_id=domain)
        self.node = Node('basilisk')
        self._open()
        self._processes = NodeProcesses()
        self._processes.start('controller', ['--params-file', str(file)],
                              node_environment(domain), Path(self._folder.name) / 'controller.log')
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 traceback: TracebackType | None) -> None:
        """End them."""
        self._processes.stop()
        self.node.destroy_node()
        rclpy.shutdown()
        self._folder.cleanup()
        self._reserved.__exit__(None, None, None)

    def _open(self) -> None:
        """Make the topics."""
        self._odometry = self.node.create_publisher(Odometry, 'odometry', 10)
        self._speeds = self.node.create_publisher(JointState, 'wheel_states', 10)
        self._reference = self.node.create_publisher(
            MultiDOFJointTrajectory, 'reference', LATCHED)
        self.node.create_subscription(WrenchStamped, 'torque_command', self._on_torque, 10)
        if self._topic:
            self.node.create_subscription(
                Float64MultiArray, self._topic, self._on_device, 10)
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 100)

    def follow(self, after_ns: Sequence[int], points: Sequence[tuple[Array, Array, Array]]
               ) -> None:
        """Command a trajectory whose points are so long after the first state, until it is heard.

        Each is R_ND, and rate and acceleration in the axes of the target [rad/s, rad/s^2].
        """
        message = MultiDOFJointTrajectory(joint_names=['body'])
        message.header.frame_id = 'inertial'
        message.header.stamp = messages.to_stamp(START_NS)
        for after, (R_ND, omega, alpha) in zip(after_ns, points):
            seconds, rest = divmod(int(after), 10**9)
            message.points.append(MultiDOFJointTrajectoryPoint(
                transforms=[Transform(rotation=messages.to_quaternion(R_ND))],
                velocities=[Twist(angular=messages.to_vector(omega))],
                accelerations=[Twist(angular=messages.to_vector(alpha))],
                time_from_start=Duration(sec=seconds, nanosec=rest)))
        self._until(lambda: int(self.said.get('setpoints', '0')) > 0,
                    lambda: self._reference.publish(message), again_s=20.0)

    def answer(self, state: PlantState) -> tuple[Array, Array]:
        """Return body torque (3,) [N m] and device command (n,) that answer a state."""
        stamp_ns = START_NS + round(1e9 * state.time_s)
        odometry = Odometry(child_frame_id='base_link')
        odometry.header.frame_id = 'inertial'
        odometry.header.stamp = messages.to_stamp(stamp_ns)
        odometry.pose.pose.orientation = messages.to_quaternion(state.measured_R_NB)
        odometry.twist.twist.angular = messages.to_vector(state.measured_omega_BN_B)
        speeds = JointState(name=self._wheels, velocity=state.wheel_speed_rad_s.tolist())
        speeds.header.stamp = odometry.header.stamp

        def say() -> None:
            if self._wheels:
                self._speeds.publish(speeds)
            self._odometry.publish(odometry)

        self._until(lambda: self._torque[0] == stamp_ns and (
            not self._topic or self._device[0] == self._torque[1]), say)
        return self._torque[2], self._device[1]

    def _until(self, condition: Callable[[], bool], say: Callable[[], None],
               again_s: float = AGAIN_S) -> None:
        """Say something, again now and then, until a condition holds."""
        end_s, said_s = time.monotonic() + PATIENCE_S, -math.inf
        while not condition():
            now_s = time.monotonic()
            ended = self._processes.ended()
            if ended is not None or now_s > end_s:
                raise SystemExit('the controller ' + (
                    f'has ended: {ended.last_words()}' if ended else
                    f'does not answer; it says {self.said}'))
            if now_s - said_s > again_s:
                said_s = now_s
                say()
            rclpy.spin_once(self.node, timeout_sec=0.1)

    def _on_torque(self, message: WrenchStamped, info: Mapping[str, Any]) -> None:
        """Keep a torque with its stamp and its place in the sequence."""
        self._torque = (messages.nanoseconds(message.header.stamp),
                        int(info['publication_sequence_number']),
                        np.array(messages.vector_values(message.wrench.torque)))

    def _on_device(self, message: Float64MultiArray, info: Mapping[str, Any]) -> None:
        """Keep a command of devices with its place in the sequence."""
        self._device = int(info['publication_sequence_number']), np.array(message.data)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """Keep what the controller says."""
        for status in message.status:
            self.said = {pair.key: pair.value for pair in status.values} | {
                'message': status.message}
            if self.said.get('ticks', '0') != '0':
                self.ticks[int(self.said['ticks'])] = (
                    self.said['mode'], self.said.get('solver_status', 'none'))


def fly(controller: Controller, plant: BasiliskProcess, steps: int,
        disturbance: Callable[[float], Array] = lambda _: np.zeros(3)) -> History:
    """Close the loop for so many control periods; a disturbance torque (3,) acts by time [N m]."""
    history = History([plant.state])
    for _ in range(steps):
        torque, device = controller.answer(plant.state)
        time_s = plant.state.time_s
        history.device.append(device)
        history.states.append(plant.advance(
            command=device if device.size else torque, disturbance_B_n_m=disturbance(time_s)))
    return history


def error_rad(R_ND: Array, R_NB: Array) -> float:
    """Return the angle that is left to turn [rad]."""
    return float(so3.angle(R_ND.T @ R_NB))
