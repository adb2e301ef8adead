# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What devices and their sensors report to the controller: wheel_states and magnetic_field."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import JointState, MagneticField

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.interfaces import MAGNETIC_FIELD, WHEEL_STATES
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.devices.magnetorquers import FieldReport
from manifold_mpc_ros.control.devices.wheel_reports import WheelReports
from manifold_mpc_ros.control.input_gate import Refusal, admit_in_body, to_ns
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.managed_node import STATE_QOS, ManagedNode, Status


class DeviceInputs:
    """Reports of wheels and of the field, where they are used; in lockstep, the answer they make.

    A state in lockstep is answered when the reports of its stamp have come, in any order, so
    that every run uses the same momenta and the same field.
    """

    def __init__(self, node: ManagedNode, config: ControllerConfig) -> None:
        """Subscribe to what is used."""
        self._node, self._frame, wheels = node, config.body_frame_id, config.mpc.wheels
        self._reports = None if wheels is None else WheelReports(
            wheels, to_ns(config.state_timeout_s))
        self._magnetic = config.magnetorquers is not None
        self._subscriptions = [
            node.listen(kind, topic, take, STATE_QOS) for kind, topic, take, used in (
                (JointState, WHEEL_STATES[0], self._on_wheels, self._reports is not None),
                (MagneticField, MAGNETIC_FIELD[0], self._on_field, self._magnetic)) if used]
        self.forget()

    def close(self) -> None:
        """Subscribe no more."""
        for each in self._subscriptions:
            self._node.destroy_subscription(each)

    def forget(self) -> None:
        """Forget the reports, as at the start."""
        self._waiting: tuple[int, Callable[[], None]] | None = None
        self._field: FieldReport | None = None
        if self._reports is not None:
            self._reports.forget()

    def hand_over(self, loop: ControlLoop) -> None:
        """Give the loop the momenta at its latest state, and the latest field."""
        loop.output.field = self._field
        if self._reports is not None and loop.sample is not None:
            loop.output.devices = self._reports.momenta(loop.sample)

    def when_reported(self, stamp_ns: int, answer: Callable[[], None]) -> None:
        """Answer a state when its reports are there, at once where none is used."""
        self._waiting = stamp_ns, answer
        self._answer()

    def add_to(self, status: Status, loop: ControlLoop) -> None:
        """Add speed and motor torque of each wheel, the dipole, and what is wrong with devices."""
        latest, values = loop.output.latest, status.values
        if awaited := self._awaited:
            status.message += f'; the state waits for its {" and ".join(awaited)}'
        if self._reports is not None:
            for name, speed, torque in zip(
                    self._reports.wheels.names, self._reports.speed_rad_s, latest.device):
                values[f'{name}_speed_rad_s'] = float(speed)
                values[f'{name}_torque_n_m'] = float(torque)
        wrong = [loop.output.actuator.found] if loop.output.actuator.found else []
        if loop.output.dipoles is not None:
            values.update({f'{axis}_dipole_a_m2': float(dipole)
                           for axis, dipole in zip('xyz', latest.dipole_B_a_m2)})
            wrong += [loop.output.dipoles.missing] if loop.output.dipoles.missing else []
        if wrong:
            status.level = max(status.level, DiagnosticStatus.WARN)
            status.message = '; '.join([status.message, *wrong])

    @property
    def _awaited(self) -> list[str]:
        """The topics of which the report of the state that waits has not come."""
        used: dict[str, Any] = {} if self._reports is None else {WHEEL_STATES[0]: self._reports}
        if self._magnetic:
            used[MAGNETIC_FIELD[0]] = self._field
        return [] if self._waiting is None else [
            topic for topic, report in used.items()
            if report is None or report.stamp_ns != self._waiting[0]]

    def _on_wheels(self, message: JointState) -> None:
        """Take speeds while active."""
        if self._node.active and self._reports is not None:
            self._reports.receive(messages.nanoseconds(message.header.stamp), message.name,
                                  message.velocity)
            self._answer()

    def _on_field(self, message: MagneticField) -> None:
        """Take a field while active, or count its refusal."""
        if not self._node.active:
            return
        field = admit_in_body(
            message.header.frame_id, messages.vector_values(message.magnetic_field),
            self._frame, 'field')
        if isinstance(field, Refusal):
            self._node.refusals.add(MAGNETIC_FIELD[0], field)
            return
        self._field = FieldReport(messages.nanoseconds(message.header.stamp), np.asarray(field))
        self._answer()

    def _answer(self) -> None:
        """Answer the state that waits, if it is due."""
        if self._waiting is not None and not self._awaited:
            answer, self._waiting = self._waiting[1], None
            answer()
