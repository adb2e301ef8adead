# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compare the search with IPOPT from many starts on an independent formulation.

    python benchmarks/global_minimum.py --output docs/results/global_minimum.json

The thorough form of test/mpc/test_global.py, with its problems and its oracle: half turns at rest
and random attitudes with random rates, from every octant of first torque, both ways round and
from random torques. A plan is worse when its cost is above IPOPT's best by more than 1e-6, and
unconfirmed when IPOPT, started from it, ends at another cost. Exit status 1 when there is
either, or when a plan is called infeasible where IPOPT finds one.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

TESTS = Path(__file__).resolve().parent.parent / 'test'
sys.path[:0] = [str(TESTS), str(TESTS / 'mpc')]

from cases import PROBLEMS, cold, configuration, random_states, rest_states  # noqa: E402
from oracle_starts import starts  # noqa: E402
from strategies import generator  # noqa: E402

from manifold_mpc_ros import AttitudeMpc, SolveStatus  # noqa: E402
from manifold_mpc_ros.lab.benchmark.peers.oracle import Oracle, steps_of  # noqa: E402

TOLERANCE = 1e-6
LARGEST_RATE_RAD_S = 0.4


def compare(mpc: AttitudeMpc, oracle: Oracle, R: np.ndarray, omega: np.ndarray,
            rng: np.random.Generator, randoms: int) -> dict[str, Any]:
    """Return what the controller and the oracle say of one state."""
    plan = cold(mpc).solve(R, omega)
    costs = np.array([oracle.solve(R, omega, steps).cost for steps in starts(
        mpc.config, R, omega, rng, octants=8, randoms=randoms)])
    best = float(costs.min(initial=np.inf))
    steps = steps_of(plan.R_NB, plan.omega_BN_B, mpc.config)
    polished = oracle.solve(R, omega, steps, polish=True).cost
    return {'status': str(plan.status), 'excess': plan.cost / best - 1,
            'unconfirmed': abs(plan.cost / polished - 1), 'best': best,
            'starts': len(costs), 'starts_at_best': int(np.sum(costs <= best * (1 + TOLERANCE))),
            'passes': plan.iterations, 'torque': float(np.abs(plan.torque_B_n_m).max())}


def survey(mpc: AttitudeMpc, states: list[tuple[np.ndarray, np.ndarray]], randoms: int, key: str
           ) -> dict[str, Any]:
    """Return the figures of one problem over many states; infeasible ones are only counted."""
    oracle = Oracle(mpc.config, mpc.terminal.P, mpc.terminal.c)
    rng = generator('global minimum', key)
    rows = [compare(mpc, oracle, R, omega, rng, randoms) for R, omega in states]
    feasible = [row for row in rows if row['status'] != SolveStatus.INFEASIBLE]
    excess = np.array([row['excess'] for row in feasible])
    unconfirmed = np.array([row['unconfirmed'] for row in feasible])
    return {
        'instances': len(rows), 'infeasible': len(rows) - len(feasible),
        'infeasible_but_not_for_ipopt': sum(
            row['status'] == SolveStatus.INFEASIBLE and np.isfinite(row['best'])
            for row in rows),
        'converged': sum(row['status'] == SolveStatus.CONVERGED for row in rows),
        'worse': int(np.sum(excess > TOLERANCE)), 'better': int(np.sum(excess < -TOLERANCE)),
        'unconfirmed': int(np.sum(unconfirmed > TOLERANCE)),
        'largest_excess': float(excess.max()), 'smallest_excess': float(excess.min()),
        'largest_difference_to_polished': float(unconfirmed.max()),
        'smallest_first_torque_n_m': min(row['torque'] for row in feasible),
        'starts_per_instance': float(np.mean([row['starts'] for row in rows])),
        'share_of_starts_at_best': float(
            np.sum([row['starts_at_best'] for row in feasible])
            / np.sum([row['starts'] for row in feasible])),
        'worse_instances': [index for index, row in enumerate(rows)
                            if row['status'] != SolveStatus.INFEASIBLE
                            and row['excess'] > TOLERANCE],
    }


def main() -> int:
    """Run all problems and write the figures."""
    parser = argparse.ArgumentParser(description='compare the search with IPOPT')
    parser.add_argument('--instances', type=int, default=100, help='states of each kind')
    parser.add_argument('--randoms', type=int, default=8, help='random starts of the oracle')
    parser.add_argument('--problems', nargs='+', default=sorted(PROBLEMS), choices=PROBLEMS)
    parser.add_argument('--output', type=Path, help='JSON file')
    arguments = parser.parse_args()
    results: dict[str, Any] = {}
    n = arguments.instances
    for name in arguments.problems:
        mpc = AttitudeMpc(configuration(**PROBLEMS[name]))
        kinds = {'half_turns_at_rest': rest_states(max(0, n - 3)),
                 'random': random_states(f'benchmark {name}', n, LARGEST_RATE_RAD_S)}
        for kind, states in kinds.items():
            row = survey(mpc, states, arguments.randoms, name)
            results.setdefault(name, {})[kind] = row
            print(f'{name:18s} {kind:20s} {row["instances"]:4d} instances, {row["worse"]} worse, '
                  f'{row["better"]} better, {row["unconfirmed"]} unconfirmed, '
                  f'largest excess {row["largest_excess"]:.1e}', flush=True)
    if arguments.output:
        arguments.output.parent.mkdir(parents=True, exist_ok=True)
        arguments.output.write_text(json.dumps(results, indent=1) + '\n', encoding='utf-8')
    rows = [row for kinds in results.values() for row in kinds.values()]
    wrong = ('worse', 'unconfirmed', 'infeasible_but_not_for_ipopt')
    return int(any(row[name] for row in rows for name in wrong))


if __name__ == '__main__':
    raise SystemExit(main())
