# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tune five named bodies and ten random ones; write how near to the bang-bang bound they settle.

    python benchmarks/tune.py --output docs/results/tune.json

The bodies are those of instances.py, and random ones with moments from 1e-3 to 1e6 kg m^2 about
random axes, torque for half turns of 10 s to 3,000 s, and rates that are reached in some. Each
flies quarter and half turns about its three axes and two random ones, on the model. The bound of
a slew is that of `rule.bang_bang_time_s`: from rest to rest about the axis of the slew, with the
torque box and the rate limit along it, without gyroscopic torque. Bodies that are done are not
tuned again. Exit status 1 when a tick is infeasible, a limit is broken, a solve takes more
processor time than half the period (99 % of them), or a body more than a minute of it.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / 'test'))

from instances import BODIES, Body
from strategies import generator

from manifold_mpc_ros.config.parameter import resolve_parameters
from manifold_mpc_ros.config.tables import CONTROLLER_PARAMETERS
from manifold_mpc_ros.lab.tune.choice import MARGINS, NORMAL, best_of, try_all
from manifold_mpc_ros.lab.tune.trial import Slew, solve_times_s
from manifold_mpc_ros.lie import so3

NAMED = ('3u', '6u', 'telescope', 'station', 'table')
RANDOM = 10
ACCURACY_DEG = 0.1
SOLVE_PART, MINUTE_S = 0.5, 60.0


def random_body(number: int) -> Body:
    """Return a body drawn by its number."""
    rng = generator('tune', number)
    moments = 10 ** rng.uniform(-3, 6) * rng.uniform(0.4, 1.0, size=3)
    moments = np.sort(moments)
    moments[2] = min(moments[2], 0.95 * (moments[0] + moments[1]))
    R = so3.random_rotations(rng, 1)[0]
    half_turn_s = 10 ** rng.uniform(1, 3.5)
    torque = 4 * np.pi * moments[2] / half_turn_s**2
    rate = 2 * np.pi / half_turn_s * rng.uniform(0.4, 1.5)
    return Body(R @ np.diag(moments) @ R.T, float(torque), np.full(3, rate))


def tuned(name: str, body: Body) -> dict[str, Any]:
    """Tune one body; return what it reached."""
    values = resolve_parameters(CONTROLLER_PARAMETERS, {
        'spacecraft.inertia_kg_m2': [float(each) for each in body.inertia.ravel()],
        'limits.max_torque_n_m': [body.torque] * 3,
        'limits.max_rate_rad_s': [float(each) for each in body.rate]}, complete=False)
    axes = [*np.eye(3), *so3.random_rotations(generator('axes', name), 2)[:, 0]]
    slews = [Slew(angle * axis) for axis in axes for angle in (np.pi / 2, np.pi)]
    begun_s = time.process_time()
    trials = try_all(values, NORMAL, np.radians(ACCURACY_DEG), slews)
    best = best_of(trials)
    times_s = solve_times_s(best.flyer, best.hardest.slew)
    config = best.flyer.mpc.config
    return {
        'body': name, 'moments_kg_m2': np.linalg.eigvalsh(body.inertia).tolist(),
        'torque_n_m': body.torque, 'rate_rad_s': body.rate.tolist(),
        'step_s': config.step_s, 'horizon': config.horizon, 'damping': best.weights.damping,
        'torque_fraction': best.weights.torque_fraction,
        'slews': [{'slew': each.slew.text, 'bound_s': each.bound_s, 'ratio': each.ratio,
                   'steps_over': round((each.settled_s - each.bound_s) / config.step_s, 1)}
                  for each in best.outcomes],
        'worst_ratio': best.hardest.ratio,
        'worst_ratio_of_setpoints': min(
            each.hardest.ratio for each in trials if not each.weights.torque_fraction),
        'hardest_off_the_model': {
            name: each.ratio if np.isfinite(each.ratio) else None
            for (name, _, _), each in zip(MARGINS, best.margins)},
        'infeasible_ticks': sum(each.infeasible for each in best.outcomes),
        'limits_broken': int(sum(each.broken for each in best.outcomes)),
        'solve_p99_cpu_s': float(np.percentile(times_s, 99)),
        'tuned_in_cpu_s': time.process_time() - begun_s}


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the figures of all bodies."""
    ratios = np.array([each['ratio'] for row in rows for each in row['slews']])
    return {
        'bodies': len(rows), 'slews': len(ratios),
        'ratio_worst': float(ratios.max()), 'ratio_median': float(np.median(ratios)),
        'slews_within_10_percent': int(np.sum(ratios <= 1.1)),
        'slews_within_30_percent': int(np.sum(ratios <= 1.3)),
        'infeasible_ticks': sum(row['infeasible_ticks'] for row in rows),
        'limits_broken': sum(row['limits_broken'] for row in rows),
        'solves_too_long': sum(
            row['solve_p99_cpu_s'] > SOLVE_PART * row['step_s'] for row in rows),
        'longest_cpu_s': max(row['tuned_in_cpu_s'] for row in rows), 'rows': rows}


def main() -> int:
    """Tune what is not there yet and write the figures."""
    parser = argparse.ArgumentParser(description='tune on many bodies')
    parser.add_argument('--output', type=Path, required=True, help='JSON file')
    path = parser.parse_args().output
    rows = json.loads(path.read_text(encoding='utf-8'))['rows'] if path.exists() else []
    bodies = {**{name: BODIES[name] for name in NAMED},
              **{f'random_{number}': random_body(number) for number in range(RANDOM)}}
    for name, body in bodies.items():
        if name not in {row['body'] for row in rows}:
            rows.append(tuned(name, body))
            path.write_text(json.dumps(summary(rows), indent=1) + '\n', encoding='utf-8')
            print({key: value for key, value in rows[-1].items() if key != 'slews'}, flush=True)
    result = summary(rows)
    print({key: value for key, value in result.items() if key != 'rows'})
    return int(any(result[name] for name in (
        'infeasible_ticks', 'limits_broken', 'solves_too_long'))
        or result['longest_cpu_s'] > MINUTE_S)


if __name__ == '__main__':
    raise SystemExit(main())
