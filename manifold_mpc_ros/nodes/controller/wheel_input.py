# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The controller's wheel_states: speeds of reaction wheels, handed to the loop at each tick."""

from __future__ import annotations

from collections.abc import Callable

from sensor_msgs.msg import JointState

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.interfaces import WHEEL_STATES
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.input_gate import to_ns
from manifold_mpc_ros.control.wheels.reports import WheelReports
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.managed_node import STATE_QOS, ManagedNode


class WheelInput:
    """Reports of the wheels, if there are any, and in lockstep the answer that waits for one.

    A state in lockstep is answered when the report of its stamp has come, in either order, so
    that every run uses the same momenta.
    """

    def __init__(self, node: ManagedNode, config: ControllerConfig) -> None:
        """Subscribe where there are wheels."""
        self._node, wheels = node, config.mpc.wheels
        self._waiting: tuple[int, Callable[[], None]] | None = None
        self._reports = None if wheels is None else WheelReports(
            wheels, to_ns(config.state_timeout_s))
        self._subscription = None if wheels is None else node.listen(
            JointState, WHEEL_STATES[0], self._on_report, STATE_QOS)

    def close(self) -> None:
        """Subscribe no more."""
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)

    def forget(self) -> None:
        """Forget the reports, as at the start."""
        self._waiting = None
        if self._reports is not None:
            self._reports.forget()

    def hand_over(self, loop: ControlLoop) -> None:
        """Give the loop the momenta at its latest state."""
        if self._reports is not None and loop.sample is not None:
            loop.output.devices = self._reports.momenta(loop.sample)

    def when_reported(self, stamp_ns: int, answer: Callable[[], None]) -> None:
        """Answer a state when its report is there, at once where there are no wheels."""
        self._waiting = stamp_ns, answer
        self._answer()

    def values(self, loop: ControlLoop) -> dict[str, object]:
        """Return speed and motor torque of each wheel by their keys on /diagnostics."""
        if self._reports is None:
            return {}
        named = zip(self._reports.wheels.names, self._reports.speed_rad_s,
                    loop.output.latest.device)
        return {f'{name}_{what}': value for name, speed, torque in named
                for what, value in (('speed_rad_s', float(speed)), ('torque_n_m', float(torque)))}

    def _on_report(self, message: JointState) -> None:
        """Take a report while active."""
        if self._node.active and self._reports is not None:
            self._reports.receive(messages.nanoseconds(message.header.stamp), message.name,
                                  message.velocity)
            self._answer()

    def _answer(self) -> None:
        """Answer the state that waits, if it is due."""
        if self._waiting is not None and (
                self._reports is None or self._reports.stamp_ns == self._waiting[0]):
            answer, self._waiting = self._waiting[1], None
            answer()
