# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States on which the exported controller is compared with Python's: closed loops of all kinds."""

from __future__ import annotations

import numpy as np
from strategies import generator, half_turns
from targets import python_answer

from manifold_mpc_ros import AttitudeMpc
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

KINDS = ('half turn', 'random', 'tumbling', 'beyond the limits', 'disturbed', 'new targets')


def quaternion(R: Array) -> Array:
    """Return (x, y, z, w) of a rotation."""
    w, x, y, z = so3.quaternion_from_rotation(R)
    return np.array([x, y, z, w])


def loops(mpc: AttitudeMpc, count: int, ticks: int, key: str) -> tuple[Array, Array]:
    """Return states (n, 15) of closed loops on the predictions, and Python's answers (n, 11)."""
    rng, config = generator(key), mpc.config
    states, answers = [], []
    rate = 0.3 if config.max_rate_rad_s is None else float(np.min(config.max_rate_rad_s))
    torque = 0.0 if config.max_torque_n_m is None else config.max_torque_n_m
    for loop in range(count):
        kind = KINDS[loop % len(KINDS)]
        R = so3.random_rotations(rng, 1)[0]
        if kind == 'half turn':
            R = half_turns(np.eye(3)[rng.integers(3)]) if rng.random() < 0.5 else half_turns(R[0])
        spread = {'half turn': 0.0, 'tumbling': 0.9, 'beyond the limits': 1.5}.get(kind, 0.3)
        omega, target = spread * rate * rng.uniform(-1, 1, 3), np.eye(3)
        disturbance = 0.2 * torque * rng.uniform(-1, 1, 3) * (kind == 'disturbed')
        for tick in range(ticks):
            if kind == 'new targets' and tick % 7 == 3:
                target = so3.random_rotations(rng, 1)[0]
            state = np.concatenate([[tick == 0], quaternion(R), omega, quaternion(target),
                                    disturbance * np.ones(3)])
            plan, answer = python_answer(mpc, state)
            states.append(state)
            answers.append(answer)
            if plan.status == 'failed':
                break
            R, omega = plan.R_NB[1], plan.omega_BN_B[1]
            if kind == 'tumbling':
                omega = omega + 0.05 * rate * rng.uniform(-1, 1, 3)
    return np.array(states), np.array(answers)
