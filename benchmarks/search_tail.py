# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How many passes a search takes at most, and what its rules cost: both forcings, N = 5 to 500.

    python benchmarks/search_tail.py --output docs/results/search_tail.json      # some minutes

The problem and the instances are those of `manifold-mpc bench`; above N = 40 the first 20 random
ones and the half turns. Every search is compared with all of its starts, each run to its end: a
plan is dearer when its cost is above the least of theirs by more than 1e-6. Local solves, one
start each, count as well: how many do not converge, and the most passes of one. Passes do not
depend on the machine's load, as times do. Exit status 1 when a solve does not converge or a plan
is dearer.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from manifold_mpc_ros import AttitudeMpc, SolveStatus
from manifold_mpc_ros.lab.benchmark.peers.instances import Instance, draw
from manifold_mpc_ros.lab.benchmark.peers.problem import comparison_config
from manifold_mpc_ros.mpc.program.options import MOST_PASSES
from manifold_mpc_ros.mpc.scaling import scaling_of

HORIZONS, LONG_HORIZONS = (5, 10, 20, 40), (80, 160, 300, 500)
INSTANCES, LONG_INSTANCES = 200, 20
TOLERANCE = 1e-6


def least_cost(mpc: AttitudeMpc, instance: Instance) -> float:
    """Return the least cost of all starts, each run to its end."""
    solver, unit = mpc.solver, scaling_of(mpc.config)
    solver.set_state(instance.R_NB, np.eye(3), np.array(instance.omega_BN_B) * unit.time_s)
    solver.use_set(False)
    least, steps = np.inf, solver.slew_steps
    for start in solver.starts:
        solver.begin(start, steps)
        solver.iterate(MOST_PASSES)
        least = min(least, solver.progress.cost)
    return least * unit.cost


def row_of(forcing: str, horizon: int, instances: Sequence[Instance]) -> dict[str, Any]:
    """Return the figures of one forcing and horizon."""
    mpc = AttitudeMpc(replace(comparison_config(horizon), forcing=forcing))
    passes, local, excess, unconverged, local_unconverged = [], [], [], 0, 0
    for instance in instances:
        R, omega = instance.R_NB, np.array(instance.omega_BN_B)
        mpc.reset()
        plan = mpc.solve(R, omega)
        short = mpc.solve_local(R, omega)
        passes.append(plan.iterations)
        local.append(short.iterations)
        unconverged += plan.status is not SolveStatus.CONVERGED
        local_unconverged += short.status is not SolveStatus.CONVERGED
        excess.append(plan.cost / least_cost(mpc, instance) - 1.0)
    return {'forcing': forcing, 'horizon': horizon, 'instances': len(instances),
            'passes_median': float(np.median(passes)),
            'passes_p99': float(np.percentile(passes, 99)), 'passes_most': max(passes),
            'not_converged': unconverged, 'dearer': int(np.sum(np.array(excess) > TOLERANCE)),
            'largest_excess': max(0.0, *excess), 'local_not_converged': local_unconverged,
            'local_passes_most': max(local)}


def main() -> int:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description='passes of searches')
    parser.add_argument('--output', type=Path, help='JSON file')
    arguments = parser.parse_args()
    rows = []
    for forcing in ('symmetric', 'paper'):
        for horizon in (*HORIZONS, *LONG_HORIZONS):
            few = horizon in LONG_HORIZONS
            rows.append(row_of(forcing, horizon, draw(LONG_INSTANCES if few else INSTANCES)))
            print(rows[-1], flush=True)
            if arguments.output:
                arguments.output.write_text(
                    json.dumps({'rows': rows}, indent=1) + '\n', encoding='utf-8')
    return int(any(row['not_converged'] or row['dearer'] or row['local_not_converged']
                   for row in rows))


if __name__ == '__main__':
    raise SystemExit(main())
