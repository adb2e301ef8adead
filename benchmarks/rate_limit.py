# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How far a rate limit is exceeded in closed loop, at the ticks and between them.

    python benchmarks/rate_limit.py --output docs/results/rate_limit.json

On the bodies of instances.py, six turns each between 60 and 180 degrees at rest about random axes,
with 60 steps for one and a half half turns. The plant takes 20 LGVI steps in each of the
controller's: it differs from the model by the error of the model's longer step, which is of the
second order. Limits hold at the nodes of a plan, and between them up to the same order; with
`keep_rate_between_samples` the body keeps them. Every loop is closed without it and with it. The
figures are the largest |omega_i| over its limit, the margins that plans keep, and when all turns
were within 1 degree, in all. Exit status 1 when a limit that is to be kept is not.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from instances import BODIES, Body, configuration, half_turn_s
from strategies import generator

from manifold_mpc_ros import AttitudeMpc, lgvi_step
from manifold_mpc_ros.lie import so3

HORIZON, TIMES_HALF_TURN, ACCURACY_RAD, DAMPING = 60, 1.5, np.radians(1.0), 1.0
WORDS = {'as_shipped': False, 'kept': True}
TURNS, ANGLES_RAD, SUBSTEPS = 6, np.radians([60.0, 180.0]), 20


def flown(name: str, body: Body, *, keep: bool) -> dict[str, Any]:
    """Return the largest parts of the limit that the turns of a body reach."""
    step_s = TIMES_HALF_TURN * half_turn_s(body) / HORIZON
    mpc = AttitudeMpc(replace(configuration(body, step_s, HORIZON, ACCURACY_RAD, DAMPING),
                              keep_rate_between_samples=keep))
    rng, ticks, between, settled = generator('rate limit', name), 0.0, 0.0, 0
    for _ in range(TURNS):
        R = so3.exp(rng.uniform(*ANGLES_RAD) * so3.random_rotations(rng, 1)[0][0])
        omega = np.zeros(3)
        mpc.reset()
        last = 0
        for tick in range(HORIZON):
            torque = mpc.solve(R, omega).torque_B_n_m
            for _ in range(SUBSTEPS):
                R, omega = lgvi_step(R, omega, torque, inertia_kg_m2=body.inertia,
                                     step_s=step_s / SUBSTEPS)
                between = max(between, float(np.max(np.abs(omega) / body.rate)))
            ticks = max(ticks, float(np.max(np.abs(omega) / body.rate)))
            if np.linalg.norm(so3.log(R)) > ACCURACY_RAD:
                last = tick + 2
        settled += last
    return {'at_ticks': ticks, 'between': between, 'settled_in_steps': settled,
            'margins': list(mpc.config.rate_margins[0].values()), 'step_s': step_s}


def main() -> int:
    """Fly every body; write the figures."""
    parser = argparse.ArgumentParser(description='rate limits in closed loop')
    parser.add_argument('--output', type=Path, help='JSON file')
    arguments = parser.parse_args()
    rows = []
    for name, body in BODIES.items():
        try:
            rows.append({'body': name, **{
                word: flown(name, body, keep=keep) for word, keep in WORDS.items()}})
        except ValueError as refused:  # the step is too long for the limits of this body
            print(f'{name}: {refused}')
            continue
        print(rows[-1], flush=True)
    result = {'turns': TURNS, **{word: {
        'largest_at_ticks': max(row[word]['at_ticks'] for row in rows),
        'largest_between': max(row[word]['between'] for row in rows)} for word in WORDS},
        'bodies': rows}
    if arguments.output:
        arguments.output.write_text(json.dumps(result, indent=1) + '\n', encoding='utf-8')
    return int(result['kept']['largest_between'] > 1.0)


if __name__ == '__main__':
    raise SystemExit(main())
