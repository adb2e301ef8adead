# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What an actuator is: body torque in, device command and realised torque out.

A kind of actuator is one class that is an `Actuator`, such as `TorqueActuator` here, and one entry
in the table `ACTUATORS` (config/interfaces.py), which names the class.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Protocol

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.arrays import Array

#: A realised torque within this part of the planned one's largest component is the planned one.
TORQUE_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Actuation:
    """What an actuator was commanded in a tick.

    ``torque_B_n_m`` (3,) is the body torque that was asked of it, within its limits [N m];
    ``device`` (n,) the command to its n devices, in the unit of the kind; ``realised_B_n_m`` (3,)
    the body torque that this command gives [N m], by which the state is moved on to the next tick
    and the Lyapunov decrease is judged. ``dipole_B_a_m2`` (3,) is commanded to magnetorquers
    beside them, with the torque ``dipole_torque_B_n_m`` (3,) in the field that was measured.
    """

    torque_B_n_m: Array
    device: Array
    realised_B_n_m: Array
    dipole_B_a_m2: Array = field(default_factory=lambda: np.zeros(3))
    dipole_torque_B_n_m: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def acting_B_n_m(self) -> Array:
        """The body torque (3,) of devices and dipole together [N m]."""
        if not self.dipole_torque_B_n_m.any():
            return self.realised_B_n_m
        return self.realised_B_n_m + self.dipole_torque_B_n_m

    def realises(self, torque_B_n_m: Array) -> bool:
        """Return whether this gives a planned torque (3,) [N m], unchanged but for rounding."""
        allowed = TORQUE_ROUNDING * float(np.abs(torque_B_n_m).max())
        return bool((np.abs(self.realised_B_n_m - torque_B_n_m) <= allowed).all())


class Actuator(Protocol):
    """Devices that turn the body. They give zero torque, and a convex set of torques about it.

    ``refusal`` says why they can give no torque now, empty when they can: what is allocated is
    then the best that they can do to brake. ``found`` says which of them do not do what they are
    asked, for as long as the actuator lives; looked for while ``watches``.
    """

    refusal: str
    found: str
    watches: bool
    #: The command (n,) that the plan of this tick found: of those that turn as much, what is
    #: allocated is nearest to it. None: whatever is best now.
    planned: Array | None
    #: What its devices did last and have used, by the keys of diagnostics.
    usage: Mapping[str, float]

    @classmethod
    def from_config(cls, config: AttitudeMpcConfig) -> Actuator:
        """Return the actuator of a spacecraft."""

    def observe(self, omega_BN_B: Array, devices: Array | None) -> Array | None:
        """Take the body rate (3,) [rad/s] and what the devices report, None where they do not.

        Return the report with NaN for devices that are not to be used.
        """

    def limited(self, torque_B_n_m: Array, part: float = 1.0) -> Array:
        """Map a finite torque (3,) [N m] to one that the devices can give, its direction kept.

        Of the set of torques only this ``part`` is used. A torque that is in it already is
        returned itself, the same object.
        """

    def allocate(self, torque_B_n_m: Array) -> Actuation:
        """Map a torque (3,) [N m] within the limits to the command of this tick."""

    def rest(self) -> Actuation:
        """Return the command that asks nothing of the devices."""


class TorqueActuator:
    """The actuator ``torque``: a body torque, given by somebody else's devices, within a box.

    The device command is the body torque [N m], and all of it is realised.

    Arguments
    ---------
    max_torque_n_m
        Half widths of the box (3,) [N m], inf where there is no limit; None for no limit at all.

    """

    refusal = found = ''
    watches = True
    planned: Array | None = None
    usage: Mapping[str, float] = MappingProxyType({})

    def __init__(self, max_torque_n_m: Array | None) -> None:
        """Keep the limits."""
        self._limit = np.full(3, np.inf) if max_torque_n_m is None else max_torque_n_m

    @classmethod
    def from_config(cls, config: AttitudeMpcConfig) -> TorqueActuator:
        """Return the actuator with the torque limits of a configuration."""
        return cls(config.max_torque_n_m)

    def observe(self, omega_BN_B: Array, devices: Array | None) -> Array | None:  # noqa: ARG002
        """Do nothing: what the box gives does not depend on a state."""
        return devices

    def limited(self, torque_B_n_m: Array, part: float = 1.0) -> Array:
        """Scale a finite torque (3,) [N m] into this part of the box."""
        limit = part * self._limit
        if (np.abs(torque_B_n_m) > limit).any():
            return scaled_into(torque_B_n_m, limit)
        return torque_B_n_m

    def allocate(self, torque_B_n_m: Array) -> Actuation:
        """Command the torque (3,) [N m] itself."""
        return Actuation(torque_B_n_m, torque_B_n_m, torque_B_n_m)

    def rest(self) -> Actuation:
        """Command zero torque."""
        return self.allocate(np.zeros(3))


def scaled_into(torque: Array, limit: Array) -> Array:
    """Return a finite vector (3,) scaled into the box |.| <= limit, its direction kept."""
    with np.errstate(divide='ignore', over='ignore'):
        scale = float(np.min(limit / np.abs(torque), initial=1.0, where=torque != 0.0))
    return np.asarray(np.clip(scale * torque, -limit, limit))
