# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a spacecraft feels in orbit: gravity gradient, and the Earth's field as a dipole.

Inertial axes N have their origin in the Earth's centre and z along its axis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.config.orbit import EARTH_GM_M3_S2
from manifold_mpc_ros.lie.arrays import Array

#: Field of the dipole on the equator at the mean radius (IGRF-13 for 2020), and that radius.
_EQUATOR_T, _MEAN_RADIUS_M = 2.98e-5, 6371.2e3


def gravity_gradient_B(R_NB: ArrayLike, position_N_m: ArrayLike, inertia_kg_m2: ArrayLike
                       ) -> Array:
    """Map attitudes (..., 3, 3) and places (..., 3) [m] to the torque (..., 3) [N m].

    ``tau_B = 3 GM / |r|^5  r_B x J r_B``, r_B = R_NB^T r_N, J (3, 3) [kg m^2].
    """
    r_N = np.asarray(position_N_m, dtype=float)
    r_B = np.einsum('...ji,...j->...i', np.asarray(R_NB, dtype=float), r_N)
    size = 3.0 * EARTH_GM_M3_S2 / np.linalg.norm(r_N, axis=-1, keepdims=True) ** 5
    return np.asarray(size * np.cross(r_B, r_B @ np.asarray(inertia_kg_m2, dtype=float).T))


def dipole_field_N(position_N_m: ArrayLike) -> Array:
    """Map places (..., 3) [m] to the magnetic field (..., 3) [T] of a dipole along -z.

    ``B = B_0 (a / |r|)^3 (z - 3 (z . r) r / |r|^2)``: to the north on the equator. The Earth's
    dipole is 9 degrees off its axis and turns with it, which is left out.
    """
    r_N = np.asarray(position_N_m, dtype=float)
    length = np.linalg.norm(r_N, axis=-1, keepdims=True)
    along = r_N[..., 2:] * r_N / length ** 2
    return np.asarray(_EQUATOR_T * (_MEAN_RADIUS_M / length) ** 3 * (
        np.array([0.0, 0.0, 1.0]) - 3.0 * along))
