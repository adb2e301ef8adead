# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a call of `AttitudeMpc.solve` costs beside the time of the solver in it.

    python benchmarks/calls.py --output docs/results/calls.json

Closed loops from random states of the comparison's problem (docs/performance.md): a cold search,
the least of five, then warm ticks, each once. Medians [us], and of the quotient tick by tick.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

from manifold_mpc_ros import AttitudeMpc
from manifold_mpc_ros.lab.benchmark.peers.problem import comparison_config
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

HORIZONS = (10, 20, 40)
LOOPS, TICKS, REPEATS = 100, 20, 5


def timed(mpc: AttitudeMpc, R: Array, omega: Array) -> tuple[tuple[float, float], Array, Array]:
    """Solve; return the time of the call and of the solver in it [s], and the next state."""
    begin = time.perf_counter()
    plan = mpc.solve(R, omega)
    return ((time.perf_counter() - begin, plan.local_time_s), plan.R_NB[1], plan.omega_BN_B[1])


def summary(pairs: list[tuple[float, float]]) -> dict[str, float]:
    """Return medians of calls and solvers [us], and of their quotient."""
    call, solver = 1e6 * np.array(pairs).T
    return {'call_us': round(float(np.median(call)), 2),
            'solver_us': round(float(np.median(solver)), 2),
            'quotient': round(float(np.median(call / solver)), 3)}


def main() -> int:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', 1)[0])
    parser.add_argument('--output', type=Path, required=True, metavar='FILE')
    arguments = parser.parse_args()
    rows = {}
    for horizon in HORIZONS:
        mpc, rng = AttitudeMpc(comparison_config(horizon)), np.random.default_rng(0)
        warm, cold = [], []
        for _ in range(LOOPS):
            R, omega = so3.random_rotations(rng, 1)[0], rng.uniform(-0.2, 0.2, 3)
            tries = []
            for _ in range(REPEATS):
                mpc.reset()
                tries.append(timed(mpc, R, omega))
            times, R, omega = min(tries, key=lambda each: each[0])
            cold.append(times)
            for _ in range(TICKS):
                times, R, omega = timed(mpc, R, omega)
                warm.append(times)
        rows[f'N = {horizon}'] = {'warm': summary(warm), 'cold': summary(cold)}
        print(horizon, rows[f'N = {horizon}'])
    arguments.output.write_text(json.dumps(rows, indent=2) + '\n', encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
