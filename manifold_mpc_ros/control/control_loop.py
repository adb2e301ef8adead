# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What to command at a tick: states and a time in, one finite command out; `ModeLogic` decides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.actuator import Actuation, Actuator, TorqueActuator
from manifold_mpc_ros.control.anticipation import Anticipation
from manifold_mpc_ros.control.command import Command, Law
from manifold_mpc_ros.control.fallback_law import FallbackLaw
from manifold_mpc_ros.control.held_plan import HeldPlan, Offer, facts_of
from manifold_mpc_ros.control.input_gate import (
    NANOSECONDS,
    RawState,
    Refusal,
    StateGate,
    StateSample,
    to_ns,
)
from manifold_mpc_ros.control.modes import Decision, Facts, Mode, ModeLogic, SolveOutcome
from manifold_mpc_ros.control.moving.directions import ConeDirections
from manifold_mpc_ros.control.output_gate import OutputGate
from manifold_mpc_ros.control.plan_watch import PlanWatch
from manifold_mpc_ros.control.solver_thread import SolveRequest, SolveResult
from manifold_mpc_ros.control.steady_error import SteadyError
from manifold_mpc_ros.control.target import FixedTarget, Target, goes_on
from manifold_mpc_ros.control.tick_time import TickTime
from manifold_mpc_ros.errors import StepExistenceError
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus

#: Where a torque comes from, by mode; the others command zero.
_SOURCES = {Mode.NOMINAL: 'mpc', Mode.HOLD: 'plan', Mode.FALLBACK: 'fallback'}
#: From these the torque comes back to the optimiser's gradually.
_RETURNS = frozenset({Mode.FALLBACK, Mode.COAST, Mode.FAULT})


class ControlLoop:
    """The controller between messages: latest state, setpoint, and the command of each tick.

    Arguments
    ---------
    law
        What plans, until `exchange` brings another.
    gate
        What checks the states that `receive` is given.
    initial_setpoint
        'identity', or 'hold' for the first attitude that comes.
    make_actuator
        What makes the actuator of a configuration.

    ``sample`` is the latest state, None before the first; ``directions`` those of cones that
    have come, by name. ``ahead`` knows what acts, ``observer`` how the body answers,
    ``steady_error`` the error left, the watches what does not fit; ``slews`` plans profiles.
    """

    def __init__(
        self, law: Law, gate: StateGate, *, initial_setpoint: str,
        make_actuator: Callable[[AttitudeMpcConfig], Actuator] = TorqueActuator.from_config,
    ) -> None:
        """Start without a state, at the initial setpoint."""
        self.directions = ConeDirections(law.config)
        self._make_actuator, self.gate = make_actuator, gate
        self.logic = ModeLogic(to_ns(law.config.step_s), to_ns(law.timeout_s))
        self.output, self._hold = OutputGate(make_actuator(law.config)), initial_setpoint == 'hold'
        self._plan, self.ahead = HeldPlan(to_ns(law.config.step_s)), Anticipation(law)
        self._mode, self._epoch = Mode.WAIT, 0
        self._flown: Target | None = None  # what the last plan is about: the target, or a profile
        self._take(law)
        self.reset()

    def reset(self) -> None:
        """Forget state, setpoint, plan and fault, as at the start; a pause stays."""
        self.logic.reset()
        self.gate.forget()
        self.output.use(self._make_actuator(self._law.config), self._law.actuation_delay_s)
        self.output.zero()
        self.target: Target | None = None if self._hold else FixedTarget(np.eye(3))
        self.commanded, self.jumps = False, 0
        self.sample: StateSample | None = None
        self._flush('reset')

    def exchange(self, law: Law) -> None:
        """Work with another law from the next tick on; the plan of the old one is still held."""
        self._law.solver.close()
        self.ahead.take(law)
        self._take(law)
        self.directions.configure(law.config)
        self.output.use(self._make_actuator(law.config), law.actuation_delay_s)
        self.logic.set_timeout(to_ns(law.timeout_s))
        self.gate.set_timeout(law.timeout_s)
        self._void('the controller was changed')

    def close(self) -> None:
        """Let the solver end."""
        self._law.solver.close()

    def _take(self, law: Law) -> None:
        """Plan with this law from now on."""
        self._law, self._cold = law, True
        self.observer, self.slews, self.output.dipoles = law.observer, law.slews, law.dipoles
        self.plan_watch, self.body_watch = PlanWatch(law.config), self.ahead.body
        self.steady_error = SteadyError(law.config, law.largest_steady_error_rad)
        self._fallback = FallbackLaw(law.config)
        self.logic.consistency.bounds = law.motion

    def receive(self, raw: RawState, now_ns: int, received_ns: int | None = None
                ) -> Refusal | None:
        """Take a state as its source read it; return why it must not be used, None if it is.

        ``now_ns`` is the clock of the stamps [ns]; ``received_ns`` a monotonic clock [ns], None
        where only the stamp tells the age of a state.
        """
        admitted = self.gate.admit(raw, now_ns, received_ns)
        if isinstance(admitted, Refusal):
            return admitted
        self.admit(admitted, restarted=self.gate.restarted)
        return None

    def admit(self, sample: StateSample, *, restarted: bool = False) -> None:
        """Take a state that passed the gate."""
        if restarted:
            self._flush('time started again')
            self.logic.restart()
        self.sample = sample
        self.logic.compare(sample)
        self.logic.see()
        if self.target is None:
            self.target = FixedTarget(sample.R_NB)

    def go_back(self) -> None:
        """Forget the state and the plan: the clock went back."""
        self.sample = None
        self.gate.forget()
        self._flush('time started again')

    def aim(self, target: Target) -> None:
        """Take what is commanded, which passed the gate."""
        time_ns = 0 if self.sample is None else self.sample.stamp_ns
        if self.target is None or not goes_on(
                self.target, target, time_ns, self._law.config.step_s):
            self._void('the setpoint changed')
            self.jumps += target.moves
        self.target, self.commanded = target, True

    def direct(self, name: str, direction_N: Array, stamp_ns: int) -> None:
        """Take the unit direction (3,) of a cone; plans before one that jumps bound no value."""
        if self.directions.take(name, direction_N, stamp_ns):
            self._void('the direction of a cone jumped')
            self._plan.unbind()

    def tick(self, at: TickTime) -> Command:
        """Return the command of this tick, judged."""
        return self.judged(self.command(at), at)

    def command(self, at: TickTime) -> Command:
        """Return the command of this tick; `judged` is for when it is on its way."""
        if (late := self._law.solver.late_result()) and late.request.epoch == self._epoch:
            self._offer(late)
        sample, time_ns = self.sample, at.time_ns(self.sample)
        age_ns = None if sample is None else at.age_ns(sample)
        facts, solution = Facts(age_ns), None
        self.ahead.see(sample)
        if age_ns is not None and self.logic.wants_plan(age_ns):
            facts, solution = self._solve(time_ns, age_ns)
        self.output.actuator.planned = None if solution is None else solution.wheel_torque_n_m
        held_B_n_m = self._plan.torque(time_ns)
        decision = self.logic.decide(replace(
            facts, held=held_B_n_m is not None, refused=self.output.actuator.refusal))
        self.logic.enter(decision)
        command = Command(
            time_ns if sample is None else sample.stamp_ns,
            self._actuate(decision, held_B_n_m, time_ns, age_ns or 0), decision.mode,
            decision.reason, _SOURCES.get(decision.mode, 'zero'), solution)
        self._mode = decision.mode
        self.ahead.send(time_ns, decision.mode, command.actuation.acting_B_n_m)
        self.logic.succeed()
        return command

    def judged(self, command: Command, at: TickTime) -> Command:
        """Return the command of a tick with what the monitor says; watch plans and the error."""
        solution, time_ns = command.solution, at.time_ns(self.sample)
        if solution is not None:
            self.plan_watch.see(solution.status, solution.solve_time_s, solution.target_momentum)
        self.logic.consistency.judge()
        self.ahead.watch(self.sample)
        self.steady_error.see(self.sample, self.target, reduced=command.mode in _SOURCES)
        return self._law.judged(
            command, time_ns / NANOSECONDS,
            0.0 if solution is None else at.delay_s(solution.solve_time_s),
            self._law.allowance(solution, self._flown, time_ns + self.ahead.delay_ns,
                                self.ahead.planned_disturbance_B_n_m))

    def failed(self, at: TickTime, error: str) -> Command:
        """Return zero for a tick that ended in an error of our own; too many latch it."""
        decision = self.logic.fail(error)
        self._mode = decision.mode
        self._flush('an error')
        stamp_ns = at.time_ns(None) if self.sample is None else self.sample.stamp_ns
        self.ahead.send(at.time_ns(self.sample), decision.mode, np.zeros(3))
        return Command(stamp_ns, self.output.zero(), decision.mode, decision.reason)

    def stopped(self, now_ns: int) -> Command:
        """Return the last command, zero."""
        self.logic.stop()
        self.ahead.send(now_ns, Mode.STOPPING, np.zeros(3))
        return Command(
            now_ns, self.output.zero(), Mode.STOPPING, self.logic.decide(Facts(None)).reason)

    def _solve(self, time_ns: int, age_ns: int) -> tuple[Facts, AttitudeMpcSolution | None]:
        """Request a plan from the state at the tick; store it if it is better than the old one."""
        assert self.sample is not None
        assert self.target is not None
        self.ahead.dipole_torque_B_n_m = self.output.magnetise(
            self.sample, self.steady_error.attitude_rad)
        try:
            R_NB, omega_BN_B = self.ahead.state_when_acting(self.sample, time_ns, age_ns)
            self.output.observe(omega_BN_B)
        except StepExistenceError as error:
            return Facts(age_ns, SolveOutcome.BEYOND_GUARD, detail=str(error)), None
        if self._fallback.beyond_guard(omega_BN_B):
            self._cold = True
            return Facts(age_ns, SolveOutcome.BEYOND_GUARD, detail=(
                'the rate is beyond the guard of the implicit step')), None
        config, acting_ns = self._law.config, time_ns + self.ahead.delay_ns
        directions_N = self.directions.over_horizon(acting_ns) if config.cones else {}
        target = self._flown = self.target if self.slews is None else self.slews.target(
            self.target, (R_NB, omega_BN_B), acting_ns, self.directions.at(acting_ns), self._void)
        result = self._law.solver.solve(SolveRequest(
            time_ns, R_NB, omega_BN_B, target.at(acting_ns)[0], self._cold, self._epoch,
            self.ahead.disturbance_B_n_m, directions_N, self.output.devices,
            target.over_horizon(acting_ns, config.step_s, config.horizon)))
        offer = Offer.INVALID if result is None else self._offer(result)
        facts = facts_of(age_ns, result, offer)
        solution = None if result is None else result.solution
        held_B_n_m, usable = self._plan.torque(time_ns), facts.outcome is SolveOutcome.USABLE
        sure = usable and solution is not None and solution.status is not SolveStatus.INFEASIBLE
        if held_B_n_m is None or sure or self._fallback.allows(
                R_NB, omega_BN_B, held_B_n_m + self.ahead.planned_disturbance_B_n_m,
                directions_N, solution.R_NB if usable and solution is not None else None):
            return facts, solution
        self._plan.drop()
        detail = f'{facts.detail}; after its torque the body could not stop clear of the cones'
        return replace(facts, outcome=SolveOutcome.NONE, detail=detail), solution

    def _offer(self, result: SolveResult) -> Offer:
        """Store the plan of a result if it is better; return what became of it."""
        request, offer = result.request, Offer.INVALID
        if result.solution is not None:
            offer = self._plan.offer(result.solution, request.time_ns, request.R_ND)
        self._cold = offer is Offer.INVALID
        return offer

    def _actuate(self, decision: Decision, held_B_n_m: Array | None, time_ns: int, age_ns: int
                 ) -> Actuation:
        """Return what the actuator is commanded in a mode."""
        if (mode := decision.mode) is Mode.FALLBACK:
            return self.output.let_through(self._fall_back(time_ns, age_ns))
        self._fallback.reset()
        if mode not in (Mode.NOMINAL, Mode.HOLD):
            return self.output.zero()
        if self._mode in _RETURNS and not self._law.config.cones:  # a plan as it is keeps them
            self.output.slew()
        assert held_B_n_m is not None
        return self.output.let_through(held_B_n_m)

    def _fall_back(self, time_ns: int, age_ns: int) -> Array:
        """Return the torque of the fallback law for the state when it acts, else the latest."""
        assert self.sample is not None
        assert self.target is not None
        try:
            state = self.ahead.state_when_acting(self.sample, time_ns, age_ns)
        except StepExistenceError:
            state = self.sample.R_NB, self.sample.omega_BN_B
        self.output.observe(state[1])
        torque_B_n_m = self._fallback.torque(
            *state, self.target.at(time_ns)[0],
            self.directions.over_horizon(time_ns + self.ahead.delay_ns))
        return torque_B_n_m - self.ahead.planned_disturbance_B_n_m

    def _flush(self, why: str) -> None:
        """Forget plan and warm start, and end the bound on the next value."""
        self._plan.drop()
        self.ahead.restart()
        self._epoch, self._cold = self._epoch + 1, True
        if self.slews is not None:
            self.slews.forget()
        self._void(why)

    def _void(self, why: str) -> None:
        """End the bound that the last plan put on the next value, and watch the error anew."""
        self.steady_error.forget()
        if self._law.monitor is not None:
            self._law.monitor.suspend(why)
