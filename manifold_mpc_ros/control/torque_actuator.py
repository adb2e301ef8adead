# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The actuator ``torque``: a body torque, given by somebody else's devices, within a box."""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.actuator import Actuation, Array
from manifold_mpc_ros.control.fallback_law import scaled_into


class TorqueActuator:
    """The device command is the body torque [N m], and all of it is realised.

    Arguments
    ---------
    max_torque_n_m
        Half widths of the box (3,) [N m], inf where there is no limit; None for no limit at all.

    """

    refusal = ''

    def __init__(self, max_torque_n_m: Array | None) -> None:
        """Keep the limits."""
        self._limit = np.full(3, np.inf) if max_torque_n_m is None else max_torque_n_m

    @classmethod
    def from_config(cls, config: AttitudeMpcConfig) -> TorqueActuator:
        """Return the actuator with the torque limits of a configuration."""
        return cls(config.max_torque_n_m)

    def observe(self, omega_BN_B: Array, devices: Array | None) -> None:
        """Do nothing: what the box gives does not depend on a state."""

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
