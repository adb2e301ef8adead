# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The local solver: a trajectory under way in the memory of the compiled library.

One foreign call for each part of a solve, during which other Python threads may go on. Matrices
and vectors are dimensionless (:mod:`manifold_mpc_ros.mpc.scaling`).
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.lanes import aligned, blocks, copied, field_of
from manifold_mpc_ros.mpc.library import Course, Library, LoopRecord, Solve
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program import options
from manifold_mpc_ros.mpc.program.layout import layout_of
from manifold_mpc_ros.mpc.program.phase import Field, Memory, Structure
from manifold_mpc_ros.mpc.scaling import TERMINAL_LEVEL, Scaling
from manifold_mpc_ros.mpc.stages.cone import AIM
from manifold_mpc_ros.mpc.stages.inequalities import (
    cone_inequalities,
    inequalities_of,
    wheel_inequalities,
)
from manifold_mpc_ros.mpc.stages.reference import REFERENCE
from manifold_mpc_ros.mpc.stages.torque_box import ShiftedTorqueBox
from manifold_mpc_ros.mpc.stages.wheel_limits import TOTAL, Wheels

# A slack below this is one of an inequality that holds the plan back.
_TOUCHED = 1e-4


class Progress(NamedTuple):
    """How far a solve is; the cost contains the penalties on violations."""

    cost: float
    residual: float
    flag: int
    passes: int

    @property
    def converged(self) -> bool:
        """Whether it ended where the optimality conditions hold."""
        return self.flag == options.CONVERGED or (
            self.flag == options.STALLED and self.residual < options.ACCEPTABLE_RESIDUAL)


class Report(NamedTuple):
    """Of a plan, dimensionless.

    Cost of its first stage; ``xi^T P xi / c`` of its first and last node; what violations add to
    its cost; the largest relative violation of a node's limits; by how much it misses the terminal
    set, relatively.
    """

    first_cost: float
    first_level: float
    last_level: float
    penalties: float
    violation: float
    terminal_violation: float


class StateReport(NamedTuple):
    """Of a state: whether it can be used, and how hard the turn is.

    Distance of its rotations from SO(3); |J omega|^2; angle left to turn [rad]; angle that it
    takes to stop the body [rad]; for a slew about the axis of the turn, how much the second torque
    component does beside the first (0 to 1), and how many times faster the quickest axis turns.
    """

    defect: float
    momentum_squared: float
    angle_rad: float
    braking_rad: float
    second_torque: float
    weakness: float


#: What is said of a state that is not finite.
UNUSABLE = StateReport(np.inf, np.inf, np.nan, np.nan, np.nan, np.nan)


class Plan:
    """A trajectory that was kept, in blocks of lanes, with how far its solve was."""

    def __init__(self, structure: Structure, horizon: int, lanes: int) -> None:
        """Allocate."""
        self.progress = Progress(float('nan'), float('inf'), options.STALLED, 0)
        self.structure, self.horizon, self._lanes = structure, horizon, lanes
        rows = layout_of(structure).rows(Memory.TRAJECTORY)
        self.memory = aligned(blocks(horizon, lanes) * rows * lanes)
        self.address = self.memory.ctypes.data
        self._torque = field_of(self.memory, structure, f.TORQUE, lanes)

    def field(self, field: Field) -> Array:
        """Return a field (N + 1, size), copied."""
        return copied(field_of(self.memory, self.structure, field, self._lanes), self.horizon)

    @property
    def torques(self) -> Array:
        """Torques (N, 3), dimensionless."""
        return copied(self._torque, self.horizon - 1)


    def delay(self, plan: Plan) -> None:
        """Take a plan with every stage one later: shifted, it begins where that plan does."""
        rows = layout_of(self.structure).rows(Memory.TRAJECTORY)
        mine, other = (each.memory.reshape(-1, rows, self._lanes).transpose(0, 2, 1)
                       for each in (self, plan))
        mine[:] = np.roll(other.reshape(-1, rows), 1, axis=0).reshape(mine.shape)


class LocalSolver:
    """One trajectory under way: start it, iterate it, keep it. Not for two threads at once."""

    def __init__(self, library: Library, structure: Structure, horizon: int,
                 numbers: Mapping[Field, Array]) -> None:
        """Allocate everything that a solve needs; ``numbers`` has the problem's global fields."""
        self.structure, self.horizon = structure, horizon
        self._cones = cone_inequalities(structure)
        self._library, lanes = library, library.lanes
        layout = layout_of(structure)
        self._sides = [Plan(structure, horizon, lanes) for _ in range(2)]
        self._model = aligned(blocks(horizon, lanes) * layout.rows(Memory.MODEL) * lanes)
        self._globals = aligned(layout.rows(Memory.GLOBAL))
        self._poses = field_of(self._model, structure, f.POSE, lanes)
        self._first = {field: layout.first_row(field) for field in layout.fields(Memory.GLOBAL)}
        self._measured, self._state_report = self._first[f.MEASURED], self._first[f.STATE_REPORT]
        self._report = self._first[f.FIRST_COST]
        for field, values in numbers.items():
            self._global(field)[:] = values
        self._start = self._global(f.START)
        self._lean = np.zeros(3)
        self._solve = Solve(
            plan=self._sides[0].address, fresh=self._sides[1].address,
            model=self._model.ctypes.data, g=self._globals.ctypes.data, horizon=horizon)
        self._address = ctypes.byref(self._solve)
        self._lean_address = self._lean.ctypes.data
        library.prepare(self._address)

    def _global(self, field: Field) -> Array:
        """Return a global field, to be written to."""
        first = self._first[field]
        return self._globals[first:first + field.size]

    def set_state(self, R_NB: Array, R_ND: Array, omega: Array) -> StateReport:
        """Set the state from attitude, commanded attitude (3, 3) and dimensionless rate (3,)."""
        g, first = self._globals, self._measured
        g[first:first + 9] = R_NB.ravel()
        g[first + 9:first + 18] = R_ND.ravel()
        g[first + 18:first + 21] = omega
        if not math.isfinite(g[first:first + 21].sum()):
            return UNUSABLE
        self._library.set_state(self._address)
        return StateReport(*g[self._state_report:self._state_report + 6].tolist())

    def set_level(self, level: float) -> None:
        """Set the dimensionless level c of the terminal set."""
        self._global(f.PARAMETER)[TERMINAL_LEVEL] = level

    def set_cones(self, kept: Sequence[Cone], directions_N: Array) -> None:
        """Set the cones that nodes keep, and their directions at every node, (N + 1, n, 3)."""
        for each in self._cones:
            self._global(each.data)[:] = each.numbers_of(kept)
            self._set_nodes(each.direction_N, directions_N[:, each.places(kept)].reshape(
                self.horizon + 1, -1))
        self._set_nodes(AIM, np.tile((1.0, 0.0, 0.0, 0.0), (self.horizon + 1, 1)))

    def set_reference(self, numbers: Array) -> None:
        """Set the reference that costs are about, at every node (N + 1, 14)."""
        self._set_nodes(REFERENCE, numbers)

    def begin_way(self, mu: float, aims: Array) -> None:
        """Start from the slew law towards what it aims at, stage by stage (N + 1, 4)."""
        self._set_nodes(AIM, aims)
        self.begin_slew(mu, np.zeros(3), 0)
        self._set_nodes(AIM, np.tile((1.0, 0.0, 0.0, 0.0), (self.horizon + 1, 1)))

    @property
    def attitude(self) -> Array:
        """The attitude R_DB (3, 3) from which plans start."""
        return so3.rotation_from_quaternion(self._start[:4])

    def touches_cone(self, plan: Plan) -> bool:
        """Return whether a cone holds a plan back at some node."""
        return any(float(plan.field(each.slack)[1:].min()) < _TOUCHED
                   for each in self._cones)

    def _set_nodes(self, field: Field, values: Array) -> None:
        """Write a field of the model at every node (N + 1, size); beyond them the last again."""
        place = field_of(self._model, self.structure, field, self._library.lanes)
        rest = len(place) * place.shape[1] - len(values)
        place[:] = np.pad(values, ((0, rest), (0, 0)), 'edge').reshape(place.shape)

    def flip(self) -> None:
        """Turn the sign of the starting quaternion: the slew goes the other way round."""
        self._start[:4] *= -1.0

    def begin_slew(self, mu: float, lean: Array, lean_steps: int) -> None:
        """Start from the slew law, leaning for the first steps, with barrier parameter mu."""
        self._lean[:] = lean
        self._library.begin_slew(self._address, mu, self._lean_address, lean_steps)

    def begin_shift(self, mu: float, plan: Plan) -> None:
        """Start from a plan, one stage ahead."""
        self._library.begin_shift(self._address, mu, plan.address)

    def iterate(self, most: int, deadline_s: float = np.inf) -> None:
        """Run up to ``most`` passes in all, until it ends or time.monotonic is at the deadline."""
        self._library.iterate(self._address, most, deadline_s)

    def improve(self, plan: Plan, deadline_s: float = np.inf) -> int:
        """Improve a plan, one stage ahead; return the passes, negative when none converged.

        A plan that time has run out for counts as converged.
        """
        usable = self._library.improve(self._address, plan.address, deadline_s)
        passes = int(self._solve.total_passes)
        return passes if usable else -passes

    def disturb(self, disturbance: Array) -> None:
        """Set the dimensionless disturbance torque (3,) that the torque box moves with."""
        for each in inequalities_of(self.structure):
            if isinstance(each, ShiftedTorqueBox):
                self._global(each.data)[3:] = disturbance

    def set_wheels(self, now: Wheels, unit: Scaling) -> None:
        """Set what wheels give and store, and the momentum of body and wheels."""
        self._global(TOTAL)[:] = now.total_D / (unit.torque_n_m * unit.time_s)
        for each in wheel_inequalities(self.structure):
            self._global(each.data)[:] = each.numbers_of(now, unit)

    def set_body(self, inertia: Array, torque: Array) -> None:
        """Set the body that `follow` and `advance` move: inertia (3, 3), disturbance (3,)."""
        self._global(f.BODY)[:] = np.concatenate([inertia.ravel(), torque])

    def state(self) -> Array:
        """Return the state (12,): R_NB row by row and dimensionless rate."""
        measured = self._global(f.MEASURED)
        return np.concatenate([measured[:9], measured[18:]])

    def advance(self, torque: Array) -> None:
        """Move the state on by one step of the body under a torque (3,)."""
        self._global(f.APPLIED)[:] = torque
        self._library.advance(self._address)

    def follow(self, plan: Plan, course: Course, record: LoopRecord, first: int) -> int:
        """Close the loop from tick ``first`` on without Python, ``plan`` kept up to date.

        Return the first tick that needs more than a warm start, or the number of ticks.
        """
        for name in ('states', 'torques', 'costs', 'passes'):
            setattr(course, name, getattr(record, name).ctypes.data)
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

    def new_plan(self) -> Plan:
        """Return memory for a plan."""
        return Plan(self.structure, self.horizon, self._library.lanes)

    def keep(self, plan: Plan) -> None:
        """Copy the trajectory into a plan."""
        side = next(side for side in self._sides if side.address == self._solve.plan)
        np.copyto(plan.memory, side.memory)
        plan.progress = self.progress

    def report(self, plan: Plan) -> Report:
        """Say what the caller of a solve wants to know of a plan."""
        self._library.report(self._address, plan.address)
        return Report(*self._globals[self._report:self._report + 6].tolist())

    def poses(self) -> Array:
        """Return R_NB row by row and dimensionless rate (N + 1, 12) of the plan reported last."""
        return copied(self._poses, self.horizon)
