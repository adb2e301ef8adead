# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Magnetorquers: dipoles that dump the momentum of wheels, or brake a tumbling body.

A dipole m in a field B gives the torque m x B, across the field only. The least dipole for a
torque tau is ``B x tau / |B|^2``, which gives tau less its part along the field; beyond the limits
it is scaled down, its direction kept.
"""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.lie.arrays import Array


def dipole_for(torque_B_n_m: Array, field_B_t: Array, max_dipole_a_m2: Array) -> Array:
    """Map a torque (3,) [N m] in a field (3,) [T] to the dipole (3,) [A m^2], zero without one."""
    squared = float(field_B_t @ field_B_t)
    if squared == 0.0:
        return np.zeros(3)
    dipole = np.cross(field_B_t, torque_B_n_m) / squared
    return np.asarray(dipole / max(1.0, float((np.abs(dipole) / max_dipole_a_m2).max())))


def desaturating(stored_B_n_m_s: Array, time_s: float, field_B_t: Array, max_dipole_a_m2: Array
                 ) -> Array:
    """Return the dipole (3,) whose torque dumps what wheels store (3,) beyond what they should.

    ``tau = -stored / time``, across the field. It acts on body and wheels together: plans that
    know it (``disturbance_B_n_m``) let the wheels take it, and pointing holds. As the field turns
    on the orbit every direction is dumped in the end.
    """
    return dipole_for(-stored_B_n_m_s / time_s, field_B_t, max_dipole_a_m2)


def detumbling(omega_BN_B: Array, gain_n_m_s: float, field_B_t: Array, max_dipole_a_m2: Array
               ) -> Array:
    """Return the dipole (3,) of ``tau = -gain (omega - (omega . b) b)``, b along the field.

    This is B-dot, ``m = -gain / |B|^2 dB/dt``, for a rate that is measured and a field that turns
    slowly: dB/dt = -omega x B. It never adds energy, limits included. The gain of fastest
    convergence on an orbit of rate n and magnetic inclination xi is ``2 n (1 + sin xi)
    lambda_min(J)`` (Avanzini and Giulietti, J. Guid. Control Dyn. 35, 2012).
    """
    return dipole_for(-gain_n_m_s * omega_BN_B, field_B_t, max_dipole_a_m2)
