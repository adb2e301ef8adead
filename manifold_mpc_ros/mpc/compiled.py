# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The compiled controller: its memory, its numbers, and one foreign call from state to answer.

During a call other Python threads may go on. Matrices and vectors are dimensionless
(:mod:`manifold_mpc_ros.mpc.scaling`) where no unit is named. ``answer`` is all that a tick needs;
the parts of a solve can be called one by one, which studies and tests do.
"""

from __future__ import annotations

import ctypes
import math
import struct
from typing import Any

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.library import Controller, Kept, Library, LoopRecord, Solve
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.layout import layout_of
from manifold_mpc_ros.mpc.program.numbers import numbers_beside, numbers_of
from manifold_mpc_ros.mpc.program.options import VIAS
from manifold_mpc_ros.mpc.program.phase import Field, Memory, Structure
from manifold_mpc_ros.mpc.reference import Reference
from manifold_mpc_ros.mpc.reports import Progress, Report, StateReport
from manifold_mpc_ros.mpc.scaling import scaling_of
from manifold_mpc_ros.mpc.search import guard_squared, linear_rad, quickest_rad_s2, starts
from manifold_mpc_ros.terminal.design import TerminalDesign

_ALIGNMENT = 64
# Numbers of an answer before its torques: search.c.
_HEAD = struct.Struct('9d')


class CompiledMpc:
    """The controller of one configuration in C. Not for two threads at once."""

    def __init__(self, library: Library, structure: Structure, config: AttitudeMpcConfig,
                 terminal: TerminalDesign) -> None:
        """Allocate everything that a solve needs, and fill in the problem's numbers."""
        self.structure, self.horizon = structure, config.horizon
        self._library, self._lanes, self._layout = library, library.lanes, layout_of(structure)
        self._plans = [self._stages(Memory.TRAJECTORY) for _ in range(5)]
        self._model = self._stages(Memory.MODEL)
        self._globals = _aligned(self._layout.rows(Memory.GLOBAL))
        for field, values in numbers_of(config, terminal, structure).items():
            self._global(field)[:] = values
        measured = self._global(f.MEASURED)
        self._attitude, self._target = measured[:9].reshape(3, 3), measured[9:18].reshape(3, 3)
        self._rate = measured[18:]
        n = self.horizon
        self._answer = np.zeros(_HEAD.size // 8 + 3 * n + 12 * (n + 1))
        self._head = self._answer.data
        _, torques, attitudes, rates = np.split(
            self._answer, np.cumsum([_HEAD.size // 8, 3 * n, 9 * (n + 1)]))
        self._torques, self._rates = torques.reshape(n, 3), rates.reshape(n + 1, 3)
        self._attitudes = attitudes.reshape(n + 1, 3, 3)
        self._starts, self._ways = starts(config), np.zeros((VIAS, 2))
        self._beside = numbers_beside(config, terminal, structure)
        self._reference = np.zeros(12 * (n + 1))
        self._momentum = np.zeros((2, 0 if config.wheels is None else len(config.wheels)))
        limit = config.max_torque_n_m
        addresses = [each.ctypes.data for each in self._plans]
        unit = scaling_of(config)
        self._controller = Controller(
            solve=Solve(plan=addresses[0], fresh=addresses[1], model=self._model.ctypes.data,
                        g=self._globals.ctypes.data, horizon=self.horizon),
            kept=Kept(addresses[2]), best=Kept(addresses[3]), other=Kept(addresses[4]),
            starts=self._starts.ctypes.data, start_count=len(self._starts),
            answer=self._answer.ctypes.data, ways=self._ways.ctypes.data,
            reference=self._reference.ctypes.data, momentum=self._momentum.ctypes.data,
            **{name: each.ctypes.data for name, each in self._beside.items()},
            time_s=unit.time_s, torque_n_m=unit.torque_n_m, rate_rad_s=unit.rate_rad_s,
            cost=unit.cost, step_s=config.step_s,
            quickest=quickest_rad_s2(config), linear_rad=linear_rad(config),
            guard_squared=guard_squared(config),
            whole_level=terminal.c, wheel_count=self._momentum.shape[1],
            cone_count=len(config.cones),
            torque_limit_n_m=(math.inf,) * 3 if limit is None else tuple(limit.tolist()))
        self._address = ctypes.byref(self._controller)
        library.begin(self._address)

    def _stages(self, memory: Memory) -> Array:
        """Return memory for N + 1 stages in blocks of lanes, one before them and one behind."""
        blocks = -(-(self.horizon + 1) // self._lanes) + 2
        return _aligned(blocks * self._layout.rows(memory) * self._lanes)

    def _global(self, field: Field) -> Array:
        """Return a global field, to be written to."""
        first = self._layout.first_row(field)
        return self._globals[first:first + field.size]

    def _nodes(self, memory: Array, field: Field) -> Array:
        """Return a field as it lies in its memory, (blocks from stage 0 on, lanes, size)."""
        first = self._layout.first_row(field)
        rows = memory.reshape(-1, self._layout.rows(field.memory), self._lanes)
        return rows[1:, first:first + field.size, :].transpose(0, 2, 1)

    # A tick.

    def answer(self, R_NB: Array, omega_BN_B: Array, R_ND: Array, deadline_s: float, *,
               local: bool = False) -> tuple[tuple[Any, ...], Array, Array, Array]:
        """Map attitude (3, 3), rate (3,) [rad/s] and commanded attitude (3, 3) to an answer.

        Status, passes, whether it searched, cost, residual, violation, promised cost, level of the
        state, time of the local solver [s]; and torques (N, 3), R_NB (N + 1, 3, 3) and rates
        (N + 1, 3) of the plan. SI units.
        """
        self._attitude[...], self._rate[...], self._target[...] = R_NB, omega_BN_B, R_ND
        self._library.answer(self._address, deadline_s, local)
        return (_HEAD.unpack_from(self._head), self._torques.copy(), self._attitudes.copy(),
                self._rates.copy())

    def reset(self) -> None:
        """Forget the warm start; the next search is global."""
        self._controller.warm = 0

    def foresee(self, R_ND: Array) -> None:
        """Say which commanded attitude (3, 3) will follow the last one."""
        self._global(f.FORESEEN)[9:] = R_ND.ravel()

    def disturb(self, disturbance_n_m: Array) -> None:
        """Plan under a disturbance torque (3,) [N m]: the torque box moves with it."""
        self._library.disturb(self._address, disturbance_n_m.ctypes.data)

    def set_directions(self, directions_N: Array | None) -> int | None:
        """Set the directions of all cones (N + 1, n, 3), None: those of the configuration.

        Return the cone of which nothing is left between samples then, None when all is well.
        """
        given = None if directions_N is None else directions_N.ctypes.data
        if self._library.set_directions(self._address, given):
            return None
        return self._controller.missing - 1

    def set_reference(self, R_NB: Array, R_ND: Array, reference: Reference | None) -> Array:
        """Plan about a reference, or about R_ND (3, 3) alone; return what is commanded then.

        For pointing that has the roll of the body, R_NB (3, 3).
        """
        self._attitude[...], self._target[...] = R_NB, R_ND
        if reference is not None:
            self._reference[:] = np.concatenate(
                [reference.R_ND.ravel(), reference.omega_DN_D.ravel()])
        self._library.set_reference(self._address, reference is not None)
        return self._target

    def set_momentum(self, momentum_n_m_s: Array, held: bool) -> None:
        """Set the momenta of wheels (n,) [N m s], NaN for one that is not there.

        ``held``: plans keep to what wheels give whose null space rests.
        """
        self._momentum[0], self._controller.held = momentum_n_m_s, int(held)

    @property
    def momentum_n_m_s(self) -> Array:
        """The momenta (n,) that are planned with."""
        return self._momentum[1]

    @property
    def limits_used(self) -> float:
        """The largest part of a torque or rate limit that disturbance and reference use."""
        return float(self._controller.limits_used)

    @property
    def share(self) -> float:
        """The part of the terminal level that disturbance, reference and wheels leave."""
        return float(self._controller.share)

    def moved_on(self, R_NB: Array, omega_BN_B: Array, torque_B_n_m: Array, seconds: float
                 ) -> tuple[Array, Array] | None:
        """Return attitude and rate after a torque (3,) [N m]; None where no step is guaranteed.

        In SI units, and unlike all else here for any thread at any time.
        """
        state, torque = np.concatenate([R_NB.ravel(), omega_BN_B]), np.array(torque_B_n_m)
        moved = self._library.move_on(
            self._address, state.ctypes.data, torque.ctypes.data, seconds)
        return (state[:9].reshape(3, 3), state[9:]) if moved else None

    # A closed loop on the model.

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

    def follow(self, record: LoopRecord, first: int) -> int:
        """Close the loop from tick ``first`` on; return the first tick that needs a search."""
        return self._library.follow(self._address, ctypes.byref(record), first)

    # The parts of a solve.

    @property
    def starts(self) -> Array:
        """The starts of the search (n, 4), in their order."""
        return self._starts

    def set_state(self, R_NB: Array, R_ND: Array, omega: Array) -> StateReport | None:
        """Set a state of dimensionless rate (3,); None where it cannot be predicted from."""
        self._attitude[:], self._rate[:], self._target[:] = R_NB, omega, R_ND
        usable = self._library.set_state(self._address)
        return StateReport(*self._global(f.STATE_REPORT).tolist()) if usable else None

    @property
    def slew_steps(self) -> float:
        """How many steps a bang-bang slew from the state takes, by torque limits alone."""
        return self._library.slew_steps(self._address)

    def use_set(self, with_set: bool) -> None:
        """Solve with the terminal set, or without."""
        self._library.use_set(self._address, with_set)

    def begin(self, start: Array, steps: float) -> None:
        """Begin a cold start (4,) of a slew of so many steps."""
        self._library.begin_start(self._address, start.ctypes.data, steps)

    def begin_slew(self, mu: float) -> None:
        """Begin with the slew law, the short way, with barrier parameter mu."""
        self._library.begin_slew(self._address, mu)

    def begin_way(self, by: Array) -> None:
        """Begin a start by way of an attitude, its quaternion (4,) in the target's axes."""
        self._library.begin_way(self._address, by.ctypes.data)

    def iterate(self, most: int) -> None:
        """Run up to ``most`` passes in all, until it ends."""
        self._library.iterate(self._address, most, math.inf)

    @property
    def progress(self) -> Progress:
        """How far the solve is."""
        s = self._controller.solve
        return Progress(s.cost, max(s.stationarity, s.products), s.flag, s.passes)

    def field(self, field: Field) -> Array:
        """Return a field (N + 1, size) of the trajectory under way, or of its model."""
        memory = self._model if field.memory is Memory.MODEL else next(
            each for each in self._plans if each.ctypes.data == self._controller.solve.plan)
        return self._nodes(memory, field).reshape(-1, field.size)[:self.horizon + 1]

    def report(self) -> Report:
        """Say what the caller of a solve wants to know of the trajectory under way."""
        self._library.report(self._address)
        first = self._layout.first_row(f.FIRST_COST)
        return Report(*self._globals[first:first + 6].tolist())

    def poses(self) -> Array:
        """Return R_NB row by row and dimensionless rate (N + 1, 12) of what was reported last."""
        return self._nodes(self._model, f.POSE).reshape(-1, 12)[:self.horizon + 1]


def _aligned(size: int) -> Array:
    """Return zeros that begin at a multiple of the alignment."""
    raw = np.zeros(size + _ALIGNMENT // 8)
    skip = -raw.ctypes.data % _ALIGNMENT // 8
    return raw[skip:skip + size]
