# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Configurations and states that the tests of the controller share."""

from __future__ import annotations

from typing import Any

import numpy as np
from strategies import INERTIAS, generator, half_turns, unit_vectors

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

BODY = np.diag([1.0, 0.9, 0.6])
LIMITS: dict[str, Any] = {'max_torque_n_m': 0.3, 'max_rate_rad_s': 0.6}
# The design page's reference problem, and what a physical plant is controlled with.
REFERENCE: dict[str, Any] = {'terminal_constraint': False}
LIMITED: dict[str, Any] = {**REFERENCE, **LIMITS}
CERTIFIED: dict[str, Any] = {**LIMITS, 'horizon': 20, 'forcing': 'symmetric'}
# What the search is compared with the oracle on.
PROBLEMS: dict[str, dict[str, Any]] = {
    'free': REFERENCE,
    'limited': LIMITED,
    'limited_symmetric': {**LIMITED, 'forcing': 'symmetric'},
    'terminal_set': CERTIFIED,
    'off_diagonal': {**LIMITED, 'inertia_kg_m2': INERTIAS['off_diagonal']},
    'unequal_torques': {**LIMITED, 'max_torque_n_m': (0.1, 0.2, 0.3)},
    'free_axes': {**LIMITED, 'max_torque_n_m': (0.3, 0.2, np.inf),
                  'max_rate_rad_s': (0.5, np.inf, 0.6)},
}


def configuration(**changes: Any) -> AttitudeMpcConfig:
    """Return the design page's problem (J = diag(1, 0.9, 0.6), paper's forcing), changed."""
    J = np.asarray(changes.get('inertia_kg_m2', BODY), dtype=float)
    J = np.diag(J) if J.ndim == 1 else J
    values: dict[str, Any] = {
        'inertia_kg_m2': J, 'step_s': 0.5, 'horizon': 10, 'attitude_weight': np.eye(3),
        'rate_weight': np.trace(J) / 2 * np.eye(3) - J, 'torque_weight': 2 * np.eye(3),
        'terminal_scale': 0.1, 'forcing': 'paper'}
    return AttitudeMpcConfig(**{**values, **changes})


def rest_axes(n: int) -> Array:
    """Return x, y, z and n random axes (n + 3, 3)."""
    return np.vstack([np.eye(3), unit_vectors(generator('rest axes'), n)])


def rest_states(n: int) -> list[tuple[Array, Array]]:
    """Return states at rest by exactly 180 degrees about x, y, z and n random axes."""
    return [(R, np.zeros(3)) for R in half_turns(rest_axes(n))]


def random_states(key: str, n: int, largest_rate: float) -> list[tuple[Array, Array]]:
    """Return n uniform attitudes with rates uniform in the box of this half width [rad/s]."""
    rng = generator(key)
    rates = rng.uniform(-largest_rate, largest_rate, size=(n, 3))
    return list(zip(so3.random_rotations(rng, n), rates))


def cold(mpc: AttitudeMpc) -> AttitudeMpc:
    """Return the controller without a warm start."""
    mpc.reset()
    return mpc
