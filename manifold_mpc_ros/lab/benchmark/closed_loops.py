# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Many closed loops at once by `BatchMpc`, on every core: how long they take, how they end."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from manifold_mpc_ros.lab.batch.batch_mpc import BatchCourse, BatchMpc
from manifold_mpc_ros.lab.benchmark.peers.problem import (
    MAX_RATE_RAD_S,
    MAX_TORQUE_N_M,
    comparison_config,
)
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

SEED = 0
LARGEST_RATE_RAD_S = 0.2
#: Loops that are in memory at once.
_BLOCK = 1000
#: A loop that ends within this of rest at the setpoint has settled.
SETTLED_RAD, SETTLED_RAD_S = np.radians(0.1), 1e-3


def close_loops(count: int, ticks: int, horizon: int, say: Callable[[str], None]
                ) -> dict[str, Any]:
    """Close loops from random attitudes and rates on all cores; return what came of them."""
    begun_s = time.perf_counter()
    batch = BatchMpc(comparison_config(horizon))
    built_s = time.perf_counter() - begun_s
    rng = np.random.default_rng(SEED)
    R_NB = so3.random_rotations(rng, count)
    omega_BN_B = rng.uniform(-LARGEST_RATE_RAD_S, LARGEST_RATE_RAD_S, (count, 3))
    parts, elapsed_s = [], 0.0
    for begin in range(0, count, _BLOCK):
        chosen = slice(begin, begin + _BLOCK)
        begun_s = time.perf_counter()
        course = batch.simulate(R_NB[chosen], omega_BN_B[chosen], ticks)
        elapsed_s += time.perf_counter() - begun_s
        parts.append(_ends(course))
        say(f'{min(begin + _BLOCK, count)} of {count} loops, {elapsed_s:.1f} s')
    return {'loops': count, 'ticks': ticks, 'horizon': horizon, 'threads': batch.threads,
            'backend': batch.backend, 'build_s': built_s, 'elapsed_s': elapsed_s,
            'solves_per_s': count * ticks / elapsed_s, **_joined(parts)}


def _ends(course: BatchCourse) -> dict[str, Array]:
    """Return, for each loop, how it ended and what it took."""
    torque, rate = np.abs(course.torque_B_n_m), np.abs(course.omega_BN_B[:, 1:])
    settled = (so3.angle(course.R_NB[:, -1]) < SETTLED_RAD) & (
        np.linalg.norm(course.omega_BN_B[:, -1], axis=1) < SETTLED_RAD_S)
    return {'settled': settled, 'passes': course.passes.sum(axis=1),
            'searches': course.searches, 'infeasible': course.infeasible,
            'torque_over': torque.max(axis=(1, 2)) - MAX_TORQUE_N_M,
            'rate_over': rate.max(axis=(1, 2)) - MAX_RATE_RAD_S}


def _joined(parts: Sequence[dict[str, Array]]) -> dict[str, Any]:
    """Return the figures of all loops."""
    all_of = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    return {
        'not_settled': int(np.sum(~all_of['settled'])),
        'passes': int(all_of['passes'].sum()), 'searches': int(all_of['searches'].sum()),
        'solves_without_a_feasible_plan': int(all_of['infeasible'].sum()),
        'most_over_torque_limit_n_m': float(all_of['torque_over'].max()),
        'most_over_rate_limit_rad_s': float(all_of['rate_over'].max())}
