# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An attitude error that stays: told from one that is being turned away."""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.input_gate import StateSample
from manifold_mpc_ros.control.target import Target
from manifold_mpc_ros.lie import so3

#: A mean error that falls by less than this part in a horizon stays.
LEAST_FALL = 0.05


class SteadyError:
    """Watches the errors of attitude (or pointing) and rate; the first over two horizons.

    ``attitude_rad`` and ``rate_rad_s`` are of the last tick, NaN before the first. An error of at
    most ``largest_rad`` may stay. ``stays_rad`` is the mean attitude error of the last horizon
    where it is too large and stays, else None.
    """

    def __init__(self, config: AttitudeMpcConfig, largest_rad: float) -> None:
        """Start with no tick."""
        self._axis_B = config.pointing_axis_B if config.target == 'pointing' else None
        self._horizon, self._largest_rad = config.steps.in_periods, largest_rad
        self.attitude_rad = self.rate_rad_s = float('nan')
        self.forget()

    def forget(self) -> None:
        """Begin anew: something else is aimed at, or no torque reduces the error."""
        self._errors: list[float] = []
        self.stays_rad: float | None = None

    def see(self, sample: StateSample | None, target: Target | None, *, reduced: bool) -> None:
        """Take the state of a tick; ``reduced``: its torque is to reduce the error."""
        if sample is None or target is None:
            return
        R_ND, omega_DN_D = target.at(sample.stamp_ns)
        omega_BN_B = sample.omega_BN_B - sample.R_NB.T @ R_ND @ omega_DN_D
        if self._axis_B is not None:  # roll is free
            omega_BN_B = np.cross(self._axis_B, omega_BN_B)
        self.attitude_rad = float(so3.angle(R_ND.T @ sample.R_NB, self._axis_B))
        self.rate_rad_s = float(np.linalg.norm(omega_BN_B))
        self._errors = [*self._errors[1 - 2 * self._horizon:], self.attitude_rad]
        if reduced:
            self.stays_rad = self._staying_rad()
        else:
            self.forget()

    def _staying_rad(self) -> float | None:
        """Compare the last horizon with the one before it."""
        errors = self._errors
        if len(errors) < 2 * self._horizon or min(errors) <= self._largest_rad:
            return None
        earlier, later = np.reshape(errors, (2, -1)).mean(axis=1)
        return float(later) if abs(later - earlier) <= LEAST_FALL * earlier else None
