# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The node lgvi_simulator: messages, time and timers around `PlantLoop`."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rosgraph_msgs.msg import Clock

from manifold_mpc_ros.config.control_law import SimulatorConfig
from manifold_mpc_ros.config.parameter import Value
from manifold_mpc_ros.control.input_gate import NANOSECONDS, Reason, Refusal, StateSample
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.nodes import messages
from manifold_mpc_ros.nodes.described_inputs import DescribedTorque
from manifold_mpc_ros.nodes.managed_node import INPUT_QOS, ManagedNode, Status
from manifold_mpc_ros.nodes.publisher_watch import PublisherWatch
from manifold_mpc_ros.nodes.simulator.clock_watch import TOPIC, ClockWatch
from manifold_mpc_ros.nodes.simulator.device_link import DeviceLink
from manifold_mpc_ros.nodes.state_output import StateOutput
from manifold_mpc_ros.sim.pacing import Ask, FreeRun, Lockstep, Patience
from manifold_mpc_ros.sim.plant_loop import PlantLoop

#: Stamp of the first state where time is simulated; zero would mean "no time yet" in ROS.
SIMULATED_EPOCH_NS = NANOSECONDS
#: Shortest period of the free-running timer, and the period of looking in lockstep [s].
SHORTEST_TIMER_S = 0.002
LOCKSTEP_TIMER_S = 0.02
#: How often the publishers of the clock are looked at [s].
CLOCK_LOOK_S = 0.2
#: A clock that is followed and goes ahead by more at once starts the simulation again [s].
LONGEST_LEAP_S = 60.0
#: A torque that answers a state of so many command lives ago has been on its way for too long.
STALE_LIVES = 4


class LgviSimulatorNode(ManagedNode):
    """Torques in, states out.

    Time runs freely, or in lockstep: one state per control period, held until its answer comes.
    Time that runs freely is its own with ``publish_clock`` (real time times a factor), else that
    of the node's clock: ``/clock`` with ``use_sim_time``, the system clock without.
    """

    def build(self, values: Mapping[str, Value]) -> None:
        """Check the configuration and make the interfaces."""
        config = SimulatorConfig.from_parameters(values)
        self._config = config
        self._states = StateOutput(self, config)
        self._commands = DescribedTorque(config.command_source, config.body_frame_id,
                                         config.full_scale_torque_n_m, 'command_source')
        self._clock_publisher = self.advertise(Clock, TOPIC) if config.publish_clock else None
        self._own_time = config.publish_clock or config.lockstep
        wanted = bool(self.get_parameter('use_sim_time').value)
        self._follows = wanted and not self._own_time
        self._clock_watch = ClockWatch(self, ignored=not (wanted or self._own_time))
        if wanted and config.lockstep:
            self.get_logger().info(
                'use_sim_time is not used: in lockstep time goes by answers, not by a clock')
        self._torque = self.listen(
            self._commands.kind, self._commands.topic, self._on_torque, INPUT_QOS)
        self._torque_publishers = PublisherWatch()
        self._devices = DeviceLink(self, config, lambda: self._loop)

    def take_down(self) -> None:
        """Remove the interfaces."""
        self.destroy_subscription(self._torque)
        self._devices.close()
        self._clock_watch.close()
        self._states.close()
        if self._clock_publisher is not None:
            self.destroy_lifecycle_publisher(self._clock_publisher)

    def start(self) -> None:
        """Put the plant into its initial state and let time begin."""
        config = self._config
        self._paused = False
        self._published: StateSample | None = None
        self._patience = Patience(config.overdue_wait_s if config.publish_clock else 0.0)
        self._exchange = Lockstep(config.lockstep_retry_s, config.lockstep_timeout_s)
        self._seen_ns = 0
        self._begin()
        if config.lockstep:
            period_s, callback = LOCKSTEP_TIMER_S, self._on_lockstep_timer
        elif self._follows:
            period_s, callback = config.step_s, self._on_followed_clock
        else:
            period_s = max(SHORTEST_TIMER_S, config.step_s / config.real_time_factor)
            callback = self._on_free_timer
            self._publish_state()
        self._torque_publishers.forget()
        self._clock_watch.forget()
        self._plant_timers = [
            self.tick_every(period_s, 'plant', callback, ros_time=self._follows),
            self.tick_every(CLOCK_LOOK_S, 'clock', self._clock_watch.look)]

    def _begin(self) -> None:
        """Put the plant into its initial state, and let its time begin."""
        config = self._config
        self._loop = PlantLoop(config, SIMULATED_EPOCH_NS if self._own_time else self._now_ns())
        self._free = FreeRun(config.step_s, config.real_time_factor, may_slip=config.publish_clock)
        self._free.start(time.monotonic())

    def _now_ns(self) -> int:
        """Return the time of the node's clock: simulated with ``use_sim_time`` [ns]."""
        return int(self.get_clock().now().nanoseconds)

    def stop(self) -> None:
        """Let time end."""
        for timer in self._plant_timers:
            self.destroy_timer(timer)

    def reset(self) -> None:
        """Put the plant back to its initial state; time goes on."""
        if self._clock_watch.conflict:
            self._clock_watch.forget()
            self._go_on()
        self._loop.reset()
        self._torque_publishers.forget()
        if self._exchange.asking:
            self._ask()

    def pause(self, *, paused: bool) -> None:
        """Stop simulated time, or let it go on."""
        if self._paused and not paused:
            self._go_on()
        self._paused = paused

    def _go_on(self) -> None:
        """Let time go on after it stood still; the time of other clocks has passed meanwhile."""
        self._free.start(time.monotonic())
        if not self._own_time:
            self._loop.skip_to(self._now_ns())

    @property
    def _still(self) -> bool:
        """Whether simulated time stands still."""
        return self._paused or bool(self._clock_watch.conflict)

    def status(self) -> Status:
        """Say how time goes and what has happened to the plant."""
        level, mode, message = self._condition()
        faults = [self._loop.latched and f'{self._loop.latched} (zero until ~/reset)',
                  self._clock_watch.conflict and (
                      f'{self._clock_watch.conflict} (time stands still until ~/reset)')]
        if any(faults):
            level, message = DiagnosticStatus.ERROR, '; '.join(filter(None, faults))
        return Status(level, message, {
            'mode': mode,
            'time_s': self._loop.elapsed_s,
            'time_slipped_s': self._free.slipped_s,
            'lockstep_repeats': self._exchange.repeats,
            'lockstep_timeouts': self._exchange.timeouts,
            'torque_latched': bool(self._loop.latched),
            **self._loop.counters(),
        })

    def _condition(self) -> tuple[bytes, str, str]:
        """Return level, mode and words for how time goes."""
        if self._still:
            return DiagnosticStatus.WARN, 'PAUSED', 'simulated time is paused'
        if self._config.lockstep and self._published is None:
            return DiagnosticStatus.WARN, 'WAIT', 'lockstep waits for a controller'
        if self._follows and not (self._clock_watch.publishers and self._seen_ns):
            return DiagnosticStatus.WARN, 'WAIT', 'use_sim_time: no time comes on /clock'
        if self._clock_watch.ignores:
            return DiagnosticStatus.WARN, 'RUN', self._clock_watch.ignores
        return DiagnosticStatus.OK, 'RUN', 'simulated time runs'

    def _on_torque(self, message: Any, info: Mapping[str, Any]) -> None:
        """Take a torque, with those of the motors where there are wheels."""
        if not self.active:
            return
        turns = self._torque_publishers.note(info.get('publication_sequence_number'))
        if turns and self._torque.get_publisher_count() > 1:
            self._loop.latch(f'two publishers of {self._commands.topic}')
        self._devices.when_commanded(info, lambda: self._take(message))

    def _take(self, message: Any) -> None:
        """Put what was commanded in force or count its refusal; in lockstep, let time go on."""
        torque = self._admitted(message)
        if isinstance(torque, Refusal):
            self.refusals.add(self._commands.topic, torque)
            return
        self._devices.command(torque)
        if self._config.lockstep and not self._still:
            self._exchange_next()

    def _admitted(self, message: Any) -> Array | Refusal:
        """Return the torque of a command, or why it must not act.

        In lockstep it answers the state that waits. Else it may stand in for states that did not
        come, but not for as long as four lives of a command; zero is never too old.
        """
        torque, stamp_ns = self._commands.admit(message), self._commands.stamp_ns(message)
        if isinstance(torque, Refusal) or stamp_ns is None:
            return torque
        if self._config.lockstep:
            return torque if self._exchange.answer(stamp_ns) else Refusal(
                Reason.UNEXPECTED_ANSWER, 'the stamp is not that of the state that waits')
        age_s = (self._loop.stamp_ns - stamp_ns) / NANOSECONDS
        if age_s > STALE_LIVES * self._config.command_life_s and torque.any():
            return Refusal(Reason.STALE, f'the state it answers is {age_s:.3f} s old')
        return torque

    def _on_free_timer(self) -> None:
        """Take the plant steps that are due, publishing the states among them."""
        if self._still:
            return
        now_s = time.monotonic()
        for _ in range(self._free.due(now_s)):
            if self._patience.waits(now_s, overdue=self._loop.overdue):
                self._free.hold(now_s)
                return
            self._step()
            self._free.took(1)

    def _on_followed_clock(self) -> None:
        """Take the plant steps up to the time on ``/clock``.

        A clock that goes back, or ahead by more than a minute, starts the simulation again.
        """
        now_ns, seen_ns = self._now_ns(), self._seen_ns
        if not now_ns or self._still:
            return
        self._seen_ns = now_ns
        ahead_ns = now_ns - self._loop.stamp_ns
        if seen_ns and now_ns >= seen_ns and ahead_ns <= LONGEST_LEAP_S * NANOSECONDS:
            for _ in range(ahead_ns // self._loop.step_ns):
                self._step()
            return
        if seen_ns:
            self.get_logger().warning(
                f'/clock went from {seen_ns / NANOSECONDS:.3f} to {now_ns / NANOSECONDS:.3f} s: '
                'the simulation starts again')
        self._begin()
        self._publish_state()

    def _step(self) -> None:
        """Take one plant step; publish the state when it is due."""
        self._loop.advance(1)
        if self._loop.steps % self._config.steps_per_state == 0:
            self._publish_state()

    def _on_lockstep_timer(self) -> None:
        """Ask for the first time when both ends are there; repeat, or give up waiting."""
        if self._still:
            return
        if self._published is None:
            if self._states.readers > 0 and self._torque.get_publisher_count() > 0:
                self._ask()
        elif not self._exchange.asking:  # answered while paused
            self._exchange_next()
        else:
            ask = self._exchange.poll(time.monotonic())
            if ask is Ask.REPEAT:
                self._send(self._published)
            elif ask is Ask.GIVE_UP:
                self._loop.release()
                self._exchange_next()

    def _exchange_next(self) -> None:
        """Move on by one control period and ask again."""
        self._loop.advance(self._config.steps_per_control)
        self._ask()

    def _ask(self) -> None:
        """Publish a new state that wants an answer."""
        self._exchange.ask(self._loop.stamp_ns, time.monotonic())
        self._publish_state()

    def _publish_state(self) -> None:
        """Measure and publish, then let the clock show the time of the measurement."""
        self._published = self._loop.measure()
        self._send(self._published)
        if self._clock_publisher is not None:
            self._clock_publisher.publish(Clock(clock=messages.to_stamp(self._loop.stamp_ns)))

    def _send(self, sample: StateSample) -> None:
        """Publish a measurement in each form that somebody reads."""
        self._devices.publish(sample.stamp_ns, self._loop.measure_wheels(),
                              self._loop.field_B_t)
        self._states.send(sample)
