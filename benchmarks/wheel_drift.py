# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Drift of the inertial momentum of body and wheels in the simulator's step, free and driven.

    python benchmarks/wheel_drift.py [--steps 1000000] [--output docs/results/wheel_drift.json]

The 6U of benchmarks/wheels.py; parts of the momentum at the begin.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from wheels import AXES_B, INERTIA, RESULT

from manifold_mpc_ros.dynamics.wheel_step import wheel_step
from manifold_mpc_ros.lie import so3


def drift(steps: int, *, driven: bool) -> float:
    """Return ``|H - H_0| / |H_0|`` after so many steps of the simulator, free or with motors."""
    R, omega = so3.exp([0.4, -1.1, 0.6]), np.array([0.05, -0.03, 0.08])
    momentum = np.array([12e-3, -6e-3, 9e-3, 3e-3])
    begin = R @ (INERTIA @ omega + AXES_B.T @ momentum)
    for k in range(steps):
        motor = 2e-3 * driven * np.sin(0.03 * k + np.arange(4.0))
        R, omega = wheel_step(R, omega, AXES_B.T @ momentum, AXES_B.T @ motor, np.zeros(3),
                              inertia_kg_m2=INERTIA, step_s=0.1)
        momentum = momentum + 0.1 * motor
    end = R @ (INERTIA @ omega + AXES_B.T @ momentum)
    return float(np.linalg.norm(end - begin) / np.linalg.norm(begin))


def main() -> None:
    """Run, write and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument('--steps', type=int, default=1_000_000)
    parser.add_argument('--output', type=Path, default=RESULT.with_name('wheel_drift.json'))
    given = parser.parse_args()
    text = json.dumps({'steps': given.steps, 'free': drift(given.steps, driven=False),
                       'driven': drift(given.steps, driven=True)}, indent=2)
    given.output.write_text(text + '\n', encoding='utf-8')
    print(text)


if __name__ == '__main__':
    main()
