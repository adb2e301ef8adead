# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The gate at the exit: every torque that leaves is finite, within the limits, and no jump."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from manifold_mpc_ros.control.actuator import Actuation, Actuator
from manifold_mpc_ros.control.devices.magnetorquers import DipoleLaw, FieldReport
from manifold_mpc_ros.control.input_gate import StateSample
from manifold_mpc_ros.lie.arrays import Array

#: On the way back to the optimiser the torque changes by at most this part of the limit a tick.
SLEW_FRACTION = 0.5


class OutputGate:
    """Hands torques (3,) [N m] to the actuator: zero for what is not finite, else within limits.

    Arguments
    ---------
    actuator
        What limits a torque, and turns it into the command of its devices.

    """

    def __init__(self, actuator: Actuator) -> None:
        """Start at zero torque."""
        self.actuator = actuator
        self.devices: Array | None = None
        self.dipoles: DipoleLaw | None = None
        self.field: FieldReport | None = None
        self._dipole_B_a_m2 = np.zeros(3)
        self.latest = actuator.rest()
        self.not_finite = 0
        self.saturated = 0
        self._returning = False

    def use(self, actuator: Actuator, delay_s: float) -> None:
        """Hand torques to this one; it watches its devices only where torque acts at once."""
        self.actuator = actuator
        actuator.watches &= delay_s == 0.0

    def observe(self, omega_BN_B: Array) -> None:
        """Hand the body rate (3,) [rad/s] when a command acts, and ``devices``, to the actuator.

        ``devices`` is what the devices last reported, in the unit of the kind.
        """
        self.devices = self.actuator.observe(omega_BN_B, self.devices)

    def magnetise(self, sample: StateSample, error_rad: float) -> Array | None:
        """Choose the dipole beside the next torque; return its torque (3,) [N m], None without.

        At a state and its pointing error [rad], by the latest measured ``field``: it brakes where
        the actuator can give no torque, else it dumps what wheels store.
        """
        if self.dipoles is None:
            return None
        self.dipoles.observe(sample, self.field)
        self._dipole_B_a_m2 = (
            self.dipoles.braking(sample.omega_BN_B) if self.actuator.refusal
            else self.dipoles.dumping(self.devices, error_rad))
        return self.dipoles.torque(self._dipole_B_a_m2)

    def slew(self) -> None:
        """Come back without a jump: change gradually until what is asked for is reached."""
        self._returning = True

    def let_through(self, torque_B_n_m: Array) -> Actuation:
        """Return the command for a torque, the direction of what is asked for kept."""
        asked = np.asarray(torque_B_n_m, dtype=np.float64)
        if asked.shape != (3,) or not np.isfinite(asked).all():
            self.not_finite += 1
            asked = np.zeros(3)
        limited = self.actuator.limited(asked)
        self.saturated += limited is not asked
        if self._returning:
            limited = self._towards(limited)
        self.latest = self.actuator.allocate(limited)
        if self.dipoles is not None:
            dipole, self._dipole_B_a_m2 = self._dipole_B_a_m2, np.zeros(3)
            self.latest = replace(self.latest, dipole_B_a_m2=dipole,
                                  dipole_torque_B_n_m=self.dipoles.torque(dipole))
        return self.latest

    def zero(self) -> Actuation:
        """Return the command for zero torque, at once."""
        self._returning = False
        self.latest = self.actuator.rest()
        return self.latest

    def _towards(self, asked: Array) -> Array:
        """Return the torque on the straight line to what is asked for that may be reached now."""
        with np.errstate(over='ignore'):
            change = asked - self.latest.torque_B_n_m
        if not np.isfinite(change).all():  # without a limit, from one end of floats to the other
            self._returning = False
            return asked
        step = self.actuator.limited(change, SLEW_FRACTION)
        self._returning = step is not change
        return self.latest.torque_B_n_m + step if self._returning else asked
