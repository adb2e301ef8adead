# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The local solver as compiled C: one foreign call per solve, during which Python may go on."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from manifold_mpc_ros.errors import SolverBuildError
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
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.layout import first_row, rows_of
from manifold_mpc_ros.mpc.program.phase import Field, Memory
from manifold_mpc_ros.mpc.program.structure import Structure
from manifold_mpc_ros.mpc.scaling import Array

_ALIGNMENT = 64
_MEASURED, _MEASURE = first_row(f.MEASURED), first_row(f.MEASURE)
_BODY, _APPLIED = first_row(f.BODY), first_row(f.APPLIED)
_START, _REPORT = first_row(f.START), first_row(f.FIRST_COST)


class _Solve(ctypes.Structure):
    """The struct ``solve`` of driver.c."""

    _fields_ = [(name, kind) for kind, names in (
        (ctypes.c_void_p, 'plan fresh model g'),
        (ctypes.c_double, 'cost logs mu exact stationarity products decrease elapsed_s'),
        (ctypes.c_long, 'horizon flag passes total_passes')) for name in names.split()]


class Library:
    """The functions of a compiled solver (driver.c), as attributes of their names."""

    prepare: Callable[..., int]
    measure: Callable[..., int]
    begin_slew: Callable[..., int]
    begin_shift: Callable[..., int]
    iterate: Callable[..., int]
    improve: Callable[..., int]
    report: Callable[..., int]
    advance: Callable[..., int]
    follow: Callable[..., int]

    def __init__(self, path: Path) -> None:
        """Load it; raises SolverBuildError when it cannot be loaded."""
        pointer, double, integer = ctypes.c_void_p, ctypes.c_double, ctypes.c_long
        signatures: dict[str, tuple[Any, ...]] = {
            'prepare': (), 'measure': (), 'begin_slew': (double, pointer, integer),
            'begin_shift': (double, pointer), 'iterate': (integer, double),
            'improve': (pointer, double), 'report': (pointer,), 'advance': (),
            'follow': (pointer, pointer, integer)}
        try:
            library = ctypes.CDLL(str(path))
            self.lanes = int(library.mpc_lane_count())
            for name, arguments in signatures.items():
                function = getattr(library, f'mpc_{name}')
                function.argtypes, function.restype = (pointer, *arguments), integer
                setattr(self, name, function)
        except (OSError, AttributeError) as error:
            raise SolverBuildError(f'cannot load the compiled solver {path}: {error}') from error


def _aligned(size: int) -> Array:
    """Return zeros that begin at a multiple of the alignment."""
    raw = np.zeros(size + _ALIGNMENT // 8)
    skip = -raw.ctypes.data % _ALIGNMENT // 8
    return raw[skip:skip + size]


class NativePlan(Plan):
    """A trajectory in blocks of lanes."""

    def __init__(self, structure: Structure, horizon: int, lanes: int) -> None:
        """Allocate."""
        super().__init__(structure, horizon)
        self._lanes = lanes
        self.memory = _aligned(blocks(horizon, lanes) * rows_of(Memory.TRAJECTORY) * lanes)
        self.address = self.memory.ctypes.data

    def field(self, field: Field) -> Array:
        """Return a field (N + 1, size), copied."""
        return rows_per_stage(self.memory, field, self.horizon, self._lanes)


def rows_per_stage(memory: Array, field: Field, horizon: int, lanes: int) -> Array:
    """Copy a field (N + 1, size) out of its memory."""
    first = first_row(field)
    rows = memory.reshape(-1, rows_of(field.memory), lanes)
    values = rows[1:, first:first + field.size, :].transpose(0, 2, 1)
    return values.reshape(-1, field.size)[:horizon + 1]


def blocks(horizon: int, lanes: int) -> int:
    """Return how many blocks of lanes hold N + 1 stages, one before them and one behind."""
    return -(-(horizon + 1) // lanes) + 2


class NativeSolver(LocalSolver):
    """The compiled solver with memory of its own."""

    def __init__(self, library: Library, structure: Structure, horizon: int, parameters: Array
                 ) -> None:
        """Allocate everything that a solve needs."""
        super().__init__(structure, horizon)
        self._library, lanes = library, library.lanes
        self._sides = [NativePlan(structure, horizon, lanes) for _ in range(2)]
        self._model = _aligned(blocks(horizon, lanes) * rows_of(Memory.MODEL) * lanes)
        self._globals = _aligned(rows_of(Memory.GLOBAL))
        first = first_row(f.PARAMETER)
        self._globals[first:first + len(parameters)] = parameters
        self._lean = np.zeros(3)
        self._solve = _Solve(
            plan=self._sides[0].address, fresh=self._sides[1].address,
            model=self._model.ctypes.data, g=self._globals.ctypes.data, horizon=horizon)
        self._address = ctypes.byref(self._solve)
        self._lean_address = self._lean.ctypes.data
        library.prepare(self._address)

    def measure(self, R_NB: Array, R_ND: Array, omega: Array) -> Measure:
        """Set the state."""
        g = self._globals
        g[_MEASURED:_MEASURED + 9] = R_NB.ravel()
        g[_MEASURED + 9:_MEASURED + 18] = R_ND.ravel()
        g[_MEASURED + 18:_MEASURED + 21] = omega
        if not math.isfinite(g[_MEASURED:_MEASURED + 21].sum()):
            return UNUSABLE
        self._library.measure(self._address)
        return Measure(*g[_MEASURE:_MEASURE + 6].tolist())

    def flip(self) -> None:
        """Turn the sign of the starting quaternion."""
        self._globals[_START:_START + 4] *= -1.0

    def begin_slew(self, mu: float, lean: Array, lean_steps: int) -> None:
        """Start from the slew law."""
        self._lean[:] = lean
        self._library.begin_slew(self._address, mu, self._lean_address, lean_steps)

    def begin_shift(self, mu: float, plan: Plan) -> None:
        """Start from a plan, one stage ahead."""
        assert isinstance(plan, NativePlan)
        self._library.begin_shift(self._address, mu, plan.address)

    def iterate(self, most: int, deadline_s: float = np.inf) -> None:
        """Run passes."""
        self._library.iterate(self._address, most, deadline_s)

    def improve(self, plan: Plan, deadline_s: float = np.inf) -> int:
        """Improve a plan, one stage ahead."""
        assert isinstance(plan, NativePlan)
        usable = self._library.improve(self._address, plan.address, deadline_s)
        passes = int(self._solve.total_passes)
        return passes if usable else -passes

    def set_body(self, inertia: Array, torque: Array) -> None:
        """Set the body that the loop is closed with."""
        self._globals[_BODY:_BODY + 12] = np.concatenate([inertia.ravel(), torque])

    def state(self) -> Array:
        """Return the state (12,)."""
        g = self._globals
        return np.concatenate([g[_MEASURED:_MEASURED + 9], g[_MEASURED + 18:_MEASURED + 21]])

    def advance(self, torque: Array) -> None:
        """Move the state on by one step."""
        self._globals[_APPLIED:_APPLIED + 3] = torque
        self._library.advance(self._address)

    def follow(self, plan: Plan, course: Course, recording: Recording, first: int) -> int:
        """Close the loop without a word of Python."""
        assert isinstance(plan, NativePlan)
        for name in ('states', 'torques', 'costs', 'passes'):
            setattr(course, name, getattr(recording, name).ctypes.data)
        return int(self._library.follow(
            self._address, plan.address, ctypes.byref(course), first))

    @property
    def progress(self) -> Progress:
        """How far the solve is."""
        s = self._solve
        return Progress(s.cost, max(s.stationarity, s.products), s.flag, s.passes)

    @property
    def elapsed_s(self) -> float:
        """Time that starts and passes have taken so far [s]."""
        return float(self._solve.elapsed_s)

    def new_plan(self) -> NativePlan:
        """Return memory for a plan."""
        return NativePlan(self.structure, self.horizon, self._library.lanes)

    def keep(self, plan: Plan) -> None:
        """Copy the trajectory into a plan."""
        assert isinstance(plan, NativePlan)
        side = next(side for side in self._sides if side.address == self._solve.plan)
        np.copyto(plan.memory, side.memory)
        plan.progress = self.progress

    def report(self, plan: Plan) -> Report:
        """Say what the caller wants to know of a plan."""
        assert isinstance(plan, NativePlan)
        self._library.report(self._address, plan.address)
        return Report(*self._globals[_REPORT:_REPORT + 6].tolist())

    def poses(self) -> Array:
        """Return what the last report wrote about every node."""
        return rows_per_stage(self._model, f.POSE, self.horizon, self._library.lanes)
