# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Hold the search against many starts on bodies from a PocketQube to a space station.

    python benchmarks/bodies.py best-known bodies.jsonl      # 3,000 instances: about an hour
    python benchmarks/bodies.py ipopt bodies.jsonl           # the shorter horizons first
    python benchmarks/bodies.py judge bodies.jsonl --output docs/results/bodies.json
    python benchmarks/bodies.py again docs/results/bodies.json --output bodies_again.json

Body, weights, length of the horizon in time and steps are drawn at random, and four turns each.
Every instance is solved at two horizons with the same step, the second half as long again, and a
second time 0.3 degrees beside the turn. The best known plan (best_known.py) is that of 74 starts,
by no rule of the search, and of IPOPT from 18 starts where it was asked; a cost that either found
at the shorter horizon is known at the longer one too. It does not depend on the search, so it is
kept in a file to which both commands append, and go on where they stopped, from that of
docs/results/bodies_known.jsonl too; so does ``judge`` (bodies.judged: to be removed when the
search has changed). Counted by ``judge`` are plans dearer
than that by more than 1e-6; costs that rise with the horizon, or by more than 2 % within 0.3
degrees; states called infeasible from which some start, `domain` or IPOPT finds a plan, and the
other way round. ``again`` solves those that were counted once more: what became of them since.
Exit status 1 when the promise of docs/solver.md does not hold.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from manifold_mpc_ros.lie.arrays import Array

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / 'test'))

from best_known import Known, ManyStarts, of_ipopt
from strategies import generator

from manifold_mpc_ros import AttitudeMpc, AttitudeMpcConfig
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.domain.feasibility import Feasibility
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.solution import SolveStatus


class Body(NamedTuple):
    """Inertia [kg m^2], largest torque [N m] and rate [rad/s] on every axis."""

    inertia: Array
    torque: float
    rate: Array


def _turned(moments: list[float], key: str) -> Array:
    """Return an inertia with these principal moments about random axes."""
    R = so3.random_rotations(generator(key), 1)[0]
    return np.asarray(R @ np.diag(moments) @ R.T)


def _body(inertia: Any, torque: float, rate: Any) -> Body:
    inertia = np.asarray(inertia, dtype=float)
    return Body(np.diag(inertia) if inertia.ndim == 1 else inertia, torque,
                np.broadcast_to(np.asarray(rate, dtype=float), 3).copy())


BODIES = {
    'pocketqube': _body([1.1e-4, 1.0e-4, 0.9e-4], 1e-6, 0.1),
    '1u': _body([2.2e-3, 2.0e-3, 2.1e-3], 2e-5, 0.1),
    'bar': _body([0.0067, 0.0419, 0.0419], 1e-3, 0.1),
    '3u': _body([0.035, 0.035, 0.007], 1e-4, 0.05),
    '6u': _body([0.13, 0.10, 0.05], 1e-3, 0.1),
    'wheeled': _body([0.167174901, 0.125963211, 0.0612346508], 7e-4, 0.012),
    'shipped': _body([1.0, 0.9, 0.6], 0.3, 0.6),
    'table': _body([0.9, 0.8, 1.5], 0.5, 1.0),
    'off_diagonal': _body([[15, 1.2, -0.5], [1.2, 12, 0.8], [-0.5, 0.8, 9]], 0.02, 0.02),
    'plate': _body([10.0, 6.0, 4.1], 0.05, 0.03),
    'rod': _body(_turned([100.0, 100.0, 10.0], 'rod'), 0.2, 0.02),
    'geo': _body(_turned([9000.0, 4000.0, 8500.0], 'geo'), 0.5, np.radians(0.3)),
    'telescope': _body([31046.0, 77217.0, 78754.0], 1.2, np.radians([0.5, 0.2, 0.2])),
    'station': _body([[1.28e8, -5e6, 6e6], [-5e6, 1.07e8, 3e6], [6e6, 3e6, 2.01e8]], 150.0,
                     np.radians(0.1)),
}
HORIZONS = (10, 14, 20, 28, 40, 80, 160, 330)
LONGER = 1.5
# Turns that every controller flies.
TURNS = 4
BESIDE_DEG = 0.3
# ... of turns above this, where that is little beside the turn.
LARGE_TURN_DEG = 140.0
WORSE, JUMP = 1e-6, 0.02
# Promised: the part of the instances that may be dearer, and by how much.
PART_WORSE, MOST_WORSE = 0.005, 0.01


def half_turn_s(body: Body) -> float:
    """Return the time of a bang-bang half turn about the slowest body axis."""
    times = []
    for axis in range(3):
        inertia = float(np.abs(body.inertia[axis]).max())
        time_s, cap = 2 * np.sqrt(np.pi * inertia / body.torque), float(body.rate[axis])
        if time_s / 2 * body.torque / inertia > cap:
            time_s = np.pi / cap + cap * inertia / body.torque
        times.append(time_s)
    return max(times)


def configuration(body: Body, step_s: float, horizon: int, accuracy_rad: float, damping: float
                  ) -> AttitudeMpcConfig:
    """Return a controller for which full torque costs what this error does."""
    return AttitudeMpcConfig(
        inertia_kg_m2=body.inertia, step_s=step_s, horizon=horizon, attitude_weight=np.eye(3),
        rate_weight=damping * accuracy_rad * np.trace(body.inertia) / 3 / body.torque * np.eye(3),
        torque_weight=(accuracy_rad / body.torque) ** 2 * np.eye(3),
        max_torque_n_m=body.torque, max_rate_rad_s=body.rate)


def draw(number: int) -> dict[str, Any]:
    """Return body, weights, time and steps of the horizon, and turn of an instance.

    The turn is drawn by the number, all else by the number of its `TURNS` turns.
    """
    rng = generator('bodies', number // TURNS)
    controller = {
        'body': str(rng.choice(list(BODIES))), 'horizon': int(rng.choice(HORIZONS)),
        'times_half_turn': float(rng.choice([1.1, 1.5, 2.5])),
        'accuracy_deg': float(rng.choice([0.5, 1.0, 5.0, 25.0])),
        'damping': float(rng.choice([0.3, 1.0, 3.0]))}
    rng = generator('turns', number)
    axis = (np.eye(3)[rng.integers(3)] if rng.random() < 0.4
            else so3.random_rotations(rng, 1)[0][0])
    angle = [180.0, 179.7, rng.uniform(140, 180), rng.uniform(20, 180)][rng.integers(4)]
    return {**controller, 'axis': axis.tolist(), 'angle_deg': float(angle)}


def controllers(number: int) -> Iterator[tuple[dict[str, Any], AttitudeMpc, Array]]:
    """Yield both horizons of an instance with its controller and rotation vector.

    None where its body refuses the step.
    """
    instance = draw(number)
    body = BODIES[instance['body']]
    step_s = half_turn_s(body) * instance['times_half_turn'] / instance['horizon']
    vector = np.radians(instance['angle_deg']) * np.array(instance['axis'])
    for horizon in (instance['horizon'], round(LONGER * instance['horizon'])):
        try:
            mpc = AttitudeMpc(configuration(
                body, step_s, horizon, np.radians(instance['accuracy_deg']),
                instance['damping']))
        except ManifoldMpcError:
            return
        yield {'number': number, **instance, 'horizon': horizon}, mpc, vector


def find_best_known(known: Known, instances: int) -> None:
    """Solve instances from many starts until so many are known."""
    for number in itertools.count():
        if len(known.rows()) >= 2 * instances:
            return
        if known.has(number, 0, 'drawn'):
            continue
        for instance, mpc, vector in controllers(number):
            horizon = instance['horizon']
            known.add(number, horizon, 'starts', ManyStarts(mpc).best(
                so3.exp(vector), generator('starts', number, horizon)))
        known.add(number, 0, 'drawn', np.inf)
        print(f'{len(known.rows())} of {2 * instances}', flush=True)


def ask_ipopt(known: Known, longest: int) -> None:
    """Ask IPOPT for what our own starts have solved, the shorter horizons first."""
    for number, horizon in sorted(known.rows(), key=lambda row: row[::-1]):
        if horizon > longest:
            return
        if known.has(number, horizon, 'ipopt'):
            continue
        for instance, mpc, vector in controllers(number):
            if instance['horizon'] == horizon:
                known.add(number, horizon, 'ipopt', of_ipopt(
                    mpc, so3.exp(vector), generator('ipopt', number, horizon)))
                print(number, horizon, flush=True)


def judge(known: Known, path: Path) -> list[list[dict[str, Any]]]:
    """Solve every instance that is known and not in the file yet; return its rows in pairs."""
    lines = path.read_text(encoding='utf-8').splitlines() if path.exists() else []
    pairs = [json.loads(line) for line in lines]
    there = {pair[0]['number'] for pair in pairs}
    for number, rows in itertools.groupby(known.rows(), key=lambda row: row[0]):
        if len(list(rows)) == 2 and number not in there:
            pairs.append([judged(instance, mpc, vector)
                          for instance, mpc, vector in controllers(number)])
            with path.open('a', encoding='utf-8') as file:
                file.write(json.dumps(pairs[-1]) + '\n')
    for row in itertools.chain.from_iterable(pairs):
        row.update(best=known.best(row['number'], row['horizon']),
                   by_ipopt=known.has(row['number'], row['horizon'], 'ipopt'))
    return pairs


def judged(instance: dict[str, Any], mpc: AttitudeMpc, vector: Array) -> dict[str, Any]:
    """Return what the controller and `domain` say of one instance."""
    R = so3.exp(vector)
    mpc.reset()
    plan = mpc.solve(R, np.zeros(3))
    mpc.reset()
    beside = mpc.solve(so3.exp(vector * (1 - BESIDE_DEG / instance['angle_deg'])), np.zeros(3))
    inside = Feasibility(mpc.config, mpc.terminal).plan(R, np.zeros(3)) is not None
    return {**instance, 'status': str(plan.status), 'cost': plan.cost, 'beside': beside.cost,
            'in_domain': inside,
            'feasible': plan.status in (SolveStatus.CONVERGED, SolveStatus.FEASIBLE),
            'beside_feasible': beside.status != SolveStatus.INFEASIBLE,
            'solve_time_s': plan.solve_time_s}


def summary(pairs: list[list[dict[str, Any]]]) -> dict[str, Any]:
    """Return the figures of all instances."""
    rows = list(itertools.chain.from_iterable(pairs))
    feasible = [row for row in rows if row['feasible']]
    excess = np.array([row['cost'] / (row['best'] or row['cost']) - 1 for row in feasible])
    jumps = [row for row in feasible
             if row['beside_feasible'] and row['angle_deg'] > LARGE_TURN_DEG
             and abs(row['beside'] / row['cost'] - 1) > JUMP]
    rises = [pair for pair in pairs if all(row['feasible'] for row in pair)
             and pair[1]['cost'] > pair[0]['cost'] * (1 + WORSE)]
    return {
        'bodies': len({row['body'] for row in rows}), 'instances': len(rows),
        'held_against_ipopt': sum(row['by_ipopt'] for row in rows),
        'instances_of_body': dict(sorted(Counter(row['body'] for row in rows).items())),
        'instances_of_horizon': dict(sorted(Counter(row['horizon'] for row in rows).items())),
        'feasible': len(feasible),
        'converged': sum(row['status'] == SolveStatus.CONVERGED for row in rows),
        'worse': int(np.sum(excess > WORSE)), 'largest_excess': float(excess.max()),
        'rises_with_horizon': len(rises), 'jumps': len(jumps),
        'false_infeasible': sum(not row['feasible'] and row['best'] is not None for row in rows),
        'lost_with_horizon': sum(a['feasible'] and not b['feasible'] for a, b in pairs),
        'solve_and_domain_differ': sum(row['feasible'] != row['in_domain'] for row in rows),
        'exceptions': [row for row, over in zip(feasible, excess) if over > WORSE]
        + jumps + list(itertools.chain.from_iterable(rises))
        + [row for row in rows if not row['feasible'] and (row['best'] or row['in_domain'])],
    }


def again(path: Path) -> dict[str, Any]:
    """Solve what a file of figures counts as dearer than the best known once more."""
    before = json.loads(path.read_text(encoding='utf-8'))
    rows = []
    for row in before['exceptions']:
        cost = next(mpc.solve(so3.exp(vector), np.zeros(3)).cost
                    for instance, mpc, vector in controllers(row['number'])
                    if instance['horizon'] == row['horizon'])
        rows.append({name: row[name] for name in ('number', 'body', 'horizon', 'best')} | {
            'excess_before': row['cost'] / row['best'] - 1, 'excess': cost / row['best'] - 1})
    excess = np.array([row['excess'] for row in rows])
    return {'instances': before['instances'], 'worse_before': len(rows),
            'worse': int(np.sum(excess > WORSE)), 'largest_excess': float(excess.max()),
            'exceptions': rows}


def main() -> int:
    """Run a command; ``judge`` writes the figures."""
    parser = argparse.ArgumentParser(description='the search on many bodies')
    parser.add_argument('command', choices=('best-known', 'ipopt', 'judge', 'again'))
    parser.add_argument('known', type=Path,
                        help='file of best known costs, JSON lines; of figures for again')
    parser.add_argument('--instances', type=int, default=1500, help='each at two horizons')
    parser.add_argument('--longest', type=int, default=30, help='horizon that IPOPT is asked for')
    parser.add_argument('--output', type=Path, help='JSON file')
    arguments = parser.parse_args()
    if arguments.command == 'again':
        return _written(again(arguments.known), arguments.output)
    known = Known(arguments.known)
    if arguments.command == 'best-known':
        find_best_known(known, arguments.instances)
        return 0
    if arguments.command == 'ipopt':
        ask_ipopt(known, arguments.longest)
        return 0
    result = summary(judge(known, arguments.known.with_suffix('.judged')))
    return _written(result, arguments.output)


def _written(result: dict[str, Any], output: Path | None) -> int:
    """Print and write figures; return 1 when they are not what is promised."""
    print({**result, 'exceptions': len(result['exceptions'])})
    if output:
        output.write_text(json.dumps(result, indent=1) + '\n', encoding='utf-8')
    kept = (result['worse'] <= PART_WORSE * result['instances']
            and result['largest_excess'] <= MOST_WORSE)
    return int(not kept or any(result.get(name) for name in (
        'rises_with_horizon', 'false_infeasible', 'solve_and_domain_differ')))


if __name__ == '__main__':
    raise SystemExit(main())
