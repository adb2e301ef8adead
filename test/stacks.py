# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plants that speak as other stacks do, each integrated in the axes and units of its own stack.

The message packages have the fields that the shipped descriptions name and hardly any other.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import sys
from abc import abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import message_packages
import numpy as np

from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lie import so3

PX4 = 'uint64 timestamp\nuint64 timestamp_sample\n'
PACKAGES = {
    'px4_msgs': {
        'VehicleAttitude': f'{PX4}float32[4] q\n',
        'VehicleAngularVelocity': f'{PX4}float32[3] xyz\n',
        'VehicleTorqueSetpoint': f'{PX4}float32[3] xyz\n',
        'OffboardControlMode': 'uint64 timestamp\nbool attitude\nbool thrust_and_torque\n'},
    'bsk_msgs': {
        'SCStatesMsgPayload': 'builtin_interfaces/Time stamp\nfloat64[3] sigma_bn\n'
                              'float64[3] omega_bn_b\n',
        'CmdTorqueBodyMsgPayload': 'builtin_interfaces/Time stamp\n'
                                   'float64[3] torquerequestbody\n'},
    'ff_msgs': {
        'EkfState': 'std_msgs/Header header\ngeometry_msgs/Pose pose\n'
                    'geometry_msgs/Vector3 omega\n',
        'FamCommand': 'std_msgs/Header header\ngeometry_msgs/Wrench wrench\n'},
}
USED = {'px4_msgs': (), 'bsk_msgs': ('builtin_interfaces',),
        'ff_msgs': ('std_msgs', 'geometry_msgs', 'builtin_interfaces')}
STEP_S, INERTIA = 0.5, np.diag([1.0, 0.9, 0.6])
FULL_SCALE = np.array([0.5, 0.4, 0.3])


@contextmanager
def built(cache: Path) -> Iterator[Path]:
    """Give a folder with the packages, built there unless an earlier test has.

    They can be imported meanwhile, and not afterwards: other tests want them not installed.
    """
    builder = Path(message_packages.__file__).read_text(encoding='utf-8')
    key = hashlib.sha256(json.dumps([PACKAGES, sys.version, builder]).encode()).hexdigest()[:16]
    folder = cache / key
    if not folder.exists():
        unfinished = cache / f'{key}.unfinished'
        shutil.rmtree(unfinished, ignore_errors=True)
        for package, messages in PACKAGES.items():
            message_packages.build(unfinished, package, messages, *USED[package])
        unfinished.rename(folder)
    sys.path.insert(0, str(folder))
    try:
        yield folder
    finally:
        sys.path.remove(str(folder))
        for name in [name for name in sys.modules if name.partition('.')[0] in PACKAGES]:
            del sys.modules[name]


class Plant:
    """A rigid body in the axes W and M of its stack, stepped by each torque that it hears."""

    #: R_NW and R_BM: what the axes of the stack are in those of the controller.
    R_NW = R_BM = np.eye(3)

    def __init__(self, node: Any, namespace: str) -> None:
        """Start at rest, 180 degrees from the identity of the controller."""
        self._node, self._namespace = node, namespace
        self.R_WM = self.R_NW.T @ np.diag([-1.0, -1.0, 1.0]) @ self.R_BM
        self.omega_M, self.steps, self.quiet = np.zeros(3), 0, 0
        self.open()

    @property
    def error_rad(self) -> float:
        """The angle that is left, from where the controller is to go."""
        return float(so3.angle(self.R_NW @ self.R_WM @ self.R_BM.T))

    @property
    def time_us(self) -> int:
        """Time of the plant, from its boot on [us]."""
        return round(1e6 * STEP_S * (self.steps + 1))

    @property
    def settled(self) -> bool:
        return self.error_rad < 1e-3 and float(np.abs(self.omega_M).max()) < 1e-3

    def publisher(self, kind: type, topic: str) -> Any:
        return self._node.create_publisher(kind, self._topic(topic), 10)

    def listen(self, kind: type, topic: str, take: Any) -> None:
        self._node.create_subscription(kind, self._topic(topic), take, 10)

    def _topic(self, topic: str) -> str:
        return topic if topic.startswith('/') else f'{self._namespace}/{topic}'

    def advance(self, torque_M: Any) -> None:
        """Take a step of the controller under a torque in body axes of the stack [N m]."""
        self.R_WM, self.omega_M = lgvi_step(
            self.R_WM, self.omega_M, np.array(torque_M, dtype=float), inertia_kg_m2=INERTIA,
            step_s=STEP_S, forcing='symmetric')
        self.steps, self.quiet = self.steps + 1, 0
        self.say()

    def tend(self) -> None:
        """Say the state again when no answer has come for a while."""
        self.quiet += 1
        if not self.settled and self.quiet % 25 == 0:
            self.say()

    @abstractmethod
    def open(self) -> None:
        """Make publishers and subscriptions."""

    @abstractmethod
    def say(self) -> None:
        """Publish the state."""


class Px4(Plant):
    """North, east, down; forward, right, down; w, x, y, z; torque as a part of the full scale."""

    R_NW = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    R_BM = np.diag([1.0, -1.0, -1.0])

    def open(self) -> None:
        from px4_msgs import msg
        self._attitude = self.publisher(msg.VehicleAttitude, '/fmu/out/vehicle_attitude')
        self._rate = self.publisher(
            msg.VehicleAngularVelocity, '/fmu/out/vehicle_angular_velocity')
        self.heartbeats: list[Any] = []
        self.listen(msg.OffboardControlMode, '/fmu/in/offboard_control_mode',
                    self.heartbeats.append)
        self.listen(msg.VehicleTorqueSetpoint, '/fmu/in/vehicle_torque_setpoint',
                    lambda message: self.advance(FULL_SCALE * message.xyz))

    def say(self) -> None:
        from px4_msgs import msg
        stamps = {'timestamp': self.time_us + 100, 'timestamp_sample': self.time_us}
        q_wxyz = -so3.quaternion_from_rotation(self.R_WM)  # -q is the same attitude
        self._attitude.publish(msg.VehicleAttitude(q=q_wxyz.astype(np.float32), **stamps))
        self._rate.publish(msg.VehicleAngularVelocity(
            xyz=self.omega_M.astype(np.float32), **stamps))


class Basilisk(Plant):
    """Modified Rodrigues parameters sigma_BN, the shadow set included."""

    def open(self) -> None:
        from bsk_msgs import msg
        self._states = self.publisher(msg.SCStatesMsgPayload, 'bsk/out/sc_states')
        self.listen(msg.CmdTorqueBodyMsgPayload, 'bsk/in/cmd_torque',
                    lambda message: self.advance(message.torquerequestbody))

    def say(self) -> None:
        from bsk_msgs import msg
        vector = so3.log(self.R_WM)
        angle = np.linalg.norm(vector)
        shadow = 2.0 * np.pi if self.steps % 2 else 0.0
        sigma = np.tan((angle - shadow) / 4.0) * vector / angle
        message = msg.SCStatesMsgPayload(sigma_bn=sigma, omega_bn_b=self.omega_M)
        message.stamp.sec, rest_us = divmod(self.time_us, 1_000_000)
        message.stamp.nanosec = 1000 * rest_us
        self._states.publish(message)


class SpaceStationOs(Plant):
    """No headers; the setpoint is half a turn about x, from the identity."""

    R_NW = np.diag([1.0, -1.0, -1.0])  # so that the identity of the error is the setpoint

    def open(self) -> None:
        from geometry_msgs.msg import Quaternion, Vector3
        self.R_WM = np.eye(3)
        self._setpoint = self.publisher(Quaternion, '/gnc/pose_ref')
        self._attitude = self.publisher(Quaternion, '/gnc/pose_est')
        self._rate = self.publisher(Vector3, '/gnc/angvel_est')
        self.listen(Vector3, '/gnc/torque_cmg_cmd',
                    lambda message: self.advance((message.x, message.y, message.z)))

    def say(self) -> None:
        from geometry_msgs.msg import Quaternion, Vector3
        w, x, y, z = so3.quaternion_from_rotation(self.R_WM).tolist()
        self._setpoint.publish(Quaternion(x=1.0, y=0.0, z=0.0, w=0.0))
        self._attitude.publish(Quaternion(x=x, y=y, z=z, w=w))
        x, y, z = self.omega_M.tolist()
        self._rate.publish(Vector3(x=x, y=y, z=z))


class Astrobee(Plant):
    """Pose and rate in one message with a header, a wrench back."""

    def open(self) -> None:
        from ff_msgs import msg
        self._states = self.publisher(msg.EkfState, 'gnc/ekf')
        self.listen(msg.FamCommand, 'gnc/ctl/command', self._on_command)

    def _on_command(self, message: Any) -> None:
        torque = message.wrench.torque
        assert message.header.frame_id == 'base_link'
        self.advance((torque.x, torque.y, torque.z))

    def say(self) -> None:
        from ff_msgs import msg
        message = msg.EkfState()
        message.header.stamp.sec, rest_us = divmod(self.time_us, 1_000_000)
        message.header.stamp.nanosec = 1000 * rest_us
        q = message.pose.orientation
        q.w, q.x, q.y, q.z = so3.quaternion_from_rotation(self.R_WM).tolist()
        message.omega.x, message.omega.y, message.omega.z = self.omega_M.tolist()
        self._states.publish(message)


PLANTS: dict[str, type[Plant]] = {
    'px4': Px4, 'basilisk': Basilisk, 'space_station_os': SpaceStationOs, 'astrobee': Astrobee}
