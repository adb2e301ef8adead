# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A controller over DDS whose time and states come from the test."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from harness import torque_of
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from watching import values_of

if TYPE_CHECKING:
    from harness import Rig

STEP_NS = 500_000_000
#: Looks at the commands before time goes on without one.
WAITS = 50
TILTED = (math.sin(0.3), 0.0, 0.0, math.cos(0.3))
Edit = Callable[[Odometry], None]


def odometry(at_ns: int, quaternion_xyzw: tuple[float, ...] = TILTED) -> Odometry:
    """Return a valid state: tilted by 0.6 rad, at rest."""
    message = Odometry(child_frame_id='base_link')
    message.header.frame_id = 'inertial'
    message.header.stamp = Time(sec=at_ns // 10**9, nanosec=at_ns % 10**9)
    q = message.pose.pose.orientation
    q.x, q.y, q.z, q.w = quaternion_xyzw
    return message


class Bench:
    """A controller whose time and states come from the test."""

    def __init__(self, rig: Rig, **parameters: Any) -> None:
        self.rig = rig
        self.torques = rig.watch(WrenchStamped, 'torque_command')
        self.diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
        self.states = rig.node.create_publisher(Odometry, 'odometry', 10)
        self.clock = rig.node.create_publisher(Clock, '/clock', 10)
        self.now_ns = 10**9
        self._commands, self._moves, self._waits = 0, 0, 0
        self.process = rig.start('controller', parameters={'autostart': False, **parameters})
        rig.activate('/attitude_controller')
        rig.until(lambda: self.states.get_subscription_count() > 0, 'the controller')

    def tick(self, edit: Edit | None = None) -> None:
        """Move the clock by a fifth of a step; with ``edit``, publish a state made by it.

        When a step has gone without a command, time waits for the controller, for a while.
        """
        if len(self.torques) != self._commands:
            self._commands, self._moves = len(self.torques), 0
        if self._moves >= 5 and self._waits < WAITS:
            self._waits += 1
            self._show_time()
            return
        self._moves, self._waits = self._moves + 1, 0
        self.now_ns += STEP_NS // 5
        if edit is not None:
            state = odometry(self.now_ns)
            edit(state)
            self.states.publish(state)
        self._show_time()

    def _show_time(self) -> None:
        """Publish the time, again where it may have been lost."""
        self.clock.publish(Clock(clock=Time(
            sec=self.now_ns // 10**9, nanosec=self.now_ns % 10**9)))

    def value(self, key: str) -> str:
        """Return the latest value of the controller's diagnostics."""
        return values_of(self.diagnostics, 'attitude_controller').get(key, '')

    def pulls(self, least_n_m: float = 0.0) -> bool:
        """Whether the last torque is larger than this."""
        return bool(self.torques) and bool(self.norms()[-1] > least_n_m)

    def said(self, key: str) -> list[str]:
        """Return the values of the controller's diagnostics, in their order."""
        return [values_of([array], 'attitude_controller').get(key, '')
                for array in self.diagnostics]

    def until(self, condition: Callable[[], bool], what: str, edit: Edit | None = None) -> None:
        """Let time go until a condition holds."""
        self.rig.until(condition, what, meanwhile=lambda: self.tick(edit))

    def norms(self) -> np.ndarray:
        """Return the size of every torque so far."""
        return np.array([np.linalg.norm(torque_of(message)) for message in self.torques])


def valid(_state: Odometry) -> None:
    """Leave the state as it is."""
