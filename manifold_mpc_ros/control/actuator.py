# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What an actuator is: body torque in, device command and realised torque out.

A kind of actuator is one file beside this one, with a class that is an `Actuator`, and one entry
in the table `ACTUATORS` (config/interfaces.py), which names the class.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig

Array = NDArray[np.float64]

#: A realised torque within this part of the planned one's largest component is the planned one.
TORQUE_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Actuation:
    """What an actuator was commanded in a tick.

    ``torque_B_n_m`` (3,) is the body torque that was asked of it, within its limits [N m];
    ``device`` (n,) the command to its n devices, in the unit of the kind; ``realised_B_n_m`` (3,)
    the body torque that this command gives [N m], by which the state is moved on to the next tick
    and the Lyapunov decrease is judged.
    """

    torque_B_n_m: Array
    device: Array
    realised_B_n_m: Array

    def realises(self, torque_B_n_m: Array) -> bool:
        """Return whether this gives a planned torque (3,) [N m], unchanged but for rounding."""
        allowed = TORQUE_ROUNDING * float(np.abs(torque_B_n_m).max())
        return bool((np.abs(self.realised_B_n_m - torque_B_n_m) <= allowed).all())


class Actuator(Protocol):
    """Devices that turn the body. They give zero torque, and a convex set of torques about it.

    ``refusal`` says why they can give no torque now, empty when they can: what is allocated is
    then the best that they can do to brake.
    """

    refusal: str

    @classmethod
    def from_config(cls, config: AttitudeMpcConfig) -> Actuator:
        """Return the actuator of a spacecraft."""

    def observe(self, omega_BN_B: Array, devices: Array | None) -> None:
        """Take the body rate (3,) [rad/s] and what the devices report, None where they do not."""

    def limited(self, torque_B_n_m: Array, part: float = 1.0) -> Array:
        """Map a finite torque (3,) [N m] to one that the devices can give, its direction kept.

        Of the set of torques only this ``part`` is used. A torque that is in it already is
        returned itself, the same object.
        """

    def allocate(self, torque_B_n_m: Array) -> Actuation:
        """Map a torque (3,) [N m] within the limits to the command of this tick."""

    def rest(self) -> Actuation:
        """Return the command that asks nothing of the devices."""
