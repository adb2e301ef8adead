# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What to command at a tick: pure logic, states and a time in, one finite command out.

The loop gathers the facts, `ModeLogic` decides, and what the mode stands for is done here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from manifold_mpc_ros.config.checks import FloatArray
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.decrease_monitor import PromiseMonitor
from manifold_mpc_ros.control.decrease_record import PromiseRecord
from manifold_mpc_ros.control.fallback_law import FallbackLaw
from manifold_mpc_ros.control.held_plan import HeldPlan, is_valid
from manifold_mpc_ros.control.input_gate import NANOSECONDS, StateSample
from manifold_mpc_ros.control.modes import Decision, Facts, Mode, ModeLogic, Plan
from manifold_mpc_ros.control.output_gate import OutputGate
from manifold_mpc_ros.control.solver_thread import Answer, Planner, Question
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.errors import StepExistenceError
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus

#: Where a torque comes from, by mode; the others command zero.
_SOURCES = {Mode.NOMINAL: 'mpc', Mode.HOLD: 'plan', Mode.FALLBACK: 'fallback'}
#: From these the torque comes back to the optimiser's gradually.
_RETURNS = frozenset({Mode.FALLBACK, Mode.COAST, Mode.FAULT})


@dataclass(frozen=True)
class Command:
    """One decided torque: finite, within the limits, and why it is what it is."""

    stamp_ns: int
    torque_B_n_m: FloatArray
    mode: Mode
    reason: str
    solution: AttitudeMpcSolution | None = None
    promise: PromiseRecord | None = None

    @property
    def source(self) -> str:
        """Where the torque comes from: 'mpc', 'plan', 'fallback' or 'zero'."""
        return _SOURCES.get(self.mode, 'zero')


@dataclass(frozen=True)
class Law:
    """A control law that is ready to work: its configuration, its solver, and who judges it."""

    config: AttitudeMpcConfig
    planner: Planner
    timeout_s: float
    monitor: PromiseMonitor | None = None
    backend: str = ''


class ControlLoop:
    """The controller between messages: latest state, setpoint, and the command of each tick.

    Arguments
    ---------
    law
        What plans, until `exchange` brings another.
    initial_setpoint
        'identity', or 'hold' for the first attitude that comes.

    """

    def __init__(self, law: Law, *, initial_setpoint: str) -> None:
        """Start without a state, at the initial setpoint."""
        self._hold = initial_setpoint == 'hold'
        self.logic = ModeLogic(_ns(law.config.step_s), _ns(law.timeout_s))
        self.output = OutputGate(law.config.max_torque_n_m)
        self._plan = HeldPlan(_ns(law.config.step_s))
        self._mode = Mode.WAIT
        self._epoch = 0
        self._take(law)
        self.reset()

    def reset(self) -> None:
        """Forget state, setpoint, plan and fault, as at the start; a pause stays."""
        self.logic.reset()
        self.output.zero()
        self._R_ND: FloatArray | None = None if self._hold else np.eye(3)
        self.commanded = False
        self._sample: StateSample | None = None
        self._received_ns: int | None = None
        self._flush('reset')

    def exchange(self, law: Law) -> None:
        """Work with another law from the next tick on; the plan of the old one is still held."""
        self._law.planner.close()
        self._take(law)
        self.output.set_limit(law.config.max_torque_n_m)
        self.logic.set_timeout(_ns(law.timeout_s))
        self._void('the controller was changed')

    def close(self) -> None:
        """Ask the solver no more."""
        self._law.planner.close()

    def _take(self, law: Law) -> None:
        """Plan with this law from now on."""
        self._law = law
        self._fallback = FallbackLaw(law.config)
        self._cold = True

    @property
    def state_stamp_ns(self) -> int | None:
        """Stamp of the latest state, None before the first."""
        return None if self._sample is None else self._sample.stamp_ns

    def admit(
        self, sample: StateSample, *, restarted: bool = False, received_ns: int | None = None,
    ) -> None:
        """Take a state that passed the gate, received at this time of a monotonic clock."""
        if restarted:
            self._flush('time started again')
            self.logic.restart()
        self._sample, self._received_ns = sample, received_ns
        self.logic.see()
        if self._R_ND is None:
            self._R_ND = sample.R_NB

    def go_back(self) -> None:
        """Forget the state and the plan: the clock went back."""
        self._sample = None
        self._flush('time started again')

    def aim(self, R_ND: FloatArray) -> None:
        """Take a commanded attitude that passed the gate."""
        if self._R_ND is None or not np.array_equal(R_ND, self._R_ND):
            self._void('the setpoint changed')
        self._R_ND = R_ND
        self.commanded = True

    def tick(self, now_ns: int | None, monotonic_ns: int | None = None) -> Command:
        """Return the command of this tick.

        ``now_ns`` None (lockstep) means that the state is new; ``monotonic_ns`` None that only
        stamps tell its age.
        """
        late = self._law.planner.late()
        if late is not None and late.question.epoch == self._epoch:
            self._keep(late)
        time_ns = self.state_stamp_ns or 0 if now_ns is None else now_ns
        age_ns = self._age_ns(now_ns, monotonic_ns)
        facts, solution = Facts(age_ns), None
        if age_ns is not None and self.logic.wants_plan(age_ns):
            facts, solution = self._ask(time_ns, age_ns)
        held = self._plan.torque(time_ns) is not None
        decision = self.logic.decide(replace(facts, held=held))
        command = self._act(decision, time_ns, age_ns or 0, solution)
        self._mode = decision.mode
        judged = self._judged(command, now_ns)
        self.logic.succeed()
        return judged

    def failed(self, now_ns: int, error: str) -> Command:
        """Return zero for a tick that ended in an error of our own; too many latch it."""
        decision = self.logic.fail(error)
        self._mode = decision.mode
        self._flush('an error')
        return Command(
            self.state_stamp_ns or now_ns, self.output.zero(), decision.mode, decision.reason)

    def stopped(self, now_ns: int) -> Command:
        """Return the last command, zero."""
        self.logic.stop()
        return Command(
            now_ns, self.output.zero(), Mode.STOPPING, self.logic.decide(Facts(None)).reason)

    def _age_ns(self, now_ns: int | None, monotonic_ns: int | None) -> int | None:
        """Return the age of the state by the clock that says more, None without a state."""
        if self._sample is None:
            return None
        stamped = 0 if now_ns is None else now_ns - self._sample.stamp_ns
        received = 0
        if monotonic_ns is not None and self._received_ns is not None:
            received = monotonic_ns - self._received_ns
        return max(0, stamped, received)

    def _ask(self, time_ns: int, age_ns: int) -> tuple[Facts, AttitudeMpcSolution | None]:
        """Ask for a plan from the state at the tick; keep it if it is better than the old one."""
        try:
            R_NB, omega_BN_B = self._at_the_tick(age_ns)
        except StepExistenceError as error:
            return Facts(age_ns, Plan.BEYOND_GUARD, detail=str(error)), None
        if self._fallback.beyond_guard(omega_BN_B):
            self._cold = True
            return Facts(age_ns, Plan.BEYOND_GUARD, detail='the rate is beyond the guard of the '
                                                          'implicit step'), None
        assert self._R_ND is not None
        answer = self._law.planner.ask(Question(
            time_ns, R_NB, omega_BN_B, self._R_ND, self._cold, self._epoch))
        if answer is None:
            return Facts(age_ns, Plan.NONE, detail='the solver is late'), None
        kept = self._keep(answer)
        solution = answer.solution
        if solution is None:
            return Facts(age_ns, Plan.NONE, detail=f'the solver failed: {answer.error}'), None
        status = f'solver: {SolveStatus(solution.status).value}'
        if kept:
            return Facts(age_ns, Plan.USABLE, detail=status), solution
        why = ', worse than the stored plan' if is_valid(solution) else ', no plan from this state'
        return Facts(age_ns, Plan.NONE, detail=status + why), solution

    def _keep(self, answer: Answer) -> bool:
        """Store the plan of an answer if it is better; return whether it is."""
        question, solution = answer.question, answer.solution
        self._cold = solution is None or not is_valid(solution)
        if solution is None or not self._plan.accepts(solution, question.time_ns, question.R_ND):
            return False
        self._plan.keep(solution, question.time_ns, question.R_ND)
        return True

    def _at_the_tick(self, age_ns: int) -> tuple[FloatArray, FloatArray]:
        """Return attitude and rate now: the state moved on by its age under the last command."""
        assert self._sample is not None
        R_NB, omega_BN_B = self._sample.R_NB, self._sample.omega_BN_B
        age_s, config = age_ns / NANOSECONDS, self._law.config
        steps = math.ceil(age_s / config.step_s)
        for _ in range(steps):
            R_NB, omega_BN_B = lgvi_step(
                R_NB, omega_BN_B, self.output.latest_B_n_m, inertia_kg_m2=config.inertia_kg_m2,
                step_s=age_s / steps)
        return R_NB, omega_BN_B

    def _act(
        self, decision: Decision, time_ns: int, age_ns: int, solution: AttitudeMpcSolution | None,
    ) -> Command:
        """Return the command that a decision stands for."""
        mode = decision.mode
        if mode in (Mode.NOMINAL, Mode.HOLD):
            if self._mode in _RETURNS:
                self.output.slew()
            asked = self._plan.torque(time_ns)
            assert asked is not None
            torque = self.output.let_through(asked)
        elif mode is Mode.FALLBACK:
            torque = self.output.let_through(self._fall_back(age_ns))
        else:
            torque = self.output.zero()
        if mode is not Mode.FALLBACK:
            self._fallback.reset()
        stamp_ns = time_ns if self._sample is None else self._sample.stamp_ns
        return Command(stamp_ns, torque, mode, decision.reason, solution)

    def _fall_back(self, age_ns: int) -> FloatArray:
        """Return the torque of the fallback law, at the tick where the state can be moved on."""
        assert self._sample is not None
        assert self._R_ND is not None
        try:
            state = self._at_the_tick(age_ns)
        except StepExistenceError:
            state = self._sample.R_NB, self._sample.omega_BN_B
        return self._fallback.torque(*state, self._R_ND)

    def _judged(self, command: Command, now_ns: int | None) -> Command:
        """Return the command with what the monitor says about the tick.

        In lockstep time waits for the torque; else it is late by the time that the plan took.
        """
        monitor = self._law.monitor
        if monitor is None:
            return command
        solution, nominal = command.solution, command.mode is Mode.NOMINAL
        applied = solution is not None and nominal and np.array_equal(
            command.torque_B_n_m, solution.torque_B_n_m)
        delay_s = 0.0 if now_ns is None or solution is None else solution.solve_time_s
        time_ns = command.stamp_ns if now_ns is None else now_ns
        return replace(command, promise=monitor.observe(
            solution, time_s=time_ns / NANOSECONDS, delay_s=delay_s, applied=applied,
            why_none='' if nominal else command.reason))

    def _flush(self, why: str) -> None:
        """Forget plan and warm start, and end the promise."""
        self._plan.drop()
        self._epoch += 1
        self._cold = True
        self._void(why)

    def _void(self, why: str) -> None:
        """End the promise that the last plan made."""
        if self._law.monitor is not None:
            self._law.monitor.suspend(why)


def _ns(seconds: float) -> int:
    """Return seconds in nanoseconds."""
    return round(seconds * NANOSECONDS)
