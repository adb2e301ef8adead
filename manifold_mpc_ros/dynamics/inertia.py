# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The inertia tensor J (..., 3, 3) [kg m^2] and what the implicit step needs of it.

The step of the LGVI is guaranteed to exist, and to be below 90 degrees, while
``|h Pi + h^2/2 tau| < lambda_min(J)`` (docs/theory.md); lambda_min(J) is the existence guard.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from manifold_mpc_ros.lie.arrays import Array


def nonstandard_inertia(J: ArrayLike) -> Array:
    """Map the inertia tensor J (..., 3, 3) to J_d = tr(J)/2 I - J (..., 3, 3) [kg m^2]."""
    J = np.asarray(J, dtype=np.float64)
    half_trace = 0.5 * np.trace(J, axis1=-2, axis2=-1)
    return np.asarray(half_trace[..., None, None] * np.eye(3) - J)


def principal_moments(J: ArrayLike) -> Array:
    """Map J (..., 3, 3) to its principal moments (..., 3) [kg m^2], ascending."""
    return np.asarray(np.linalg.eigvalsh(np.asarray(J, dtype=np.float64)))


def existence_guard(J: ArrayLike) -> float:
    """Return lambda_min(J) of one body (3, 3) [kg m^2], below which |m| guarantees a step."""
    return float(principal_moments(J)[0])


def free_steps_exist(omega_BN_B: ArrayLike, J: ArrayLike, step_s: float) -> NDArray[np.bool_]:
    """Map rates (..., 3) [rad/s] of one body to whether ``h |J omega| < lambda_min(J)`` (...)."""
    with np.errstate(invalid='ignore'):  # rates that are no numbers have no step
        momenta = step_s * (np.asarray(omega_BN_B, dtype=np.float64) @ np.asarray(J))
    return np.asarray(np.linalg.norm(momenta, axis=-1) < existence_guard(J))


def largest_guaranteed_rate(J: ArrayLike, step_s: float) -> float:
    """Return the rate [rad/s] below which a free step exists about every axis of one body (3, 3).

    ``lambda_min(J) / (h lambda_max(J))``, as ``|J omega| <= lambda_max(J) |omega|``.
    """
    moments = principal_moments(J)
    return float(moments[0] / (step_s * moments[-1]))
