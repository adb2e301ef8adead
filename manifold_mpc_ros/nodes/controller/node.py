# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The node attitude_controller: messages and timers around `ControlLoop`."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping
from typing import Any

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.interfaces import ACTUATORS, load
from manifold_mpc_ros.config.parameter import Value
from manifold_mpc_ros.control.command import Command, Law
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.input_gate import (
    NANOSECONDS,
    RawState,
    Reason,
    Refusal,
    StateGate,
)
from manifold_mpc_ros.control.tick_time import LOCKSTEP, ClockTime, TickTime
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.cache import why_no_cache
from manifold_mpc_ros.nodes.command_output import CommandOutput, command_writers
from manifold_mpc_ros.nodes.controller.cone_inputs import ConeInputs
from manifold_mpc_ros.nodes.controller.device_inputs import DeviceInputs
from manifold_mpc_ros.nodes.controller.diagnostics import status_of
from manifold_mpc_ros.nodes.controller.insight import Insight
from manifold_mpc_ros.nodes.controller.law_factory import law_with, solver_for
from manifold_mpc_ros.nodes.controller.realtime import Realtime
from manifold_mpc_ros.nodes.controller.run_time_parameters import LawChanges
from manifold_mpc_ros.nodes.controller.setpoint_inputs import SetpointInputs
from manifold_mpc_ros.nodes.controller.tick_timing import AnswerTiming, TickTiming, arrival_s
from manifold_mpc_ros.nodes.managed_node import STATE_QOS, ManagedNode, Status
from manifold_mpc_ros.nodes.state_input import StateInput, state_kinds
from manifold_mpc_ros.nodes.usage import Program
from manifold_mpc_ros.terminal.design import TerminalDesign

#: Zero commands at the end of activity: one may be lost, three in a row hardly.
FINAL_ZEROS = 3
#: Longest wait for reliable readers to have them [s].
LONGEST_ACK_S = 0.2
#: Diagnostics of ticks that bring nothing new are no closer than this, but in lockstep [s].
DIAGNOSTICS_GAP_S = 0.1


class AttitudeControllerNode(ManagedNode):
    """States and setpoints in, one torque per tick out.

    A tick is due every ``mpc.step_s`` of the node's clock; in lockstep it is due when a new state
    comes, and a state that is repeated gets the same answer again. Parameters that may change
    make another law in the background, which takes over between two ticks.
    """

    def __init__(self, program: Program, *, complete: bool) -> None:
        """Declare parameters and the interfaces that exist in every lifecycle state."""
        super().__init__(program, complete=complete)
        self._changes = LawChanges(self._table, self._build_law)

    def build(self, values: Mapping[str, Value]) -> None:
        """Design and build the solver, then the interfaces."""
        self._config = config = ControllerConfig.from_parameters(values)
        self._changes.begin(dict(values))
        self._simulated_time = False
        state_kinds(config.state_source)
        writers = command_writers(config)
        self._realtime = Realtime(config.scheduler_priority, lock_memory=config.lock_memory)
        if no_cache := why_no_cache():
            self.get_logger().warning(no_cache)
        self._law = self._build_law(config)
        self.backend = self._law.backend
        self._loop = ControlLoop(
            self._law, StateGate(
                config.inertial_frame_id, config.body_frame_id, step_s=config.mpc.step_s,
                timeout_s=config.state_timeout_s, timed=not config.lockstep),
            initial_setpoint=config.initial_setpoint,
            make_actuator=load(ACTUATORS[config.actuator]).from_config)
        self._command: Command | None = None
        self._ticks = 0
        self._kinds: Counter[str] = Counter()
        self._said: tuple[tuple[object, ...], float] = ((), 0.0)
        self._output = CommandOutput(self, writers)
        self._devices = DeviceInputs(self, config)
        self._insight = Insight(self)
        self._states = StateInput(
            self, config.state_source, STATE_QOS, self._on_state, self._on_duplicate)
        self._cones = ConeInputs(self, config, self._loop)
        self._setpoints = SetpointInputs(self, config, self._loop, self._stamps_ns)

    def take_down(self) -> None:
        """Remove the interfaces; the solver goes with the loop."""
        self._loop.close()
        self._states.close()
        self._cones.close()
        self._setpoints.close()
        self._output.close()
        self._devices.close()
        self._insight.close()

    def start(self) -> None:
        """Wait for the first state, ticking already unless in lockstep."""
        self.reset()
        if self._law.monitor is not None:
            self._law.monitor.clear()
        self._loop.logic.start()
        self._realtime.enter()
        if self._realtime.refusal:
            self.get_logger().warning(self._realtime.refusal)
        timing = AnswerTiming if self._config.lockstep else TickTiming
        self._timing = timing(self._config.mpc.step_s)
        self._simulated_time = bool(self.get_parameter('use_sim_time').value)
        self._timer = None
        if not self._config.lockstep:
            self._timer = self.tick_every(
                self._config.mpc.step_s, 'tick', self._on_tick, ros_time=self._simulated_time)

    def stop(self) -> None:
        """End the ticks; the last commands are zero."""
        if self._timer is not None:
            self.destroy_timer(self._timer)
        command = self._loop.stopped(
            self._now_ns() if self._command is None else self._command.stamp_ns)
        for _ in range(FINAL_ZEROS):
            self._output.send(command.stamp_ns, command.actuation)
        self._command = command
        self.say(self.status())
        self._output.wait_until_read(LONGEST_ACK_S)

    def reset(self) -> None:
        """Forget states, setpoint, plan, warm start and fault."""
        self._loop.reset()
        self._states.forget()
        self._devices.forget()
        self._command = None
        self._last_ns = 0

    def pause(self, *, paused: bool) -> None:
        """Command zero torque, or the optimiser's again."""
        self._loop.logic.paused = paused

    def status(self) -> Status:
        """Say the mode, where the torque comes from, how the solver and the ticks do."""
        status = status_of(self._command, self._loop, self._waiting())
        self._cones.add_to(status)
        self._insight.add_to(status)
        status.values.update(
            ticks=self._ticks, setpoints=self._setpoints.count, backend=self._law.backend,
            **self._changes.values(),
            scheduling=self._realtime.scheduling, memory=self._realtime.memory)
        self._devices.add_to(status, self._loop)
        status.values.update(self._timing.values() | dict(self._loop.output.actuator.usage))
        latest = self._loop.sample
        if latest is not None and not self._config.lockstep:
            status.values['state_age_s'] = max(0, self._now_ns() - latest.stamp_ns) / NANOSECONDS
            kinds = self._kinds
            status.values.update(infeasible_ticks=kinds['infeasible'] + kinds['failed'],
                                 hold_ticks=kinds['HOLD'], fallback_ticks=kinds['FALLBACK'],
                                 coast_ticks=kinds['COAST'])
        return status

    def make_solver(
        self, config: ControllerConfig, terminal: TerminalDesign | None,
    ) -> AttitudeMpc:
        """Design the terminal set where it is not known yet, and build or load the solver."""
        return solver_for(config, terminal)

    def _build_law(self, config: ControllerConfig, terminal: TerminalDesign | None = None) -> Law:
        """Return what a configuration works with."""
        solver = self.make_solver(config, terminal)
        return law_with(solver, config, self._realtime.enter_solver_thread)

    def _take_change(self) -> None:
        """Work with the law of new parameters, if it is ready."""
        news = self._changes.take()
        if isinstance(news, ManifoldMpcError):
            self.get_logger().error(f'the old parameters stay: {news}')
        elif news is not None:
            self._config, law = news
            self._cones.config = self._config
            if law.monitor is not None and self._law.monitor is not None:
                law.monitor.counters = self._law.monitor.counters
            self._loop.exchange(law)
            self._law = law
            self._description.publish(self._table.resolve(), law.backend)
            self.get_logger().info('new parameters are in force')

    def _waiting(self) -> str:
        """Say what the first command waits for."""
        if self._simulated_time and self._now_ns() == 0:
            return 'waiting for time on /clock'
        latest = self.refusals.latest
        refused = f' (refused: {latest})' if latest else ''
        return f'waiting for the first valid state on {self._config.state_name}{refused}'

    def _now_ns(self) -> int:
        """Return the time of the node's clock, simulated or not."""
        return int(self.get_clock().now().nanoseconds)

    def _stamps_ns(self) -> int | None:
        """Return the clock of the stamps; in lockstep it is that of the latest state."""
        latest = self._loop.sample
        if self._config.lockstep:
            return None if latest is None else latest.stamp_ns
        return self._now_ns()

    def _on_state(self, read: RawState | Refusal, info: Mapping[str, Any]) -> None:
        """Take a state or count its refusal; in lockstep, answer."""
        if isinstance(read, Refusal):
            self.refusals.add(self._config.state_name, read)
            return
        refusal = self._loop.receive(
            read, self._now_ns(), None if self._simulated_time else time.monotonic_ns())
        if refusal is not None:
            self.refusals.add(self._config.state_name, refusal)
            if self._config.lockstep and refusal.reason is Reason.DUPLICATE:
                self._repeat(read.stamp_ns)
        elif self._config.lockstep:
            begun_s = arrival_s(info)
            self._devices.when_reported(
                read.stamp_ns, lambda: self._answer(LOCKSTEP, begun_s))

    def _on_duplicate(self, topic: str) -> None:
        """Command zero until a reset: which of two publishers is right nobody knows."""
        self._loop.logic.fault(f'two publishers of {topic}')

    def _on_tick(self) -> None:
        """Publish the command that is due."""
        begun_s = time.monotonic()
        now_ns = self._now_ns()
        if now_ns < self._last_ns:
            self._loop.go_back()
        self._last_ns = now_ns
        self._timing.begin(now_ns / NANOSECONDS if self._simulated_time else begun_s)
        self._answer(ClockTime(
            now_ns, None if self._simulated_time else time.monotonic_ns()), begun_s)

    def _decided(self, at: TickTime) -> Command:
        """Return the command of a tick, zero where an error of our own came between."""
        try:
            self._take_change()
            self._devices.hand_over(self._loop)
            return self._loop.command(at)
        except Exception as error:  # noqa: BLE001  (no tick without a command)
            self.barrier.note('tick', error)
            return self._loop.failed(at, str(error))

    def _answer(self, at: TickTime, begun_s: float) -> None:
        """Publish the command of a tick at once, then what there is to say about it."""
        command = self._decided(at)
        self._output.send(command.stamp_ns, command.actuation)
        self._timing.end(time.monotonic() - begun_s)
        self._command = command
        try:
            self._command = command = self._loop.judged(command, at)
        except Exception as error:  # noqa: BLE001  (the command is out; it is said all the same)
            self.barrier.note('judging a tick', error)
        self._ticks += 1
        self._kinds[command.mode.value] += 1
        if command.solution is not None:
            self._kinds[command.solution.status.value] += 1
        decrease = command.decrease
        if decrease is not None and decrease.burst:
            self.get_logger().warning(f'tick {self._ticks}: {decrease.reason}')
        self._say_what_is_new(command)
        self._insight.publish(command, self._loop, self._config)

    def _say_what_is_new(self, command: Command) -> None:
        """Publish diagnostics in lockstep, when something has changed, and now and then."""
        decrease = command.decrease
        news = (command.mode, self._setpoints.count, self._law,
                decrease is not None and (decrease.verdict, bool(decrease.warning)))
        now_s, (said, said_s) = time.monotonic(), self._said
        if self._config.lockstep or news != said or now_s - said_s >= DIAGNOSTICS_GAP_S:
            self._said = news, now_s
            self.say(self.status())

    def _repeat(self, stamp_ns: int) -> None:
        """Publish the answer to a state that is repeated again, to the bit."""
        if self._command is not None and self._command.stamp_ns == stamp_ns:
            self._output.send(stamp_ns, self._command.actuation)
