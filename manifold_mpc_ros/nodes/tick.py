# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What to command at a tick: pure logic, states and a time in, one finite command out."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Protocol

import numpy as np

from manifold_mpc_ros.config import AttitudeMpcConfig
from manifold_mpc_ros.config_checks import FloatArray
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.mpc.monitor import PromiseMonitor
from manifold_mpc_ros.mpc.promise import PromiseRecord
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus
from manifold_mpc_ros.nodes.gate import NANOSECONDS, StateSample


class Mode(str, Enum):
    """What the active controller is doing."""

    WAIT = 'WAIT'          # zero torque, no valid state has come yet
    NOMINAL = 'NOMINAL'    # the torque of the optimiser
    FALLBACK = 'FALLBACK'  # torque against the rate, the optimiser has no plan from this state
    COAST = 'COAST'        # zero torque, the state is too old
    PAUSED = 'PAUSED'      # zero torque, by the operator


#: Where a torque comes from, by mode; the others command zero.
_SOURCES = {Mode.NOMINAL: 'mpc', Mode.FALLBACK: 'damping'}

#: The fallback would stop the body in so many steps, if the limits let it.
DAMPING_STEPS = 4.0


class Solver(Protocol):
    """What the loop needs of `AttitudeMpc`."""

    def solve(
        self, R_NB: FloatArray, omega_BN_B: FloatArray, R_ND: FloatArray | None = None,
    ) -> AttitudeMpcSolution:
        """Return the optimal torques from a measured state to the commanded attitude."""

    def reset(self) -> None:
        """Forget the warm start."""


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
        """Where the torque comes from: 'mpc', 'damping' or 'zero'."""
        return _SOURCES.get(self.mode, 'zero')


class ControlLoop:
    """The controller between messages: latest state, setpoint, pause, and the decision.

    Arguments
    ---------
    solver
        `AttitudeMpc` or anything with its `solve` and `reset`.
    config
        The control law's configuration: torque limits, inertia and step.
    timeout_s
        Age of the state above which the command is zero [s].
    initial_setpoint
        'identity', or 'hold' for the first attitude that comes.
    monitor
        Judges every tick, where there is one.

    """

    def __init__(
        self, solver: Solver, config: AttitudeMpcConfig, *, timeout_s: float,
        initial_setpoint: str, monitor: PromiseMonitor | None = None,
    ) -> None:
        """Start without a state, at the initial setpoint."""
        self._solver = solver
        limit = config.max_torque_n_m
        self._limit = np.full(3, np.inf) if limit is None else limit
        self._inertia_kg_m2, self._step_s = config.inertia_kg_m2, config.step_s
        self._damping = config.inertia_kg_m2 / (DAMPING_STEPS * config.step_s)
        self._timeout_ns = round(timeout_s * NANOSECONDS)
        self._hold = initial_setpoint == 'hold'
        self._monitor = monitor
        self.paused = False
        self.reset()

    def reset(self) -> None:
        """Forget state, setpoint and warm start, as at the start; a pause stays."""
        self._sample: StateSample | None = None
        self._R_ND: FloatArray | None = None if self._hold else np.eye(3)
        self.commanded = False
        self._torque_B_n_m = np.zeros(3)
        self._solver.reset()
        self._void('reset')

    @property
    def state_stamp_ns(self) -> int | None:
        """Stamp of the latest state, None before the first."""
        return None if self._sample is None else self._sample.stamp_ns

    def admit(self, sample: StateSample, *, restarted: bool = False) -> None:
        """Take a state that passed the gate; the warm start ends where time started again."""
        if restarted:
            self._solver.reset()
            self._void('time started again')
        self._sample = sample
        if self._R_ND is None:
            self._R_ND = sample.R_NB

    def aim(self, R_ND: FloatArray) -> None:
        """Take a commanded attitude that passed the gate."""
        if self._R_ND is None or not np.array_equal(R_ND, self._R_ND):
            self._void('the setpoint changed')
        self._R_ND = R_ND
        self.commanded = True

    def tick(self, now_ns: int | None) -> Command:
        """Return the command of this tick; ``now_ns`` None (lockstep) means the state is new."""
        command = self._decide(now_ns)
        self._torque_B_n_m = command.torque_B_n_m
        return self._judged(command, now_ns)

    def _judged(self, command: Command, now_ns: int | None) -> Command:
        """Return the command with what the monitor says about the tick.

        In lockstep time waits for the torque; else it is late by the time that the plan took.
        """
        if self._monitor is None:
            return command
        solution, nominal = command.solution, command.mode is Mode.NOMINAL
        applied = solution is not None and nominal and np.array_equal(
            command.torque_B_n_m, solution.torque_B_n_m)
        delay_s = 0.0 if now_ns is None or solution is None else solution.solve_time_s
        time_ns = command.stamp_ns if now_ns is None else now_ns
        return replace(command, promise=self._monitor.observe(
            solution, time_s=time_ns / NANOSECONDS, delay_s=delay_s, applied=applied,
            why_none='' if nominal else command.reason))

    def _void(self, why: str) -> None:
        """End the promise that the last plan made."""
        if self._monitor is not None:
            self._monitor.suspend(why)

    def _decide(self, now_ns: int | None) -> Command:
        """Return the mode's command."""
        sample = self._sample
        if sample is None:
            return self._zero(now_ns or 0, Mode.WAIT, 'waiting for the first valid state')
        if self.paused:
            return self._zero(sample.stamp_ns, Mode.PAUSED, 'paused by the operator')
        age_ns = 0 if now_ns is None else now_ns - sample.stamp_ns
        if age_ns > self._timeout_ns:
            return self._zero(
                sample.stamp_ns, Mode.COAST, f'the state is {age_ns / NANOSECONDS:.3f} s old')
        return self._solve(sample, max(0, age_ns) / NANOSECONDS)

    def _at_the_tick(self, sample: StateSample, age_s: float) -> tuple[FloatArray, FloatArray]:
        """Return attitude and rate now: the state moved on by its age under the last command."""
        R_NB, omega_BN_B = sample.R_NB, sample.omega_BN_B
        steps = math.ceil(age_s / self._step_s)
        for _ in range(steps):
            R_NB, omega_BN_B = lgvi_step(
                R_NB, omega_BN_B, self._torque_B_n_m, inertia_kg_m2=self._inertia_kg_m2,
                step_s=age_s / steps)
        return R_NB, omega_BN_B

    def _solve(self, sample: StateSample, age_s: float) -> Command:
        """Return the optimal torque, or one that slows the body down when there is none."""
        try:
            solution = self._solver.solve(*self._at_the_tick(sample, age_s), self._R_ND)
        except ManifoldMpcError as error:
            return self._slow_down(sample, str(error))
        torque = np.asarray(solution.torque_B_n_m, dtype=np.float64)
        if solution.status == SolveStatus.FAILED or not np.isfinite(torque).all():
            return self._slow_down(sample, 'the solver has no plan from this state', solution)
        return Command(
            sample.stamp_ns, np.clip(torque, -self._limit, self._limit), Mode.NOMINAL,
            f'solver: {SolveStatus(solution.status).value}', solution)

    def _slow_down(
        self, sample: StateSample, reason: str, solution: AttitudeMpcSolution | None = None,
    ) -> Command:
        """Return ``-J omega / (4 h)`` scaled into the limits, its direction kept.

        It takes kinetic energy out of the body at every rate, until the prediction exists again.
        """
        self._solver.reset()
        torque = -self._damping @ sample.omega_BN_B
        with np.errstate(divide='ignore'):
            scale = min(1.0, float(np.min(self._limit / np.abs(torque), initial=np.inf)))
        return Command(sample.stamp_ns, scale * torque, Mode.FALLBACK, reason, solution)

    def _zero(self, stamp_ns: int, mode: Mode, reason: str) -> Command:
        """Return a command of zero torque."""
        return Command(stamp_ns, np.zeros(3), mode, reason)
