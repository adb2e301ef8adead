# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Print the drift of the inertial momentum of body and wheels over a million steps.

    python benchmarks/wheels.py [STEPS]

A 6U with four wheels, free, then with motors that follow sines; relative to its momentum.
"""

from __future__ import annotations

import sys

import numpy as np

from manifold_mpc_ros.dynamics.wheel_step import wheel_step
from manifold_mpc_ros.lie import so3

INERTIA = np.diag([0.05, 0.06, 0.02])
AXES_B = np.array([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]]).T / np.sqrt(3.0)
STEP_S = 0.1


def drift(steps: int, *, driven: bool) -> float:
    """Return ``|H - H_0| / |H_0|`` after so many steps."""
    R, omega = so3.exp([0.4, -1.1, 0.6]), np.array([0.05, -0.03, 0.08])
    momentum = np.array([12e-3, -6e-3, 9e-3, 3e-3])
    begin = R @ (INERTIA @ omega + AXES_B @ momentum)
    for k in range(steps):
        motor = 2e-3 * driven * np.sin(0.03 * k + np.arange(4.0))
        R, omega = wheel_step(R, omega, AXES_B @ momentum, AXES_B @ motor, np.zeros(3),
                              inertia_kg_m2=INERTIA, step_s=STEP_S)
        momentum = momentum + STEP_S * motor
    end = R @ (INERTIA @ omega + AXES_B @ momentum)
    return float(np.linalg.norm(end - begin) / np.linalg.norm(begin))


def main() -> None:
    """Print both drifts."""
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    for driven in (False, True):
        print(f'{"driven" if driven else "free"}: {steps} steps, '
              f'{drift(steps, driven=driven):.2e} of the momentum')


if __name__ == '__main__':
    main()
