# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Closed loops at the speed of the compiled solver, on a body that steps as the model does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.library import Course, LoopRecord
from manifold_mpc_ros.mpc.plan_finder import (
    CONE_ANGLE_RAD,
    LEAST_VALUE,
    SEARCH_ANGLE_RAD,
    VALUE_SLACK,
    VIOLATION,
)
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus


@dataclass(frozen=True)
class ModelLoop:
    """A closed loop of T ticks.

    Measured ``R_NB`` (T, 3, 3) and ``omega_BN_B`` (T, 3) [rad/s], commanded ``torque_B_n_m``
    (T, 3), value ``cost`` (T,) of each plan, solver ``passes`` (T,). ``searches`` counts the ticks
    that searched globally; ``exceptions`` are the statuses other than 'converged'.
    """

    R_NB: Array
    omega_BN_B: Array
    torque_B_n_m: Array
    cost: Array
    passes: NDArray[np.int_]
    searches: int
    exceptions: tuple[SolveStatus, ...]


class LoopingMpc(AttitudeMpc):
    """The controller with a body to control: ticks that need no search run without Python."""

    def close_loop(self, R_NB: ArrayLike, omega_BN_B: ArrayLike, ticks: int, *,
                   inertia_kg_m2: ArrayLike | None = None,
                   disturbance_B_n_m: ArrayLike | None = None) -> ModelLoop:
        """Close the loop from a cold start to the identity; the ticks are those of `solve`.

        The body steps by the LGVI with the controller's step and forcing. It may have an inertia
        (3, 3) of its own and a constant disturbance torque (3,) in body axes.
        """
        record, unit = LoopRecord.of(ticks), self._unit
        self._set_body(inertia_kg_m2, disturbance_B_n_m)
        self.reset()
        R, omega = np.asarray(R_NB, dtype=float), np.asarray(omega_BN_B, dtype=float)
        tick, searches, exceptions = 0, 0, []
        while tick < ticks:
            solution = self.solve(R, omega)
            searches += solution.searched
            if solution.status != SolveStatus.CONVERGED:
                exceptions.append(solution.status)
            self._record(record, tick, R, omega, solution)
            tick = self._follow(record, tick + 1)
            state = self._strict.state()
            R, omega = state[:9].reshape(3, 3), state[9:] * unit.rate_rad_s
        return ModelLoop(
            record.states[:, :9].reshape(-1, 3, 3), record.states[:, 9:] * unit.rate_rad_s,
            record.torques * unit.torque_n_m, record.costs * unit.cost, record.passes,
            searches, tuple(exceptions))

    def _set_body(self, inertia_kg_m2: ArrayLike | None, disturbance_B_n_m: ArrayLike | None
                  ) -> None:
        """Hand the body to the solver, the model where nothing else is said."""
        unit = self._unit
        inertia = self.config.inertia_kg_m2 if inertia_kg_m2 is None else inertia_kg_m2
        disturbance = np.zeros(3) if disturbance_B_n_m is None else disturbance_B_n_m
        self._strict.set_body(
            np.asarray(inertia, dtype=float) / (unit.torque_n_m * unit.time_s ** 2),
            np.asarray(disturbance, dtype=float) / unit.torque_n_m)

    def _record(self, record: LoopRecord, tick: int, R_NB: Array, omega_BN_B: Array,
                solution: AttitudeMpcSolution) -> None:
        """Write one tick and move the body on."""
        unit = self._unit
        record.states[tick] = np.concatenate([R_NB.ravel(), omega_BN_B * unit.time_s])
        record.torques[tick] = solution.torque_B_n_m / unit.torque_n_m
        record.costs[tick] = solution.cost / unit.cost
        record.passes[tick] = solution.iterations
        self._strict.advance(record.torques[tick])

    def _follow(self, record: LoopRecord, tick: int) -> int:
        """Run the ticks that need no search; return the first that does."""
        finder = self._finder
        if not finder.inside or finder.value_bound is None:
            return tick
        near_rad = CONE_ANGLE_RAD if self.config.cones else SEARCH_ANGLE_RAD
        course = Course(near_rad=near_rad, violation=VIOLATION, value_slack=VALUE_SLACK,
                        least_value=LEAST_VALUE, value_bound=finder.value_bound,
                        ticks=len(record.costs))
        tick = self._strict.follow(finder.plan, course, record, tick)
        finder.value_bound = float(course.value_bound)
        return tick
