# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Control loop and plant in one process: states of any age in, torques with any delay out."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scripted import gate

from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.control.command import Command, Law
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.solver_thread import DirectSolver, solve_with
from manifold_mpc_ros.control.tick_time import ClockTime
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.sim.plant_loop import PlantLoop

EPOCH_NS = 10**9


class Flight(NamedTuple):
    """Error angle (n,) [rad], rate (n, 3) [rad/s] at every plant step [s], and the commands."""

    step_s: float
    angle_rad: np.ndarray
    rate_rad_s: np.ndarray
    commands: list[Command]
    loop: ControlLoop

    def settled_s(self, angle_rad: float) -> float:
        """Return the time after which the angle stays below this."""
        outside = np.flatnonzero(self.angle_rad >= angle_rad)
        return self.step_s * (int(outside[-1]) + 1 if outside.size else 0)


def fly(
    mpc: AttitudeMpc, duration_s: float, *, plant: dict[str, Any], law: dict[str, Any],
    age_steps: int = 0,
) -> Flight:
    """Close the loop; every tick has the state of so many plant steps before it."""
    mpc.reset()
    config = mpc.config
    loop = ControlLoop(Law(config, DirectSolver(solve_with(mpc)), 2.5, **law), gate(),
                       initial_setpoint='identity')
    body = PlantLoop(SimulatorConfig(**{
        'inertia_kg_m2': config.inertia_kg_m2, 'max_torque_n_m': config.max_torque_n_m,
        'control_period_s': config.step_s, **plant}), EPOCH_NS)
    steps, commands, samples = round(config.step_s * 1e9 / body.step_ns), [], [body.measure()]
    for _ in range(round(duration_s / config.step_s)):
        loop.admit(samples[max(0, len(samples) - 1 - age_steps)])
        commands.append(loop.tick(ClockTime(body.stamp_ns)))
        body.command(commands[-1].torque_B_n_m)
        for _ in range(steps):
            body.advance(1)
            samples.append(body.measure())
    return Flight(body.step_ns / 1e9, so3.angle(np.array([s.R_NB for s in samples])),
                  np.array([s.omega_BN_B for s in samples]), commands, loop)
