# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Run closed loops on the controller's own model; count what the theory forbids.

    python benchmarks/closed_loops.py --output docs/results/closed_loops.json

Random attitudes with random rates, and exact 180 degree attitudes at rest, under the shipped
controller.yaml. Figures of time are this machine's.
"""

from __future__ import annotations

import argparse
import json
import platform
from pathlib import Path
from typing import Any

import numpy as np

from manifold_mpc_ros import AttitudeMpc, AttitudeMpcConfig, SolveStatus, lgvi_step
from manifold_mpc_ros.dynamics.lgvi import step_rotation
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.terminal_level import LocalLoop

# The decrease is violated when V rises above V - L by more than this, relative and absolute.
RELATIVE, ABSOLUTE = 1e-6, 1e-9
SETTLED_RAD, SETTLED_RAD_S = np.radians(0.1), 1e-3


def stage_cost(config: AttitudeMpcConfig, R: np.ndarray, omega: np.ndarray, tau: np.ndarray
               ) -> float:
    """Return L of a state and torque, from the numpy formulas and not from the solver's."""
    loop = LocalLoop(config, np.eye(6), np.zeros((3, 6)))
    step = so3.log(loop_step(config, omega)) / config.step_s
    free = float(loop.stage_cost(np.hstack([so3.log(R), step])[None])[0])
    weight = np.trace(config.torque_weight) * np.eye(3) - config.torque_weight
    return free + float(tau @ weight @ tau) / 2


def loop_step(config: AttitudeMpcConfig, omega: np.ndarray) -> np.ndarray:
    """Return the free step ``f(omega)``."""
    return step_rotation(omega, config.inertia_kg_m2, config.step_s)


def run_one(mpc: AttitudeMpc, R: np.ndarray, omega: np.ndarray, steps: int) -> dict[str, Any]:
    """Run one closed loop and count what should not happen."""
    config, bound, found = mpc.config, np.inf, {'violations': 0, 'infeasible': 0, 'open': 0}
    cold, warm = [], []
    mpc.reset()
    for k in range(steps):
        s = mpc.solve(R, omega)
        (warm if k else cold).append(s.solve_time_s * 1e6)
        found['infeasible'] += s.status == SolveStatus.INFEASIBLE
        found['open'] += s.status in (SolveStatus.FEASIBLE, SolveStatus.FAILED)
        found['violations'] += s.cost > bound * (1 + RELATIVE) + ABSOLUTE
        bound = s.cost - stage_cost(config, R, omega, s.torque_B_n_m)
        R, omega = lgvi_step(R, omega, s.torque_B_n_m, inertia_kg_m2=config.inertia_kg_m2,
                             step_s=config.step_s, forcing=config.forcing)
    settled = so3.angle(R) < SETTLED_RAD and np.linalg.norm(omega) < SETTLED_RAD_S
    return {**found, 'settled': bool(settled), 'cold_us': cold, 'warm_us': warm}


def starts(rng: np.random.Generator, count: int, largest_rate: float
           ) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return uniform attitudes with rates uniform in a ball."""
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    rates = largest_rate * rng.uniform(size=(count, 1)) ** (1 / 3) * direction
    return list(zip(so3.random_rotations(rng, count), rates))


def half_turns(rng: np.random.Generator, count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return exact 180 degree attitudes at rest: about x, y, z, then random axes."""
    axes = np.vstack([np.eye(3), rng.normal(size=(max(count - 3, 0), 3))])[:count]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return [(2 * np.outer(axis, axis) - np.eye(3), np.zeros(3)) for axis in axes]


def summary(name: str, runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the counts and time percentiles of a set of runs."""
    warm = np.concatenate([run['warm_us'] for run in runs])
    cold = np.concatenate([run['cold_us'] for run in runs])
    return {
        'set': name, 'loops': len(runs), 'settled': sum(run['settled'] for run in runs),
        'decrease_violations': sum(run['violations'] for run in runs),
        'infeasible_solves': sum(run['infeasible'] for run in runs),
        'not_converged_solves': sum(run['open'] for run in runs), 'warm_solves': len(warm),
        'warm_us_median': round(float(np.median(warm)), 1),
        'warm_us_p99': round(float(np.quantile(warm, 0.99)), 1),
        'cold_us_median': round(float(np.median(cold)), 1),
        'cold_us_p99': round(float(np.quantile(cold, 0.99)), 1)}


def main() -> None:
    """Run both sets, print the table and write the JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--config', default=str(
        Path(__file__).resolve().parent.parent / 'config' / 'controller.yaml'))
    parser.add_argument('--loops', type=int, default=300)
    parser.add_argument('--half-turns', type=int, default=100)
    parser.add_argument('--steps', type=int, default=60)
    parser.add_argument('--largest-rate', type=float, default=0.3, help='rad/s')
    parser.add_argument('--output', type=Path)
    args = parser.parse_args()
    mpc = AttitudeMpc(AttitudeMpcConfig.from_yaml(args.config))
    rng = np.random.default_rng(0)
    sets = {'random attitudes and rates': starts(rng, args.loops, args.largest_rate),
            'exact 180 degrees at rest': half_turns(rng, args.half_turns)}
    rows = []
    for name, states in sets.items():
        runs = []
        for index, (R, omega) in enumerate(states):
            runs.append(run_one(mpc, R, omega, args.steps))
            print(f'\r{name}: {index + 1} of {len(states)}', end='', flush=True)
        rows.append(summary(name, runs))
        print('\r' + '  '.join(f'{key} {value}' for key, value in rows[-1].items()))
    if args.output is not None:
        facts = {'horizon': mpc.config.horizon, 'backend': mpc.backend, 'steps': args.steps,
                 'largest_rate_rad_s': args.largest_rate, 'machine': platform.machine(),
                 'python': platform.python_version(), 'sets': rows}
        args.output.parent.mkdir(parents=True, exist_ok=True)
        args.output.write_text(json.dumps(facts, indent=2) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
