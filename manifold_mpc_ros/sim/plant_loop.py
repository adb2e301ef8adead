# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plant between messages: simulated time, the command in force and its age. Pure logic."""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.config.control_law import SimulatorConfig
from manifold_mpc_ros.control.input_gate import NANOSECONDS, StateSample, to_ns
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.sim.plant import Plant
from manifold_mpc_ros.sim.thruster_plant import ThrusterPlant
from manifold_mpc_ros.sim.wheel_plant import WheelPlant

#: Age of the command in force, in control periods, above which the next one is overdue.
OVERDUE_PERIODS = 1.5


class PlantLoop:
    """A plant with stamps, and a torque that ends by itself.

    Arguments
    ---------
    config
        Plant and timing.
    epoch_ns
        Stamp of the first state [ns]; later stamps are whole plant steps after it. A reset puts
        the plant back, not the time: stamps only ever grow.

    """

    def __init__(self, config: SimulatorConfig, epoch_ns: int) -> None:
        """Build the plant in its initial state, without a command."""
        self._plant = (
            WheelPlant(config, config.wheel_motors) if config.wheel_motors is not None
            else ThrusterPlant(config, config.thrusters) if config.thrusters is not None
            else Plant(config))
        self.step_ns = to_ns(config.step_s)
        self._life_steps = round(config.command_life_s / config.step_s)
        self._overdue_steps = round(OVERDUE_PERIODS * config.steps_per_control)
        self._epoch_ns = epoch_ns
        self._skipped_ns = 0
        self.steps = 0
        self.expired = 0
        self.latched = ''
        self.release()

    @property
    def stamp_ns(self) -> int:
        """Simulated time now [ns]."""
        return self._epoch_ns + self._skipped_ns + self.steps * self.step_ns

    @property
    def elapsed_s(self) -> float:
        """Time that the plant has moved on since the first state [s]."""
        return self.steps * self.step_ns / NANOSECONDS

    @property
    def overdue(self) -> bool:
        """Whether the command in force should have been replaced by now."""
        return 0 <= self._steps_left <= self._life_steps - self._overdue_steps

    def skip_to(self, stamp_ns: int) -> None:
        """Let time without the plant pass: the present state has this stamp, if it is later."""
        self._skipped_ns += max(0, stamp_ns - self.stamp_ns)

    def reset(self) -> None:
        """Put the plant back to its initial state, without a command, one step later."""
        self._plant.reset()
        self.steps += 1
        self.latched = ''
        self.release()

    def command(self, torque_B_n_m: Array) -> None:
        """Put a torque in force [N m], until the next one or the end of its life."""
        if self.latched:
            return
        self._torque_B = torque_B_n_m
        self._steps_left = self._life_steps

    def magnetise(self, dipole_B_a_m2: Array) -> None:
        """Put a dipole (3,) [A m^2] in force within its limits, as long as commands are."""
        if not self.latched:
            limit = self._plant.config.max_dipole_a_m2
            self._plant.dipole_B_a_m2 = np.clip(dipole_B_a_m2, -limit, limit)

    def latch(self, reason: str) -> None:
        """Put zero torque in force until a reset; the first reason stays."""
        self.latched = self.latched or reason
        self.release()

    def release(self) -> None:
        """Put zero torque and dipole in force, which have no end of life."""
        self._torque_B = np.zeros(self._plant.inputs)
        self._plant.dipole_B_a_m2 = np.zeros(3)
        self._steps_left = -1

    def advance(self, steps: int) -> None:
        """Move on by ``steps`` plant steps under the command in force, zero after its life."""
        for _ in range(steps):
            if self._steps_left == 0:
                self.expired += 1
                self.release()
            self._steps_left -= 1
            self._plant.step(self._torque_B)
            self.steps += 1

    def measure(self) -> StateSample:
        """Return what the sensors say now; each call draws its own noise."""
        R_NB, omega_BN_B = self._plant.measure()
        return StateSample(self.stamp_ns, R_NB, omega_BN_B)

    def measure_wheels(self) -> Array | None:
        """Return what wheels report, speeds in the body (n,) [rad/s], None without wheels."""
        return self._plant.measure_speed() if isinstance(self._plant, WheelPlant) else None

    @property
    def field_B_t(self) -> Array:
        """Magnetic field (3,) in body axes [T], zero without an orbit."""
        return self._plant.field_B_t

    def counters(self) -> dict[str, float]:
        """Return what has happened to the plant since its last reset, and commands in force."""
        return {**vars(self._plant.counters), 'expired_commands': self.expired,
                'commands_in_force': int(self._steps_left >= 0), **self._plant.usage}
