# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the controller aims at: an attitude, or a direction for one body axis with free roll."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.manifold import tangent_basis


def error_angle(config: AttitudeMpcConfig, R_DB: ArrayLike) -> Array:
    """Map errors ``R_DB = R_ND^T R_NB`` (..., 3, 3) to the angle left to turn (...) [rad].

    The rotation angle, or for pointing the angle between the axis b and where it should point,
    ``Gamma = R_DB^T b``.
    """
    return so3.angle(R_DB, config.pointing_axis_B if config.target == 'pointing' else None)


def attitude_towards(config: AttitudeMpcConfig, direction_N: ArrayLike) -> Array:
    """Map a direction (3,) in inertial axes to the R_ND nearest the identity that points b there.

    For the opposite of b the turn is about the first axis of the basis across b.
    """
    axis = config.pointing_axis_B
    direction = np.asarray(direction_N, dtype=float)
    direction = direction / np.linalg.norm(direction)
    normal = np.cross(axis, direction)
    sine, cosine = float(np.linalg.norm(normal)), float(axis @ direction)
    if sine < 1e-15:
        normal = tangent_basis(axis)[:, 0] if cosine < 0 else np.zeros(3)
    else:
        normal = normal / sine
    return np.asarray(so3.exp(np.arctan2(sine, cosine) * normal))
