# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The stage cost from the paper's formulas, in numpy, independent of the solver's.

For judging a controller: what it says about its own value is compared with these.
"""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.lgvi import step_rotation
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array


def stage_costs(config: AttitudeMpcConfig, R_NB: Array, omega_BN_B: Array, tau_B: Array) -> Array:
    """Map states and torques to ``L = E(g) + tr(Qf (I - f)) / h^2 + tr(u^T R u) / 2`` (n,).

    With u = tau^x and f the free step of the rate over h. E is ``tr(Qg (I - g))``, or
    ``w (1 - b . Gamma)`` for pointing, Gamma = g^T b. The commanded attitude is the identity,
    so g = R_NB. Traces are sums of ``-Q * (g - I)``: accurate to rounding of tr(Q), 1e-15.

    Arguments
    ---------
    config
        Weights, step and inertia.
    R_NB, omega_BN_B, tau_B
        Attitudes (n, 3, 3), body rates (n, 3) [rad/s], body torques (n, 3) [N m].

    """
    f = step_rotation(omega_BN_B, config.inertia_kg_m2, config.step_s)
    u = so3.hat(tau_B)
    effort = np.einsum('...ji,jk,...ki->...', u, config.torque_weight, u) / 2
    return (_error_cost(config, R_NB)
            + _trace_cost(config.rate_weight, f) / config.step_s ** 2 + effort)


def _error_cost(config: AttitudeMpcConfig, g: Array) -> Array:
    """Return E(g) (n,)."""
    if config.target == 'attitude':
        return _trace_cost(config.attitude_weight, g)
    axis = config.pointing_axis_B
    # 1 - b . Gamma = |Gamma - b|^2 / 2, which does not cancel near the target.
    apart = direction_B(axis, g) - axis
    return config.pointing_weight * np.sum(apart * apart, axis=-1) / 2


def _trace_cost(weight: Array, rotation: Array) -> Array:
    """Return ``tr(Q (I - R))`` (n,)."""
    return -np.einsum('ij,...ij->...', weight, rotation - np.eye(3))


def direction_B(axis: Array, R_NB: Array) -> Array:
    """Return Gamma = R_NB^T b (..., 3): the commanded direction, seen from the body."""
    return np.einsum('...ji,j->...i', R_NB, axis)
