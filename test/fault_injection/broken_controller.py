# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A controller that does well until a state is not finite, and then fails as it is told to.

Not a controller for anything: it turns the body about one axis. ``python broken_controller.py
good|nan|over|dies|silent|twice|unseen|mute --ros-args ...``
"""

from __future__ import annotations

import math
import sys
from contextlib import suppress

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

TORQUE_N_M = 0.3


class BrokenController(Node):
    """Publishes a torque at every tick, and says so."""

    def __init__(self, way: str) -> None:
        super().__init__('attitude_controller')
        self._way = way
        self._ticks = self._refused = 0
        self._hurt = False
        self._torque = self.create_publisher(WrenchStamped, 'torque_command', 10)
        self._words = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.create_subscription(Odometry, 'odometry', self._on_state, 10)
        self.create_timer(0.02, self._on_tick)

    def _on_state(self, message: Odometry) -> None:
        q, rate = message.pose.pose.orientation, message.twist.twist.angular
        self._hurt = not all(map(math.isfinite, (q.x, q.y, q.z, q.w, rate.x, rate.y, rate.z)))
        self._refused += self._hurt
        if self._hurt and self._way == 'dies':
            raise ArithmeticError('a state that is not finite')

    def _on_tick(self) -> None:
        if self._way == 'mute':
            return
        if not (self._hurt and self._way == 'silent'):
            self._ticks += 1
            for _ in range(2 if self._hurt and self._way == 'twice' else 1):
                self._torque.publish(self._command())
        self._say()

    def _command(self) -> WrenchStamped:
        message = WrenchStamped()
        message.header.frame_id = 'base_link'
        message.header.stamp = self.get_clock().now().to_msg()
        broken = {'nan': math.nan, 'over': 50.0}.get(self._way, TORQUE_N_M)
        message.wrench.torque.x = broken if self._hurt else TORQUE_N_M
        return message

    def _say(self) -> None:
        seen = self._hurt and self._way != 'unseen'
        values = {'mode': 'HOLD' if seen else 'NOMINAL', 'ticks': self._ticks}
        if self._way != 'unseen':
            values['refused.odometry.non_finite'] = self._refused
        self._words.publish(DiagnosticArray(status=[DiagnosticStatus(
            name='attitude_controller',
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()])]))


if __name__ == '__main__':
    rclpy.init(args=sys.argv[2:])
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(BrokenController(sys.argv[1]))
