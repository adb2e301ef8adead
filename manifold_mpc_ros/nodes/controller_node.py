# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The node attitude_controller: messages and timers around `ControlLoop`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import QuaternionStamped, Vector3Stamped, WrenchStamped
from nav_msgs.msg import Odometry, Path
from rclpy.duration import Duration
from sensor_msgs.msg import Imu

from manifold_mpc_ros.config_checks import FloatArray
from manifold_mpc_ros.config_controller import ControllerConfig
from manifold_mpc_ros.config_parameters import Value
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.monitor import monitor_for
from manifold_mpc_ros.mpc.promise import PromiseRecord, Verdict
from manifold_mpc_ros.mpc.target import attitude_towards
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.gate import (
    NANOSECONDS,
    RawState,
    Reason,
    Refusal,
    StateGate,
    admit_direction,
    admit_setpoint,
)
from manifold_mpc_ros.nodes.managed_node import (
    INPUT_QOS,
    OUTPUT_QOS,
    STATE_QOS,
    ManagedNode,
    Status,
)
from manifold_mpc_ros.nodes.tick import Command, ControlLoop, Mode

#: Zero commands at the end of activity: one may be lost, three in a row hardly.
FINAL_ZEROS = 3
#: Longest wait for reliable readers to have them [s].
LONGEST_ACK_S = 0.2

_LEVELS = {
    Mode.NOMINAL: DiagnosticStatus.OK,
    Mode.WAIT: DiagnosticStatus.WARN,
    Mode.PAUSED: DiagnosticStatus.WARN,
    Mode.FALLBACK: DiagnosticStatus.WARN,
    Mode.COAST: DiagnosticStatus.ERROR,
}


class AttitudeControllerNode(ManagedNode):
    """States and setpoints in, one torque per tick out.

    A tick is due every ``mpc.step_s`` of the node's clock; in lockstep it is due when a new state
    comes, and a state that is repeated gets the same answer again.
    """

    def build(self, values: Mapping[str, Value]) -> None:
        """Design and build the solver, then the interfaces."""
        config = ControllerConfig.from_parameters(values)
        self._config = config
        mpc = AttitudeMpc(config.mpc, backend=config.backend)
        self._monitor = monitor_for(
            config.mpc, mpc.terminal.P, decrease_tolerance=config.decrease_tolerance,
            attitude_noise_rad=config.attitude_noise_rad)
        self._loop = ControlLoop(
            mpc, config.mpc, timeout_s=config.state_timeout_s,
            initial_setpoint=config.initial_setpoint, monitor=self._monitor)
        self._gate = StateGate(
            config.inertial_frame_id, config.body_frame_id, step_s=config.mpc.step_s,
            timeout_s=config.state_timeout_s, timed=not config.lockstep)
        self._command: Command | None = None
        self._ticks = self._setpoints = 0
        self._backend = mpc.backend
        self._torque = self.create_lifecycle_publisher(
            WrenchStamped, 'torque_command', OUTPUT_QOS)
        self._prediction = self.create_lifecycle_publisher(Path, '~/prediction', OUTPUT_QOS)
        on_state = {'odometry': (Odometry, self._on_odometry), 'imu': (Imu, self._on_imu)}
        kind, callback = on_state[config.state_source]
        self._inputs = [
            self.create_subscription(kind, config.state_source, callback, STATE_QOS),
            self.create_subscription(
                QuaternionStamped, 'attitude_setpoint', self._on_setpoint, INPUT_QOS),
        ]
        pointing = config.mpc.target == 'pointing'
        self._drawn_axis_B = config.mpc.pointing_axis_B if pointing else np.eye(3)[0]
        if pointing:
            self._inputs.append(self.create_subscription(
                Vector3Stamped, 'direction_setpoint', self._on_direction, INPUT_QOS))

    def take_down(self) -> None:
        """Remove the interfaces; the solver goes with the loop."""
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        for publisher in (self._torque, self._prediction):
            self.destroy_lifecycle_publisher(publisher)

    def start(self) -> None:
        """Wait for the first state, ticking already unless in lockstep."""
        self.reset()
        self._monitor.clear()
        self._loop.paused = False
        self._timer = None
        if not self._config.lockstep:
            self._timer = self.create_timer(self._config.mpc.step_s, self._on_tick)

    def stop(self) -> None:
        """End the ticks; the last commands are zero."""
        if self._timer is not None:
            self.destroy_timer(self._timer)
        stamp_ns = self._now_ns() if self._command is None else self._command.stamp_ns
        zero = messages.to_torque(stamp_ns, np.zeros(3), self._config.body_frame_id)
        for _ in range(FINAL_ZEROS):
            self._torque.publish(zero)
        self._torque.wait_for_all_acked(Duration(seconds=LONGEST_ACK_S))

    def reset(self) -> None:
        """Forget states, setpoint and warm start."""
        self._loop.reset()
        self._gate.forget()
        self._command = None

    def pause(self, *, paused: bool) -> None:
        """Command zero torque, or the optimiser's again."""
        self._loop.paused = paused

    def status(self) -> Status:
        """Say the mode, where the torque comes from and how the solver does."""
        command = self._command
        totals = {'ticks': self._ticks, 'setpoints': self._setpoints, 'backend': self._backend}
        if command is None:
            return Status(DiagnosticStatus.WARN, self._waiting(), {
                'mode': Mode.WAIT.value, 'command_source': 'zero', **totals})
        waiting = command.mode is Mode.WAIT
        status = Status(
            _LEVELS[command.mode], self._waiting() if waiting else command.reason, {
                'mode': command.mode.value,
                'command_source': command.source,
                **totals,
                'setpoint': 'commanded' if self._loop.commanded else 'initial',
            })
        latest_ns = self._loop.state_stamp_ns
        if latest_ns is not None and not self._config.lockstep:
            status.values['state_age_s'] = max(0, self._now_ns() - latest_ns) / NANOSECONDS
        solution = command.solution
        if solution is not None:
            status.values.update(
                solver_status=solution.status.value, iterations=solution.iterations,
                solve_time_us=solution.solve_time_s * 1e6, cost=float(solution.cost))
        if command.promise is not None:
            _add_promise(status, command.promise, nominal=command.mode is Mode.NOMINAL)
        return status

    def _waiting(self) -> str:
        """Say what the first command waits for."""
        if self.get_parameter('use_sim_time').value and self._now_ns() == 0:
            return 'waiting for time on /clock'
        latest = self.refusals.latest
        refused = f' (refused: {latest})' if latest else ''
        return f'waiting for the first valid state on {self._config.state_source}{refused}'

    def _now_ns(self) -> int:
        """Return the time of the node's clock, simulated or not."""
        return int(self.get_clock().now().nanoseconds)

    def _on_odometry(self, message: Odometry) -> None:
        """Take a state from odometry."""
        self._on_state(messages.from_odometry(message))

    def _on_imu(self, message: Imu) -> None:
        """Take a state from an IMU."""
        self._on_state(messages.from_imu(message))

    def _on_state(self, raw: RawState) -> None:
        """Admit a state or count its refusal; in lockstep, answer."""
        if not self.active:
            return
        admitted = self._gate.admit(raw, self._now_ns())
        if isinstance(admitted, Refusal):
            self.refusals.add(self._config.state_source, admitted)
            if self._config.lockstep and admitted.reason is Reason.DUPLICATE:
                self._publish_again(raw.stamp_ns)
            return
        self._loop.admit(admitted, restarted=self._gate.restarted)
        if self._config.lockstep:
            self._publish(self._loop.tick(None))

    def _on_setpoint(self, message: QuaternionStamped) -> None:
        """Aim at a commanded attitude or count its refusal."""
        self._aim('attitude_setpoint', admit_setpoint(
            message.header.frame_id, messages.quaternion_values(message.quaternion),
            self._config.inertial_frame_id))

    def _on_direction(self, message: Vector3Stamped) -> None:
        """Point the axis along a commanded direction or count its refusal."""
        admitted = admit_direction(
            message.header.frame_id, messages.vector_values(message.vector),
            self._config.inertial_frame_id)
        self._aim('direction_setpoint', admitted if isinstance(admitted, Refusal)
                  else attitude_towards(self._config.mpc, admitted))

    def _aim(self, topic: str, admitted: FloatArray | Refusal) -> None:
        """Take a commanded attitude R_ND while active, or count why it is none."""
        if not self.active:
            return
        if isinstance(admitted, Refusal):
            self.refusals.add(topic, admitted)
        else:
            self._loop.aim(admitted)
            self._setpoints += 1

    def _on_tick(self) -> None:
        """Publish the command that is due."""
        self._publish(self._loop.tick(self._now_ns()))

    def _publish(self, command: Command) -> None:
        """Publish a command, and the prediction behind it when somebody looks."""
        self._torque.publish(messages.to_torque(
            command.stamp_ns, command.torque_B_n_m, self._config.body_frame_id))
        self._command = command
        self._ticks += 1
        if command.promise is not None and command.promise.burst:
            self.get_logger().warning(f'tick {self._ticks}: {command.promise.reason}')
        self.publish_diagnostics()
        if command.solution is not None and self._prediction.get_subscription_count() > 0:
            self._prediction.publish(messages.to_path(
                command.stamp_ns, self._config.mpc.step_s, command.solution.R_NB,
                self._config.inertial_frame_id, self._drawn_axis_B))

    def _publish_again(self, stamp_ns: int) -> None:
        """Repeat the answer to a state that is repeated, to the bit."""
        if self._command is not None and self._command.stamp_ns == stamp_ns:
            self._torque.publish(messages.to_torque(
                stamp_ns, self._command.torque_B_n_m, self._config.body_frame_id))


def _add_promise(status: Status, record: PromiseRecord, *, nominal: bool) -> None:
    """Add to a status what became of the promise of the last tick, and the warning if due."""
    words = {None: 'unknown', True: 'true', False: 'false'}
    why_none = f' ({record.reason})' if record.verdict is Verdict.NONE else ''
    status.values.update(
        value_function=record.value, promised_value=record.promised,
        decrease_excess=record.excess, relative_excess=record.relative_excess,
        promise=record.verdict.value + why_none,
        in_domain_of_attraction=words[record.in_domain],
        in_terminal_set=words[record.in_terminal_set],
        promises_made=record.counters.made, promises_checked=record.counters.checked,
        promises_broken=record.counters.broken,
        largest_relative_excess=record.counters.largest_excess,
        ticks_outside_domain=record.counters.outside_domain)
    if record.in_domain is False:
        status.level = max(status.level, DiagnosticStatus.WARN)
        status.message += ' (no plan keeps the rate limits and reaches the terminal set)'
    if record.warning:
        status.level = max(status.level, DiagnosticStatus.WARN)
        status.message = record.warning if nominal else f'{status.message}; {record.warning}'
