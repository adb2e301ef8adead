# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Many states, and many configurations of one shape, on all cores: plans and closed loops.

Threads share the work: the compiled solver runs without Python's lock. Every case gets the answer
that it would get alone, whatever the number of threads.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.batch.model_loop import LoopingMpc
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus

# Cases that a thread takes at a time.
_CHUNK = 50


@dataclass(frozen=True)
class BatchCourse:
    """Closed loops of T ticks: what each measured and commanded, case by case.

    ``R_NB`` (B, T, 3, 3), ``omega_BN_B`` (B, T, 3) [rad/s], ``torque_B_n_m`` (B, T, 3), ``cost``
    (B, T) the values of the plans, ``passes`` (B, T), ``searches`` (B,) the ticks that searched
    globally, ``infeasible`` (B,) those whose status was 'infeasible' or 'failed'.
    """

    R_NB: Array
    omega_BN_B: Array
    torque_B_n_m: Array
    cost: Array
    passes: NDArray[np.int_]
    searches: NDArray[np.int_]
    infeasible: NDArray[np.int_]


class BatchMpc:
    """One controller per thread for many states, or one per case for many configurations.

    Arguments
    ---------
    configs
        One configuration for all states, or one per state. They share one horizon, forcing, target
        and set of limits.
    threads
        How many work at once; all cores when None.
    backend, cache_dir
        As in `AttitudeMpc`.

    """

    def __init__(self, configs: AttitudeMpcConfig | Sequence[AttitudeMpcConfig], *,
                 threads: int | None = None, backend: str = 'auto',
                 cache_dir: str | Path | None = None) -> None:
        """Design and build; raises what `AttitudeMpc` raises."""
        self.threads = threads or os.cpu_count() or 1
        if isinstance(configs, AttitudeMpcConfig):
            first = LoopingMpc(configs, backend=backend, cache_dir=cache_dir)
            self._shared = [first, *(LoopingMpc(
                configs, backend=backend, cache_dir=cache_dir, terminal=first.terminal)
                for _ in range(self.threads - 1))]
            self._own: list[LoopingMpc] | None = None
        else:
            self._shared = []
            self._own = [LoopingMpc(config, backend=backend, cache_dir=cache_dir)
                         for config in configs]
        self.backend = (self._own or self._shared)[0].backend

    def solve(self, R_NB: ArrayLike, omega_BN_B: ArrayLike) -> list[AttitudeMpcSolution]:
        """Map states (B, 3, 3) and (B, 3) [rad/s] to the plans that the global search finds."""
        R, omega = self._states(R_NB, omega_BN_B)

        def solve(mpc: LoopingMpc, case: int) -> AttitudeMpcSolution:
            mpc.reset()
            return mpc.solve(R[case], omega[case])
        return self._map(solve, len(R))

    def simulate(self, R_NB: ArrayLike, omega_BN_B: ArrayLike, ticks: int, *,
                 inertia_kg_m2: ArrayLike | None = None,
                 disturbance_B_n_m: ArrayLike | None = None) -> BatchCourse:
        """Close the loop from states (B, 3, 3) and (B, 3) [rad/s] to the identity.

        The body steps by the LGVI with the controller's step and forcing. ``inertia_kg_m2`` (3, 3)
        or (B, 3, 3) is its own inertia (the controller's when None), ``disturbance_B_n_m`` (3,) or
        (B, 3) a constant torque in body axes.
        """
        R, omega = self._states(R_NB, omega_BN_B)
        n = len(R)
        inertia = None if inertia_kg_m2 is None else np.broadcast_to(
            np.asarray(inertia_kg_m2, dtype=float), (n, 3, 3))
        disturbance = np.broadcast_to(
            np.asarray(0.0 if disturbance_B_n_m is None else disturbance_B_n_m, dtype=float),
            (n, 3))
        course = BatchCourse(
            np.zeros((n, ticks, 3, 3)), np.zeros((n, ticks, 3)), np.zeros((n, ticks, 3)),
            np.zeros((n, ticks)), np.zeros((n, ticks), dtype=np.int_),
            np.zeros(n, dtype=np.int_), np.zeros(n, dtype=np.int_))

        def simulate(mpc: LoopingMpc, case: int) -> None:
            loop = mpc.close_loop(
                R[case], omega[case], ticks, disturbance_B_n_m=disturbance[case],
                inertia_kg_m2=None if inertia is None else inertia[case])
            course.R_NB[case], course.omega_BN_B[case] = loop.R_NB, loop.omega_BN_B
            course.torque_B_n_m[case], course.cost[case] = loop.torque_B_n_m, loop.cost
            course.passes[case] = loop.passes
            course.searches[case] = loop.searches
            course.infeasible[case] = sum(
                status in (SolveStatus.INFEASIBLE, SolveStatus.FAILED)
                for status in loop.exceptions)
        self._map(simulate, n)
        return course

    def _states(self, R_NB: ArrayLike, omega_BN_B: ArrayLike) -> tuple[Array, Array]:
        """Return states as arrays (B, 3, 3), (B, 3)."""
        R, omega = np.asarray(R_NB, dtype=float), np.asarray(omega_BN_B, dtype=float)
        wanted = None if self._own is None else len(self._own)
        if R.ndim != 3 or R.shape[1:] != (3, 3) or (wanted is not None and len(R) != wanted):
            count = 'B' if wanted is None else wanted
            raise ConfigurationError('R_NB', R.shape, f'an array of shape ({count}, 3, 3)')
        if omega.shape != (len(R), 3):
            raise ConfigurationError('omega_BN_B', omega.shape, f'shape ({len(R)}, 3)')
        return R, omega

    def _map(self, function: Callable[[LoopingMpc, int], object], cases: int) -> list[Any]:
        """Run a function of (controller, case) over all cases; results in their order."""
        chunks = [range(begin, min(begin + _CHUNK, cases)) for begin in range(0, cases, _CHUNK)]
        free = list(self._shared) if self._own is None else []

        def run(chunk: range) -> list[Any]:
            if self._own is not None:
                return [function(self._own[case], case) for case in chunk]
            mpc = free.pop()
            try:
                return [function(mpc, case) for case in chunk]
            finally:
                free.append(mpc)
        with ThreadPoolExecutor(self.threads) as pool:
            return [result for results in pool.map(run, chunks) for result in results]
