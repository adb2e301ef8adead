# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the deterministic global search of a configuration begins with (backends/search.c).

Starts: the short way, the long way, and (with a torque limit) all eight octants of first
torque; on horizons of many steps, and with weights that make turns nearly time-optimal, also full
torque about one axis or two, and octants the long way round. A planar slew is a stationary point
that is up to 37 % worse than the best known plan (test_global.py), and no descent method leaves
it; the octants do.
"""

from __future__ import annotations

import itertools

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.program.options import FAR_TURN, MANY_STEPS
from manifold_mpc_ros.mpc.scaling import scaling_of
from manifold_mpc_ros.terminal.manifold import tangent_basis


def starts(config: AttitudeMpcConfig) -> Array:
    """Return the starts (n, 4) in their fixed order: lean (3,), and 1 for the long way round.

    A lean is three signs of first torque, none for a slew. Pointing has no long way round; without
    torque limits its leans are first turns, to either side along a basis of the plane across the
    axis.
    """
    short, long_way = (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
    limited, attitude = config.max_torque_n_m is not None, config.target == 'attitude'
    leans = [(*signs, 0.0) for signs in itertools.product((1.0, -1.0), repeat=3)]
    if not limited:
        first, second = tangent_basis(config.pointing_axis_B).T
        leans = [] if attitude else [
            (*lean.tolist(), 0.0) for lean in (first, -first, second, -second)]
    elif attitude and (config.horizon > MANY_STEPS or FAR_TURN * linear_rad(config) < np.pi):
        axes = [(*lean, 0.0) for lean in np.vstack([np.eye(3), -np.eye(3)]).tolist()]
        pairs = [(*lean, 0.0) for lean in itertools.product((1.0, 0.0, -1.0), repeat=3)
                 if lean.count(0.0) == 1]
        leans = [*leans, *axes, *((*lean[:3], 1.0) for lean in leans), *pairs]
    return np.array([short, *([long_way] if attitude else []), *leans])


def quickest_rad_s2(config: AttitudeMpcConfig) -> float:
    """Return the largest angular acceleration about a body axis, 0 without torque limits."""
    if config.max_torque_n_m is None:
        return 0.0
    return float(np.max(config.max_torque_n_m / np.diag(config.inertia_kg_m2)))


def linear_rad(config: AttitudeMpcConfig) -> float:
    """Return the least angle a that costs what full torque about a body axis does.

    ``tr(Q) / 3 a^2 = H_ii max_torque_i^2 / 2``, H = tr(R) I - R; inf without torque limits.
    """
    if config.max_torque_n_m is None:
        return np.inf
    weights = np.trace(config.torque_weight) - np.diag(config.torque_weight)
    cost = weights * config.max_torque_n_m ** 2 / 2.0
    return float(np.sqrt(cost.min() / scaling_of(config).cost))


def guard_squared(config: AttitudeMpcConfig) -> float:
    """Return the square of the least dimensionless momentum from which no step may exist."""
    unit = scaling_of(config)
    inertia = config.inertia_kg_m2 / (unit.torque_n_m * unit.time_s ** 2)
    return float(np.linalg.eigvalsh(inertia)[0]) ** 2
