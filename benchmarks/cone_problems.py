# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Random problems with cones: the search beside IPOPT from many starts, and closed loops.

    python benchmarks/cone_problems.py ipopt FILE.jsonl [--problems 0 2200] [--starts 24]
    python benchmarks/cone_problems.py compare FILE.jsonl [--loops 200] [--output FILE.json]

Problem i comes from the generator of seed (12, i): 1 to 4 cones of 1 to 3 boresights, start and
target that keep them by 0.1 rad, such that the straight way from one to the other crosses a cone.
From problem 2000 on there are 1 or 2 such cones, and a group of 2 to 4 Sun sensors of which any
one has to see the Sun; start and target keep the tightened ones by as much.
The first command appends the costs of IPOPT from so many starts, a line a problem, and goes on
where it was stopped. The second solves the problems of such a file, integrates every plan 50 times
finer, and closes loops; of problems with groups alone the result is a part of the file that is
there. A plan is dearer when its cost is above IPOPT's best by more than 1e-6.
"""

from __future__ import annotations

import argparse
import itertools
import json
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from manifold_mpc_ros import AttitudeMpc, AttitudeMpcConfig, AttitudeMpcSolution, Cone
from manifold_mpc_ros.config.cones import alone, joined, tightened
from manifold_mpc_ros.lab.benchmark.constrained.oracle import ConeOracle, starts
from manifold_mpc_ros.lab.benchmark.constrained.plant import Bodies
from manifold_mpc_ros.lab.campaign.random_cones import random_cones, straight_way
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.cone_cut import cut_level, spread, target_margins_rad
from manifold_mpc_ros.terminal.design import TerminalDesign
from manifold_mpc_ros.terminal.problem_of import terminal_design

RESULT = Path(__file__).parents[1] / 'docs' / 'results' / 'cone_problems.json'
MOST_CONES, PLAIN = 4, 2000
LEAST_RAD = 0.1
TOLERANCE, FINER, TICKS, SETTLED_RAD = 1e-6, 50, 80, 1e-2
J = np.diag([1.0, 0.9, 0.6])
BODY: dict[str, Any] = {
    'inertia_kg_m2': J, 'step_s': 0.5, 'horizon': 40, 'attitude_weight': np.eye(3),
    'rate_weight': np.trace(J) / 2 * np.eye(3) - J, 'torque_weight': 2 * np.eye(3),
    'max_torque_n_m': 0.3, 'max_rate_rad_s': 0.3}


class Problem(NamedTuple):
    """A configuration with cones, and a state and target in inertial axes."""

    config: AttitudeMpcConfig
    R_NB: Array
    omega_BN_B: Array
    R_ND: Array

    @property
    def relative(self) -> tuple[Array, list[Cone]]:
        """The attitude and the cones (kept between samples too) in the target's axes."""
        return self.R_ND.T @ self.R_NB, [
            replace(each, direction_N=self.R_ND.T @ each.direction_N)
            for each in self.config.kept_cones]

    @property
    def members(self) -> int:
        """The cones of its group, which are the last ones."""
        return sum(each.group is not None for each in self.config.cones)


def problem(index: int) -> Problem:
    """Draw a problem."""
    rng = np.random.default_rng((12, index))
    while True:
        cones = random_cones(
            rng, most=MOST_CONES if index < PLAIN else 2, most_axes=3, half_angle_rad=(0.2, 0.9),
            keep_in_part=0.3, keep_in_half_angle_rad=(1.2, 2.4))
        if index >= PLAIN:
            sun, *axes = rng.standard_normal((int(rng.integers(3, 6)), 3))
            cones += [Cone(f'sensor{i}', axis, sun, rng.uniform(1.0, 1.5), 'keep_in', 'sun')
                      for i, axis in enumerate(axes)]
        R_NB, R_ND = so3.random_rotations(rng, 2)
        omega = rng.uniform(-0.1, 0.1, 3)
        way = straight_way(R_NB, R_ND)
        margins = np.min(list(margins_rad(cones, way).values()), axis=0)
        if index >= PLAIN:
            kept = alone(tightened(cones, AttitudeMpcConfig(**BODY).between_samples,
                                   [0.0] * len(cones)))
            ends = np.min(list(margins_rad(kept, way[[0, -1]]).values()))
            if ends < LEAST_RAD:
                continue
        if margins[[0, -1]].min() > LEAST_RAD and margins.min() < 0.0:
            return Problem(AttitudeMpcConfig(**BODY, cones=cones), R_NB, omega, R_ND)


def margins_rad(cones: Sequence[Cone], R_NB: Array) -> dict[str, Array]:
    """Map attitudes (n, 3, 3) to the angles (n,) by which each cone or group is kept, by name."""
    return joined(cones, np.array([cone.margins_rad(R_NB) for cone in cones]))


def level_of(given: Problem, design: TerminalDesign) -> float:
    """Return the terminal level that the cones leave; 0 for none."""
    config = given.config
    margins = target_margins_rad(config, config.kept_cones, given.R_ND)
    return cut_level(design.c, margins, spread(config, design.P))


def solve_by_ipopt(path: Path, indices: range, most: int) -> None:
    """Append a line for every problem that the file has not yet."""
    design = terminal_design(AttitudeMpcConfig(**BODY))
    oracles: dict[int, ConeOracle] = {}
    done = {row['problem'] for row in rows_of(path)}
    for index in indices:
        if index in done:
            continue
        given = problem(index)
        members = given.members
        if members not in oracles:
            oracles[members] = ConeOracle(AttitudeMpcConfig(**BODY), design.P,
                                          2 + members if members else MOST_CONES, members)
        oracle, begin = oracles[members], time.process_time()
        R, cones = given.relative
        rng = np.random.default_rng((13, index))
        level = level_of(given, design)
        found = [oracle.solve(R, given.omega_BN_B, cones, level, oracle.by_way_of(corners))[0]
                 for corners in starts(R, cones, rng, most - 2)]
        with path.open('a', encoding='utf-8') as file:
            file.write(json.dumps({
                'problem': index, 'costs': [cost if np.isfinite(cost) else None
                                            for cost in found],
                'cpu_s': round(time.process_time() - begin, 3)}) + '\n')


def have_groups(path: Path) -> bool:
    """Return whether the problems of a file are those with groups: a part of the result."""
    return all(row['problem'] >= PLAIN for row in rows_of(path))


def rows_of(path: Path) -> list[dict[str, Any]]:
    """Return the lines of a file."""
    return [json.loads(line) for line in path.read_text(encoding='utf-8').splitlines()] \
        if path.exists() else []


def compare(path: Path, loops: int) -> dict[str, Any]:
    """Return what became of the problems of a file, and of closed loops.

    Loops are of the first that IPOPT solves; angles to cones of the plans that converge.
    """
    design = terminal_design(AttitudeMpcConfig(**BODY))
    rows = sorted(rows_of(path), key=lambda row: int(row['problem']))
    found: list[dict[str, Any]] = []
    flown: list[tuple[Problem, AttitudeMpcSolution]] = []
    closed: list[dict[str, Any]] = []
    for row in rows:
        given = problem(row['problem'])
        mpc = AttitudeMpc(given.config, terminal=design)
        begin = time.thread_time()
        plan = mpc.solve(given.R_NB, given.omega_BN_B, given.R_ND)
        best = min((cost for cost in row['costs'] if cost is not None), default=np.inf)
        found.append({
            'problem': row['problem'], 'cones': len(given.config.cones),
            'status': str(plan.status), 'cost': plan.cost, 'ipopt': best,
            'excess': plan.cost / best - 1.0, 'passes': plan.iterations,
            'cpu_ms': 1e3 * (time.thread_time() - begin)})
        if str(plan.status) == 'converged':
            flown.append((given, plan))
        if len(closed) < loops and np.isfinite(best):
            closed.append(close_loop(mpc, given))
    solved = [row for row in found if np.isfinite(row['ipopt'])]
    times = np.array([row['cpu_ms'] for row in found])
    return {
        'problems': len(found),
        'starts_of_ipopt': dict(Counter(len(row['costs']) for row in rows)),
        'solved_by_ipopt': len(solved),
        'not_solved_but_by_ipopt': [row['problem'] for row in solved
                                    if row['status'] != 'converged'],
        'dearer': [{key: row[key] for key in ('problem', 'cones', 'cost', 'ipopt', 'excess')}
                   for row in solved if row['excess'] > TOLERANCE],
        'ipopt_dearer': sum(row['excess'] < -TOLERANCE for row in solved),
        'least_angle_to_a_cone_deg': least_angle_deg(flown),
        'search_cpu_ms': {'median': float(np.median(times)),
                          'p99': float(np.percentile(times, 99)), 'largest': float(times.max())},
        'loops': {
            'count': len(closed), 'settled': sum(loop['settled'] for loop in closed),
            'feasible_at_every_tick': sum(loop['feasible'] for loop in closed),
            'largest_rise_above_promise': max(loop['rise'] for loop in closed),
            'least_angle_to_a_cone_deg': min(loop['least_deg'] for loop in closed)},
    }


def close_loop(mpc: AttitudeMpc, given: Problem) -> dict[str, Any]:
    """Return what a closed loop on the model does.

    ``rise``: the most by which a value exceeds the bound V - L of the plan before, relative to V.
    """
    R, omega, plans = given.R_NB, given.omega_BN_B, []
    mpc.reset()
    for _ in range(TICKS):
        plans.append(mpc.solve(R, omega, given.R_ND))
        R, omega = plans[-1].R_NB[1], plans[-1].omega_BN_B[1]
    seen = np.array([plan.R_NB[0] for plan in plans])
    return {
        'settled': bool(so3.angle(given.R_ND.T @ R) < SETTLED_RAD),
        'feasible': all(str(plan.status) in ('converged', 'feasible') for plan in plans),
        'rise': max((after.cost - before.promised_cost) / max(before.cost, 1e-3)
                    for before, after in itertools.pairwise(plans)),
        'least_deg': float(np.degrees(min(
            each.min() for each in margins_rad(given.config.cones, seen).values())))}


def least_angle_deg(flown: list[tuple[Problem, AttitudeMpcSolution]]) -> float:
    """Return the least angle to a cone of bodies under their plans, integrated finer."""
    bodies = Bodies.at_rest(J, np.zeros((3, 0)), np.array([given.R_NB for given, _ in flown]))
    bodies.omega = np.array([given.omega_BN_B for given, _ in flown])
    n, most = len(flown), max(len(given.config.cones) for given, _ in flown)
    axes, directions = np.zeros((2, n, most, 3))
    signs, halves = np.ones((n, most)), np.full((n, most), -np.pi)
    grouped = np.zeros((n, most), dtype=bool)
    for i, (given, _) in enumerate(flown):
        for k, cone in enumerate(given.config.cones):
            axes[i, k], directions[i, k] = cone.axis_B, cone.direction_N
            signs[i, k], halves[i, k] = cone.sign, cone.half_angle_rad
            grouped[i, k] = cone.group is not None
    least = np.inf
    for k in range(BODY['horizon']):
        torque = np.array([plan.torques_B_n_m[k] for _, plan in flown])
        for _ in range(FINER):
            cosine = np.einsum('nij,nkj,nki->nk', bodies.R_NB, axes, directions)
            margins = signs * (np.arccos(np.clip(cosine, -1.0, 1.0)) - halves)
            best = np.where(grouped, margins, -np.inf).max(axis=1)
            least = min(least, float(margins[~grouped].min()),
                        float(best[grouped.any(axis=1)].min(initial=np.inf)))
            bodies.step(torque, np.zeros((n, 0)), BODY['step_s'] / FINER)
    return float(np.degrees(least))


def main() -> None:
    """Do what the command line says."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('what', choices=('ipopt', 'compare'))
    parser.add_argument('file', type=Path)
    parser.add_argument('--problems', type=int, nargs=2, default=(0, 2200))
    parser.add_argument('--starts', type=int, default=24)
    parser.add_argument('--loops', type=int, default=200)
    parser.add_argument('--output', type=Path, default=RESULT)
    arguments = parser.parse_args()
    if arguments.what == 'ipopt':
        solve_by_ipopt(arguments.file, range(*arguments.problems), arguments.starts)
        return
    data = compare(arguments.file, arguments.loops)
    if have_groups(arguments.file):
        data = json.loads(arguments.output.read_text(encoding='utf-8')) | {'groups': data}
    arguments.output.write_text(json.dumps(data, indent=1) + '\n', encoding='utf-8')
    print(json.dumps(data, indent=1))


if __name__ == '__main__':
    main()
