# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Magnetorquers: dipoles that dump the momentum of wheels, or brake a tumbling body.

A dipole m in a field B gives the torque m x B, across the field only. The least dipole for a
torque tau is ``B x tau / |B|^2``, which gives tau less its part along the field; beyond the limits
it is scaled down, its direction kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from manifold_mpc_ros.config.wheel_parameters import Magnetorquers
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.control.actuator import Actuation, TorqueActuator, scaled_into
from manifold_mpc_ros.control.input_gate import NANOSECONDS, StateSample
from manifold_mpc_ros.dynamics.inertia import existence_guard
from manifold_mpc_ros.lie.arrays import Array


def dipole_for(torque_B_n_m: Array, field_B_t: Array, max_dipole_a_m2: Array) -> Array:
    """Map a torque (3,) [N m] in a field (3,) [T] to the dipole (3,) [A m^2], zero without one."""
    squared = float(field_B_t @ field_B_t)
    if squared == 0.0:
        return np.zeros(3)
    dipole = np.cross(field_B_t, torque_B_n_m) / squared * (max_dipole_a_m2 > 0.0)
    return scaled_into(dipole, np.where(max_dipole_a_m2 > 0.0, max_dipole_a_m2, np.inf))


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


class OnlyMagnetorquers(TorqueActuator):
    """The actuator ``magnetorquers``: no torque can be promised, dipoles brake a tumble."""

    refusal = 'magnetorquers alone give torque across the field only: they brake'

    def allocate(self, torque_B_n_m: Array) -> Actuation:
        """Command no body torque, whatever is asked for."""
        return super().allocate(0.0 * torque_B_n_m)


@dataclass(frozen=True, eq=False)
class FieldReport:
    """A measured magnetic field (3,) in body axes [T], and its stamp [ns]."""

    stamp_ns: int
    field_B_t: Array


class DipoleLaw:
    """What magnetorquers are commanded, by the field that was measured last.

    Arguments
    ---------
    given
        Limits and gains.
    wheels
        The wheels whose momentum is dumped, None where magnetorquers are alone.
    inertia_kg_m2
        J (3, 3) of the body.

    ``missing`` says why there is no dipole, empty while there may be one.
    """

    def __init__(self, given: Magnetorquers, wheels: WheelArray | None, inertia_kg_m2: Array
                 ) -> None:
        """Begin without a field."""
        self._given, self._wheels = given, wheels
        self._gain_n_m_s = given.braking_gain * existence_guard(inertia_kg_m2)
        self._field_B_t = np.zeros(3)
        self.missing = ''

    def observe(self, sample: StateSample, report: FieldReport | None) -> None:
        """Take the field at a state; one older than it may be counts for nothing."""
        self.missing, self._field_B_t = 'no magnetic field has come: no dipole', np.zeros(3)
        if report is None:
            return
        age_s = (sample.stamp_ns - report.stamp_ns) / NANOSECONDS
        if age_s > self._given.field_timeout_s:
            self.missing = f'the magnetic field is {age_s:.3g} s old: no dipole'
            return
        self.missing, self._field_B_t = '', report.field_B_t

    def dumping(self, momentum_n_m_s: Array | None, error_rad: float) -> Array:
        """Map momenta of the wheels (n,) and the pointing error to a dipole (3,) [A m^2].

        Zero unless the error is small; wheels that are not reported (NaN) are left out.
        """
        if self._wheels is None or momentum_n_m_s is None or not (
                error_rad <= self._given.max_error_rad):
            return np.zeros(3)
        stored = self._wheels.axes_B.T @ np.nan_to_num(momentum_n_m_s)
        return desaturating(stored, self._given.dump_time_s, self._field_B_t,
                            self._given.max_dipole_a_m2)

    def braking(self, omega_BN_B: Array) -> Array:
        """Map the body rate (3,) [rad/s] to the dipole (3,) that brakes it [A m^2]."""
        return detumbling(
            omega_BN_B, self._gain_n_m_s, self._field_B_t, self._given.max_dipole_a_m2)

    def torque(self, dipole_B_a_m2: Array) -> Array:
        """Return what a dipole (3,) gives in the field (3,) [N m]."""
        return np.cross(dipole_B_a_m2, self._field_B_t)
