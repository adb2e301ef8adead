# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Our solver as one of the compared ones."""

from __future__ import annotations

import time

import numpy as np

from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lab.benchmark.peers.problem import comparison_config
from manifold_mpc_ros.lab.benchmark.peers.solver import Answer
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus


class Ours:
    """`AttitudeMpc`: cold by the global search, or by one local solve from the short-way slew."""

    def __init__(self, horizon: int, *, search: bool) -> None:
        """Build the solver; raises SolverBuildError where a compiler is needed and missing."""
        self.config = comparison_config(horizon)
        self._mpc = AttitudeMpc(self.config)
        self._search = search

    def cold(self, state: Array) -> Answer:
        """Forget the warm start and solve."""
        R_NB = so3.rotation_from_quaternion(state[:4])
        begin = time.perf_counter()
        if self._search:
            self._mpc.reset()
            solution = self._mpc.solve(R_NB, state[4:])
        else:
            solution = self._mpc.solve_local(R_NB, state[4:])
        return _answer(solution, time.perf_counter() - begin)

    def warm(self, state: Array) -> Answer:
        """Solve from the shifted plan, searching only when the solver's own rule says so."""
        R_NB = so3.rotation_from_quaternion(state[:4])
        begin = time.perf_counter()
        solution = self._mpc.solve(R_NB, state[4:])
        return _answer(solution, time.perf_counter() - begin)

    def advance(self, state: Array, torque_n_m: Array) -> Array:
        """Return the next state (7,) of the LGVI."""
        config = self.config
        R_NB, omega = lgvi_step(
            so3.rotation_from_quaternion(state[:4]), state[4:], torque_n_m,
            inertia_kg_m2=config.inertia_kg_m2, step_s=config.step_s)
        return np.concatenate([so3.quaternion_from_rotation(R_NB), omega])


def _answer(solution: AttitudeMpcSolution, call_s: float) -> Answer:
    """Return a solution in the terms of the comparison."""
    return Answer(solution.local_time_s, call_s, solution.torques_B_n_m, solution.cost,
                  solution.iterations, solution.status is SolveStatus.CONVERGED)
