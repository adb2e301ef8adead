# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Closed loops at the speed of the compiled solver, on a body that steps as the model does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.control.moving.slew_profile import SlewPlanner
from manifold_mpc_ros.control.target import FixedTarget
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.library import LoopRecord
from manifold_mpc_ros.mpc.reference import Reference
from manifold_mpc_ros.mpc.solution import SolveStatus


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
                   disturbance_B_n_m: ArrayLike | None = None,
                   slews: SlewPlanner | None = None) -> ModelLoop:
        """Close the loop from a cold start to the identity; the ticks are those of `solve`.

        The body steps by the LGVI with the controller's step and forcing. It may have an inertia
        (3, 3) of its own and a constant disturbance torque (3,) in body axes. ``slews`` puts
        profiles in the place of the identity; while one is followed, ticks run in Python.
        """
        unit, passes = self._unit, np.zeros(ticks, dtype=np.int_)
        states, torques, costs = np.zeros((ticks, 12)), np.zeros((ticks, 3)), np.zeros(ticks)
        record = LoopRecord(*(each.ctypes.data for each in (states, torques, costs, passes)),
                            ticks)
        self._set_body(inertia_kg_m2, disturbance_B_n_m)
        self.reset()
        R, omega = np.asarray(R_NB, dtype=float), np.asarray(omega_BN_B, dtype=float)
        tick, searches, exceptions = 0, 0, []
        while tick < ticks:
            reference = self.profile(slews, R, omega, tick)
            solution = self.solve(R, omega, reference=reference)
            searches += solution.searched
            if solution.status != SolveStatus.CONVERGED:
                exceptions.append(solution.status)
            states[tick] = np.concatenate([R.ravel(), omega * unit.time_s])
            torques[tick] = solution.torque_B_n_m / unit.torque_n_m
            costs[tick], passes[tick] = solution.cost / unit.cost, solution.iterations
            self.solver.advance(torques[tick])
            tick += 1
            if reference is None:
                tick = self.solver.follow(record, tick)
            state = self.solver.state()
            R, omega = state[:9].reshape(3, 3), state[9:] * unit.rate_rad_s
        return ModelLoop(
            states[:, :9].reshape(-1, 3, 3), states[:, 9:] * unit.rate_rad_s,
            torques * unit.torque_n_m, costs * unit.cost, passes,
            searches, tuple(exceptions))

    def profile(self, slews: SlewPlanner | None, R: Array, omega: Array, tick: int
                 ) -> Reference | None:
        """Return the profile to follow at a tick, None while the identity is aimed at."""
        config = self.config
        time_ns = round(tick * config.step_s * NANOSECONDS)
        if slews is None:
            return None
        return slews.target(FixedTarget(np.eye(3)), (R, omega), time_ns, {}).over_horizon(
            time_ns, config.step_s, config.horizon)

    def _set_body(self, inertia_kg_m2: ArrayLike | None, disturbance_B_n_m: ArrayLike | None
                  ) -> None:
        """Hand the body to the solver, the model where nothing else is said."""
        unit = self._unit
        inertia = self.config.inertia_kg_m2 if inertia_kg_m2 is None else inertia_kg_m2
        disturbance = np.zeros(3) if disturbance_B_n_m is None else disturbance_B_n_m
        self.solver.set_body(
            np.asarray(inertia, dtype=float) / (unit.torque_n_m * unit.time_s ** 2),
            np.asarray(disturbance, dtype=float) / unit.torque_n_m)
