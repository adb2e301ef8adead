# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One fault at a time: bring the spacecraft into the phase, inject, wait for recovery, judge."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable

import numpy as np

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.fault_injection.evidence import Evidence, Limits, TrialVerdict
from manifold_mpc_ros.lab.fault_injection.fault import CONTROLLER, SIMULATOR, Fault, OnTopic, Phase
from manifold_mpc_ros.lab.fault_injection.injection import injection
from manifold_mpc_ros.lab.fault_injection.judge import judge
from manifold_mpc_ros.lab.fault_injection.rig import NAMES, Bench
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.sim.pacing import LONGEST_CATCH_UP_S

#: The controller has to be active within this after the start, which builds the solver, and both
#: nodes at work within this after that [s].
START_S = 240.0
#: Nodes that are active and not at work for so long are slowed down, where they have waited for a
#: processor for this part of the time [s, 1].
STRUGGLE_S, STARVED_PART = 10.0, 0.2
#: By so much, whole so that periods still fit each other, where steps are shorter than this: from
#: 50 Hz to 10. Beside six busy loops on two cores states are too old at 50 Hz, few at 10 [1, s].
SLOWER, SLOW_STEP_S = 5, 0.1
#: What has not recovered in time may still do so without being started again [s].
LATE_RECOVERY_S = 30.0
#: A manoeuvre reaches each of its phases within this [s].
PHASE_S = 20.0
#: A setpoint is published again after this, until the manoeuvre has begun [s].
SETPOINT_PERIOD_S = 0.1
#: So many ticks in a row, most of them in NOMINAL, are a recovery.
STEADY_TICKS = 5
#: What is older than this is not present [s].
FRESH_S = 0.3
#: Reports of both nodes among which those ticks are.
_LOOK_BACK = 40
#: What a new controller had published before it knew the recorder is seen after this [s].
DRIFT_S = 0.5
#: A lost message is sent again after the writer's heartbeat, 3 s; the others wait for it [s].
CATCH_UP_S = 6.0
#: Commands are to come at least this often, or at every fifth tick [s].
LONGEST_GAP_S = 0.25
#: The turn of every manoeuvre is 180 degrees; these remain when a phase begins [rad].
_MOVING_RAD_S = 0.15
_BEGINS_BELOW = {Phase.SLEW: math.radians(120.0), Phase.SETTLE: math.radians(20.0)}
_OVER_BELOW = {Phase.SLEW: math.radians(60.0), Phase.SETTLE: math.radians(1.0)}


class Trials:
    """Runs faults on one bench, one after another."""

    def __init__(self, bench: Bench, config: ControllerConfig, seed: int) -> None:
        """Begin without a manoeuvre."""
        self._bench, self._config = bench, config
        self._draws = random.Random(seed)
        self._R_ND: np.ndarray | None = None
        self._steady_since_s = math.inf
        self._starved = False
        self._asked = bench.plan.step_s is not None

    @property
    def limits(self) -> Limits:
        """What is demanded at the present rate."""
        limit = self._config.mpc.max_torque_n_m
        step_s = self._bench.steps_s[-1]
        return Limits(
            tuple(np.full(3, math.inf) if limit is None else limit), step_s,
            max(5.0 * step_s, LONGEST_GAP_S),
            round(LONGEST_CATCH_UP_S / step_s) if self._bench.simulated_time else 0)

    @property
    def _may_slow(self) -> bool:
        """Whether nodes that the machine has no time for are to be slowed down."""
        return not self._asked and self._bench.steps_s[-1] < SLOW_STEP_S

    def settle_in(self) -> None:
        """Wait until both nodes are at work; raises ManifoldMpcError.

        Unless a rate was asked for, they get a lower one where the machine has no time for theirs.
        """
        while not (at_work := self._at_work(may_slow=self._may_slow)) and (
                self._may_slow and self._starved):
            self._bench.slow_down(SLOWER)
        if not at_work:
            words = '; '.join(f'{node}: {self._bench.life(node).process.last_words()}'
                              for node in NAMES)
            raise ManifoldMpcError(
                f'the nodes were not at work within {START_S:g} s: {words}' + self._starved * (
                    '; the machine kept them from a processor: a lower --rate-hz needs less'))
        self._bench.tracebacks()
        self._bench.deaths.clear()
        # What came at another rate is not to be judged by this one.
        self._bench.observer.clear(self._bench.life(CONTROLLER).begun_s)

    def _at_work(self, *, may_slow: bool) -> bool:
        """Wait until both nodes are at work; False in time, or once slowing down may help."""
        bench, begun_s = self._bench, time.monotonic()

        def active() -> bool:
            latest = bench.observer.latest.get(CONTROLLER)
            return latest is not None and latest.time_s > begun_s and latest.mode != 'INACTIVE'

        def decided() -> bool:
            nonlocal begun_s
            steady, span_s = self._steady(), time.monotonic() - begun_s
            if not steady and span_s > STRUGGLE_S:
                self._starved = bench.starved_s > STARVED_PART * span_s
                begun_s += span_s
                bench.begin_account()
            return steady or (may_slow and self._starved)

        if self._wait(active, START_S) is None:
            return False
        begun_s, self._starved = time.monotonic(), False
        bench.begin_account()
        return self._wait(decided, START_S) is not None and not (may_slow and self._starved)

    def rest(self, until_s: float) -> None:
        """Fly manoeuvres until a time of the monotonic clock."""
        while time.monotonic() < until_s:
            if self._R_ND is None or self._error_rad() < _OVER_BELOW[Phase.SETTLE]:
                self._new_manoeuvre()
            self._wait(lambda: time.monotonic() >= until_s
                       or self._error_rad() < _OVER_BELOW[Phase.SETTLE],
                       min(PHASE_S, until_s - time.monotonic()))

    def run(self, fault: Fault, phase: Phase, seed: int) -> TrialVerdict:
        """Inject one fault and return the verdict."""
        bench, observer = self._bench, self._bench.observer
        reached = self._reach(phase)
        bench.begin_account()
        seen = Evidence(fault, phase, seed, time.monotonic(), before={
            node: report.values for node, report in observer.latest.items()})
        if not reached:
            seen.delays.append(f'the manoeuvre did not come to its phase {phase.value}')
        doing = injection(bench, fault, seed)
        doing.run()
        seen.ended_s = time.monotonic()
        if fault.expected.reset:
            self._reset()
        patience_s = fault.expected.recovery_s + bench.late_s + bench.starved_s
        if self._wait(lambda: self._steady(seen.ended_s), patience_s) is not None:
            seen.recovered_s = self._steady_since_s
        seen.closed_s = time.monotonic()
        if seen.recovered_s is not None:
            self._wait(lambda: observer.recorded_s >= seen.closed_s, CATCH_UP_S)
        seen.commands = [c for c in observer.commands if c.time_s <= seen.closed_s]
        seen.reports = [r for r in observer.reports if r.time_s >= seen.begun_s]
        seen.troubles += [*doing.troubles, *bench.deaths]
        seen.delays += doing.delays
        bench.deaths.clear()
        seen.late_s, seen.starved_s = bench.late_s, bench.starved_s
        seen.exceptions = bench.tracebacks()
        if seen.recovered_s is None:
            self._give_up()
        else:
            seen.tick_drift = self._tick_drift(fault.expected.surplus)
        observer.clear(seen.closed_s)
        if not isinstance(fault.action, OnTopic):
            self._R_ND = None  # it may have been forgotten
        return judge(seen, self.limits)

    def _tick_drift(self, expected: int) -> int:
        """Return by how many commands more than usual go beyond one per tick; 0 in a new life.

        A message may be late by what the machine is late by, or wait for one that is sent again,
        so a difference has to last.
        """
        observer = self._bench.observer
        usual = observer.usual_surplus
        if usual is None:
            begun_s = time.monotonic()
            self._wait(lambda: observer.recorded_s > begun_s + DRIFT_S, CATCH_UP_S)
            observer.usual_surplus = observer.surplus
            return 0
        usual += expected
        self._wait(lambda: observer.surplus == usual, CATCH_UP_S)
        observer.usual_surplus = observer.surplus
        return (observer.surplus or 0) - usual

    def _steady(self, since_s: float = -math.inf) -> bool:
        """Whether both nodes are at work, and the controller has been in NOMINAL for a while.

        A plan that was late, on a busy machine, leaves a tick to HOLD: not more than every other.
        Keeps since when that is.
        """
        observer, now_s = self._bench.observer, time.monotonic()
        latest = observer.latest.get(SIMULATOR)
        if latest is None or now_s - min(
                latest.time_s, observer.state_s, observer.command_s) > FRESH_S + 0.2:
            return False
        last = [report for report in observer.reports[-_LOOK_BACK:] if report.node == CONTROLLER
                and report.time_s >= since_s][-STEADY_TICKS:]
        self._steady_since_s = last[0].time_s if last else math.inf
        return (len(last) == STEADY_TICKS and now_s - last[-1].time_s < FRESH_S
                and {report.mode for report in last} <= {'NOMINAL', 'HOLD'}
                and sum(report.mode == 'NOMINAL' for report in last) > STEADY_TICKS // 2
                and latest.mode == 'RUN' and latest.time_s >= since_s)

    def _wait(self, condition: Callable[[], bool], limit_s: float) -> float | None:
        """Look until a condition holds; return when that was, None when it never did [s]."""
        until_s = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > until_s:
                return None
            self._bench.look()
        return time.monotonic()

    def _error_rad(self) -> float:
        """Return the angle that is left of the manoeuvre, pi without one."""
        R_NB = self._bench.observer.R_NB
        if self._R_ND is None or R_NB is None:
            return math.pi
        return float(so3.angle(self._R_ND.T @ R_NB))

    def _reach(self, phase: Phase) -> bool:
        """Bring the spacecraft into a phase, with a new manoeuvre where that is over."""
        if self._R_ND is None or phase is Phase.ACCELERATION or (
                self._error_rad() < _OVER_BELOW[phase]):
            self._new_manoeuvre()
        if phase is Phase.ACCELERATION:
            return True
        return self._wait(lambda: self._error_rad() < _BEGINS_BELOW[phase], PHASE_S) is not None

    def _new_manoeuvre(self) -> None:
        """Command the attitude that is exactly 180 degrees away, about an axis drawn."""
        R_NB = self._bench.observer.R_NB
        if R_NB is None:
            return
        axis = np.array([self._draws.gauss(0.0, 1.0) for _ in range(3)])
        self._R_ND = R_NB @ so3.exp(math.pi * axis / np.linalg.norm(axis))
        w, x, y, z = map(float, so3.quaternion_from_rotation(self._R_ND))
        begun_s, next_s = time.monotonic(), -math.inf
        while math.hypot(*self._bench.observer.omega_BN_B) < _MOVING_RAD_S or (
                time.monotonic() - begun_s < SETPOINT_PERIOD_S):
            if time.monotonic() - begun_s > PHASE_S:
                return
            if time.monotonic() >= next_s:
                self._bench.requests.command(self._config.inertial_frame_id, x, y, z, w)
                next_s = time.monotonic() + SETPOINT_PERIOD_S
            self._bench.look()

    def _reset(self) -> None:
        """Do what an operator does about a latched fault: reset both nodes."""
        futures = [self._bench.requests.reset(node) for node in (SIMULATOR, CONTROLLER)]
        self._wait(lambda: all(future.done() for future in futures), FRESH_S)
        self._R_ND = None

    def _give_up(self) -> None:
        """Start both nodes afresh, unless they come round: the next fault is not to suffer."""
        if self._wait(self._steady, LATE_RECOVERY_S) is not None:
            return
        self._bench.restart()
        self._R_ND = None
        self.settle_in()
