# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The simulated spacecraft whose torque comes from reaction wheels: motor torques in."""

from __future__ import annotations

import math

import numpy as np

from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.config.wheel_parameters import WheelMotors
from manifold_mpc_ros.dynamics import scalar_form
from manifold_mpc_ros.dynamics.wheel_step import wheel_step
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.sim.plant import Plant


class WheelPlant(Plant):
    """A body with wheels; a command is one motor torque a wheel (n,) [N m].

    The inertial momentum of body and wheels is kept to rounding while no disturbance acts,
    whatever motors, friction and failures do: they act between wheel and body.
    """

    def __init__(self, config: SimulatorConfig, motors: WheelMotors) -> None:
        """Store the configuration and put body and wheels into their initial state."""
        self.motors, self._axes_B = motors, motors.wheels.axes_B.T
        self.inputs = len(motors.wheels)
        super().__init__(config)

    def reset(self) -> None:
        """Return to the initial state at time zero."""
        super().reset()
        # The third stream of the seed; those of attitude and rate are the first two.
        self._speed_noise = np.random.default_rng(
            np.random.SeedSequence(self.config.seed).spawn(3)[2])
        self.momentum_n_m_s = self.motors.inertia_kg_m2 * (
            self.motors.initial_speed_rad_s + self._omega_BN_B @ self._axes_B)

    @property
    def speed_rad_s(self) -> Array:
        """Speeds of the wheels about their axes, in the body (n,) [rad/s]."""
        return np.asarray(
            self.momentum_n_m_s / self.motors.inertia_kg_m2 - self._omega_BN_B @ self._axes_B)

    def measure_speed(self) -> Array:
        """Return what the wheels report (n,) [rad/s]: each call draws its own noise."""
        std = self.motors.speed_noise_std_rad_s
        return self.speed_rad_s + self._speed_noise.normal(size=self.inputs) * std if (
            std.any()) else self.speed_rad_s

    def _limited(self, command: Array) -> Array:
        """Return motor torques within the motors' limits, others counted."""
        limit = self.motors.wheels.max_torque_n_m
        self.counters.saturated += bool((np.abs(command) > limit).any())
        return np.clip(command, -limit, limit)

    def _substeps_needed(self) -> int:
        """Return the number of substeps, as without wheels; their momentum counts in whole."""
        stored = float(np.abs(self.momentum_n_m_s).sum())
        body = math.hypot(*scalar_form.apply(self._inertia_rows, self._omega_BN_B.tolist()))
        torque = 2.0 * float(self.motors.wheels.max_torque_n_m.sum()) + self._disturbance_n_m
        return self._substeps(body + 2.0 * stored, torque)

    def _turned(self, external_B: Array, step_s: float) -> tuple[Array, Array]:
        """Take one step of motors, bearings and body under a torque from outside."""
        net = self.motors.net_torques(
            self._torque_B, self.speed_rad_s, self.momentum_n_m_s, self.time_s, step_s)
        turned = wheel_step(
            self._R_NB, self._omega_BN_B, self._axes_B @ self.momentum_n_m_s,
            self._axes_B @ net, external_B, inertia_kg_m2=self.config.inertia_kg_m2,
            step_s=step_s)
        self.momentum_n_m_s = self.momentum_n_m_s + step_s * net
        return turned

    @property
    def _mass_inertia(self) -> Array:
        """The inertia (3, 3) of body and wheels [kg m^2]."""
        return np.asarray(self.config.inertia_kg_m2
                          + self._axes_B * self.motors.inertia_kg_m2 @ self._axes_B.T)
