# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The local solver in CasADi's virtual machine: the loop of driver.c, statement by statement."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np

from manifold_mpc_ros.mpc.backends.local_solver import (
    UNUSABLE,
    Course,
    LocalSolver,
    Measure,
    Plan,
    Progress,
    Recording,
    Report,
)
from manifold_mpc_ros.mpc.backends.virtual import Part, Slot, memory_of
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program import options
from manifold_mpc_ros.mpc.program.layout import memory_fields
from manifold_mpc_ros.mpc.program.phase import Field, Memory
from manifold_mpc_ros.mpc.program.program import Program
from manifold_mpc_ros.mpc.program.structure import Structure
from manifold_mpc_ros.mpc.scaling import Array
from manifold_mpc_ros.mpc.stages.barrier import BOUNDARY


class InterpretedPlan(Plan):
    """A trajectory as one array (size, N + 1) per field."""

    def __init__(self, structure: Structure, horizon: int) -> None:
        """Allocate."""
        super().__init__(structure, horizon)
        self.memory = {field: memory_of(field, horizon)
                       for field in memory_fields(Memory.TRAJECTORY)}

    def field(self, field: Field) -> Array:
        """Return a field (N + 1, size)."""
        return self.memory[field].T


class Parts:
    """The parts of a program as functions of one horizon, to be shared by solvers."""

    def __init__(self, program: Program, horizon: int) -> None:
        """Build the graphs."""
        self.horizon = horizon
        self._parts = {name: Part(name, phases, horizon)
                       for name, phases in program._asdict().items()}

    def bind(self, name: str, memory: dict[Slot, Array]) -> Callable[[], None]:
        """Return what runs a part on some memory."""
        return self._parts[name].bind(memory)


class InterpretedSolver(LocalSolver):
    """The virtual machine with memory of its own."""

    def __init__(self, parts: Parts, structure: Structure, parameters: Array) -> None:
        """Allocate everything that a solve needs."""
        super().__init__(structure, parts.horizon)
        self._parts = parts
        n = parts.horizon
        self._shared = {
            Slot(field, False): memory_of(field, n)
            for memory in (Memory.MODEL, Memory.GLOBAL) for field in memory_fields(memory)}
        self._plan, self._fresh = InterpretedPlan(structure, n), InterpretedPlan(structure, n)
        self._bound: dict[tuple[str, Plan, Plan], Callable[[], None]] = {}
        self._at(f.PARAMETER)[:] = parameters
        self._at(f.INNER)[:n] = 1.0
        self._at(f.LATER)[1:] = 1.0
        self._cost = self._logs = self._mu = self._elapsed_s = 0.0
        self._exact = 1.0
        self._stationarity = self._products = self._decrease = math.inf
        self._flag, self._passes = options.STALLED, 0

    def _at(self, field: Field) -> Array:
        """Return the memory of a global, or of a field of the model (N + 1, size)."""
        memory = self._shared[Slot(field, False)]
        return memory[:, 0] if field.memory is Memory.GLOBAL else memory.T

    def _run(self, part: str, plan: InterpretedPlan | None = None) -> None:
        """Run a part from a plan (the current one) to the fresh trajectory."""
        old = self._plan if plan is None else plan
        key = part, old, self._fresh
        if key not in self._bound:
            self._bound[key] = self._parts.bind(part, self._shared | {
                Slot(field, new): side.memory[field]
                for new, side in ((False, old), (True, self._fresh)) for field in side.memory})
        self._bound[key]()

    def measure(self, R_NB: Array, R_ND: Array, omega: Array) -> Measure:
        """Set the state."""
        self._at(f.MEASURED)[:] = np.concatenate([R_NB.ravel(), R_ND.ravel(), omega])
        if not math.isfinite(self._at(f.MEASURED).sum()):
            return UNUSABLE
        self._run('measure')
        return Measure(*self._at(f.MEASURE).tolist())

    def flip(self) -> None:
        """Turn the sign of the starting quaternion."""
        self._at(f.START)[:4] *= -1.0

    def begin_slew(self, mu: float, lean: Array, lean_steps: int) -> None:
        """Start from the slew law."""
        begun_s = time.monotonic()
        self._at(f.BARRIER)[:] = self._mu = mu
        leans = self._at(f.LEAN)
        leans[:] = 0.0
        leans[:lean_steps] = lean
        self._run('slew')
        self._run('cold')
        self._begin()
        self._elapsed_s += time.monotonic() - begun_s

    def begin_shift(self, mu: float, plan: Plan) -> None:
        """Start from a plan, one stage ahead."""
        assert isinstance(plan, InterpretedPlan)
        begun_s = time.monotonic()
        self._at(f.BARRIER)[:] = self._mu = mu
        self._run('shift', plan)
        self._run('warm', plan)
        self._begin()
        self._elapsed_s += time.monotonic() - begun_s

    def _begin(self) -> None:
        self._take_fresh()
        self._flag = options.RUNNING if self._at(f.SUMS)[2] > 0.0 else options.STALLED
        self._stationarity = self._products = self._decrease = math.inf
        self._exact, self._passes = 1.0, 0

    def _take_fresh(self) -> None:
        self._plan, self._fresh = self._fresh, self._plan
        self._cost, self._logs = self._at(f.SUMS)[:2].tolist()

    def _accepts(self, length: float) -> bool:
        cost, logs, sound = self._at(f.SUMS).tolist()
        merit = self._cost - self._mu * self._logs
        noise = (options.COST_NOISE * abs(self._cost)
                 + options.BARRIER_NOISE * abs(self._mu * self._logs))
        bound = merit - options.ARMIJO * length * self._decrease + noise
        return bool(sound > 0.0 and cost - self._mu * logs <= bound)

    def _search_length(self) -> float:
        reach = float(self._at(f.LARGEST_REACH)[0])
        length = BOUNDARY / reach if reach > BOUNDARY else 1.0
        while length > options.SMALLEST_STEP:
            self._at(f.LENGTH)[:] = length
            self._run('trial')
            if self._accepts(length):
                return length
            length *= options.BACKTRACK
        return 0.0

    def _model_plan(self) -> float:
        self._at(f.BARRIER)[:], self._at(f.EXACT)[:] = self._mu, self._exact
        self._run('backward')
        stationarity, self._products, self._decrease, pivot, force = (
            self._at(f.RESIDUALS).tolist())
        self._stationarity = stationarity / max(1.0, force / options.LARGE_FORCE)
        self._passes += 1
        return float(pivot)

    def _one_pass(self) -> None:
        pivot = self._model_plan()
        if max(self._stationarity, self._products) < options.TOLERANCE:
            self._flag = options.CONVERGED
            return
        length = self._search_length() if pivot > options.SMALLEST_PIVOT else 0.0
        if length == 0.0:
            if self._exact == 0.0:
                self._flag = options.STALLED
            self._lower_blend()
            return
        self._take_fresh()
        if length >= options.READY_LENGTH and self._decrease < options.BARRIER_READY * self._mu:
            self._mu = max(options.SMALLEST_BARRIER, min(
                options.BARRIER_FACTOR * self._mu, self._mu * math.sqrt(self._mu)))
        if length < options.SHORT_LENGTH:
            self._lower_blend()
        else:
            self._exact = min(1.0, max(options.BLEND_UP * self._exact, options.SMALLEST_BLEND))

    def _lower_blend(self) -> None:
        self._exact = (options.BLEND_DOWN * self._exact
                       if self._exact > options.SMALLEST_BLEND else 0.0)

    def iterate(self, most: int, deadline_s: float = math.inf) -> None:
        """Run passes."""
        begun_s = time.monotonic()
        while self._flag == options.RUNNING and self._passes < most:
            if self._passes and time.monotonic() > deadline_s:
                self._flag = options.OUT_OF_TIME
            else:
                self._one_pass()
        self._elapsed_s += time.monotonic() - begun_s

    def improve(self, plan: Plan, deadline_s: float = math.inf) -> int:
        """Improve a plan, one stage ahead."""
        passes = 0
        for i, (mu, most) in enumerate(options.WARM_STARTS):
            self.begin_shift(mu, plan)
            self.iterate(1, deadline_s)
            if i > 0 or not self._is_far():
                self.iterate(most, deadline_s)
            passes += self._passes
            if options.is_converged(self._flag, self.progress.residual) or (
                    self._flag == options.OUT_OF_TIME):
                return passes
        return -passes

    def _is_far(self) -> bool:
        return self._decrease >= (options.FAR_DECREASE * abs(self._cost)
                                  + options.BARRIER_READY * self._mu)

    def set_body(self, inertia: Array, torque: Array) -> None:
        """Set the body that the loop is closed with."""
        self._at(f.BODY)[:] = np.concatenate([inertia.ravel(), torque])

    def state(self) -> Array:
        """Return the state (12,)."""
        measured = self._at(f.MEASURED)
        return np.concatenate([measured[:9], measured[18:]])

    def advance(self, torque: Array) -> None:
        """Move the state on by one step."""
        self._at(f.APPLIED)[:] = torque
        self._run('plant')

    def follow(self, plan: Plan, course: Course, recording: Recording, first: int) -> int:
        """Close the loop as driver.c does."""
        for tick in range(first, course.ticks):
            self._run('measure')
            passes = self.improve(plan)
            if passes < 0:
                return tick
            report = self.report(self._plan)
            near = self._at(f.MEASURE)[2] < course.near_rad
            slack = course.promise * max(abs(course.promised), course.least_promise)
            if (report.terminal_violation > course.violation
                    or report.rate_violation > course.violation
                    or not (near or self._cost <= course.promised + slack)):
                return tick
            self.keep(plan)
            recording.record(tick, self.state(), plan, report, passes)
            course.promised = self._cost - report.first_cost
            self.advance(plan.torques[0])
        return int(course.ticks)

    @property
    def progress(self) -> Progress:
        """How far the solve is."""
        return Progress(self._cost, max(self._stationarity, self._products), self._flag,
                        self._passes)

    @property
    def elapsed_s(self) -> float:
        """Time that starts and passes have taken so far [s]."""
        return self._elapsed_s

    def new_plan(self) -> InterpretedPlan:
        """Return memory for a plan."""
        return InterpretedPlan(self.structure, self.horizon)

    def keep(self, plan: Plan) -> None:
        """Copy the trajectory into a plan."""
        assert isinstance(plan, InterpretedPlan)
        for field, values in self._plan.memory.items():
            np.copyto(plan.memory[field], values)
        plan.progress = self.progress

    def report(self, plan: Plan) -> Report:
        """Say what the caller wants to know of a plan."""
        assert isinstance(plan, InterpretedPlan)
        self._run('report', plan)
        return Report(*np.concatenate([self._at(field) for field in (
            f.FIRST_COST, f.FIRST_LEVEL, f.LAST_LEVEL, f.EXCESS, f.MISSED)]).tolist())

    def poses(self) -> Array:
        """Return what the last report wrote about every node."""
        return self._at(f.POSE).copy()
