# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The simulated spacecraft whose torque comes from on/off thrusters: on-times in."""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.config.thrusters import ThrusterArray
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.sim.plant import Plant


class ThrusterPlant(Plant):
    """A body with thrusters; a command is an on-time for each (n,) [s], from its coming on.

    The same array in the next step is the same command: a thruster is on until its on-time is
    over. In the step in which it ends it pushes as long a part of it, evenly.
    """

    def __init__(self, config: SimulatorConfig, thrusters: ThrusterArray) -> None:
        """Store the configuration and put the body into its initial state."""
        self._thrusters, self.inputs = thrusters, len(thrusters)
        super().__init__(config)

    def reset(self) -> None:
        """Return to the initial state at time zero, every thruster off."""
        super().reset()
        self._command, self._left_s = np.zeros(0), np.zeros(self.inputs)
        self._torque_B = np.zeros(3)
        self.pulses, self.propellant_kg = 0, 0.0

    def _actuate(self, tau_B: Array) -> Array:
        """Return the part (n,) of this step for which each thruster is on."""
        if tau_B is not self._command:
            self._command, self._left_s = tau_B, np.array(super()._actuate(tau_B))
            self.pulses += int(np.count_nonzero(self._left_s))
        on = np.minimum(self._left_s, self.step_s)
        self._left_s = self._left_s - on
        self.propellant_kg += float(self._thrusters.flow_kg_s @ on)
        return np.asarray(on / self.step_s)

    def _limited(self, tau_B: Array) -> Array:
        """Return on-times that are not negative."""
        return np.maximum(tau_B, 0.0)

    @property
    def usage(self) -> dict[str, float]:
        """Pulses and propellant [kg] since the last reset."""
        return {'pulses': self.pulses, 'propellant_kg': self.propellant_kg}

    def _acting(self, now: Array) -> Array:
        """Return the torque (3,) of thrusters that are on for parts (n,) of a step [N m]."""
        works = self.time_s < self.config.thruster_off_from_s
        return np.asarray(self._thrusters.matrix @ (now * works))
