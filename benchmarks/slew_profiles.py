# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measure slews by a profile and without one, through the control loop of the node.

    python benchmarks/slew_profiles.py --output docs/results/slew_profiles.json

Twenty random turns of 60 to 180 degrees each: from rest, from a tumble of up to 0.3 rad/s about
each axis, and with another setpoint, 60 to 180 degrees from the first, in the middle of the slew.
The loop is closed around a body in continuous time that shares nothing with the model
(lab/tracking); body, limits and weights are those of config/controller.yaml, the profile uses 0.9
of the limits.
Exit status 1 when a tick is infeasible or a limit is exceeded with a profile.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.control.moving.slew_profile import SlewPlanner
from manifold_mpc_ros.control.target import FixedTarget
from manifold_mpc_ros.lab.tracking.body import ContinuousBody
from manifold_mpc_ros.lab.tracking.flight import Flight, fly
from manifold_mpc_ros.lab.tune.rule import bang_bang_time_s
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import SolveStatus

SHIPPED = ControllerConfig.from_yaml(
    Path(__file__).resolve().parent.parent / 'config' / 'controller.yaml')
SEED, TURNS, PART, SETTLED_RAD, DURATION_S = 7, 20, 0.9, np.radians(0.1), 35.0
LARGEST_RATE_RAD_S, MIDDLE_S = 0.3, 4.0


def turn(rng: np.random.Generator) -> np.ndarray:
    """Return a random turn (3, 3) of 60 to 180 degrees."""
    axis = rng.standard_normal(3)
    return so3.exp(rng.uniform(np.pi / 3, np.pi) * axis / np.linalg.norm(axis))


def flown(mpc: AttitudeMpc, kind: str, number: int, *, profile: bool) -> Flight:
    """Fly one turn to the identity, or by way of it to another setpoint."""
    rng = np.random.default_rng([SEED, number])
    start, rates, jump = turn(rng), rng.uniform(-1.0, 1.0, 3) * LARGEST_RATE_RAD_S, turn(rng)
    config = mpc.config
    body = ContinuousBody(
        config.inertia_kg_m2, step_s=config.step_s / 20, R_NB=start,
        omega_BN_B=rates if kind == 'tumble' else np.zeros(3),
        max_torque_n_m=config.max_torque_n_m)
    planner = SlewPlanner(config, PART, SHIPPED.slew_smallest_angle_rad) if profile else None
    later = {round(MIDDLE_S / config.step_s): FixedTarget(jump)} if kind == 'middle' else None
    return fly(mpc, body, FixedTarget(np.eye(3)), DURATION_S, slews=planner, later=later)


def row(flight: Flight, bound_s: float) -> dict[str, Any]:
    """Return what became of a flight."""
    last = flight.commands[-1].decrease
    assert last is not None
    limits = SHIPPED.mpc
    return {
        'settled_s': flight.settled_s(SETTLED_RAD) + limits.step_s, 'bang_bang_s': bound_s,
        'infeasible': sum(command.solution is None or command.solution.status in (
            SolveStatus.INFEASIBLE, SolveStatus.FAILED) for command in flight.commands),
        'torque': float(np.max(np.abs(flight.torque_n_m) / limits.max_torque_n_m)),
        'rate': float(np.max(np.abs(flight.rate_rad_s) / limits.max_rate_rad_s)),
        'promises': last.counters.checked, 'broken': last.counters.broken,
        'searches': flight.searches}


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the figures of many flights."""
    settled = [each['settled_s'] for each in rows]
    return {'flights': len(rows), 'settled_median_s': float(np.median(settled)),
            'settled_worst_s': max(settled),
            **{f'{name}_ticks' if name == 'infeasible' else name: sum(
                each[name] for each in rows) for name in ('infeasible', 'promises', 'broken')},
            'largest_torque': max(each['torque'] for each in rows),
            'largest_rate': max(each['rate'] for each in rows)}


def main() -> int:
    """Fly all of them and write the figures."""
    parser = argparse.ArgumentParser(description='slews by a profile and without')
    parser.add_argument('--output', type=Path, required=True, help='JSON file')
    path, mpc = parser.parse_args().output, AttitudeMpc(SHIPPED.mpc, moving=True)
    result: dict[str, Any] = {'part': PART}
    for kind in ('rest', 'tumble', 'middle'):
        for way in ('profile', 'setpoint'):
            rows = []
            for number in range(TURNS):
                flight = flown(mpc, kind, number, profile=way == 'profile')
                vector = so3.log(flight.attitudes[0])
                angle = float(np.linalg.norm(vector))
                rows.append(row(flight, bang_bang_time_s(mpc.config, vector / angle, angle)))
            result.setdefault(kind, {})[way] = {**summary(rows), 'rows': rows}
            print(kind, way, summary(rows), flush=True)
        ratios = [each['settled_s'] / each['bang_bang_s'] for each in result['rest']['profile'][
            'rows']]
    result['rest_over_bang_bang'] = {'median': float(np.median(ratios)), 'worst': max(ratios)}
    path.write_text(json.dumps(result, indent=1) + '\n', encoding='utf-8')
    return int(any(result[kind]['profile'][name] > most for kind in ('rest', 'tumble', 'middle')
                   for name, most in (('infeasible_ticks', 0), ('largest_torque', 1.0 + 1e-9),
                                      ('largest_rate', 1.0))))


if __name__ == '__main__':
    raise SystemExit(main())
