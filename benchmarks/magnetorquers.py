# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Magnetorquers of a 6U in orbit: wheels desaturated while it points, and a tumble braked.

    python benchmarks/magnetorquers.py [--output docs/results/magnetorquers.json]

500 km, 97.4 degrees, 0.5 A m^2 about each axis, gravity gradient acting. Desaturation: four
wheels hold 80 % of what fits in every attitude, until they hold 10 %; plans know the torque of the
dipole, not the gravity gradient. Detumbling: magnetorquers alone, from 5 deg/s about several axes.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from manifold_mpc_ros import AttitudeMpc, AttitudeMpcConfig, WheelArray
from manifold_mpc_ros.config.orbit import CircularOrbit
from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.config.wheel_parameters import WheelMotors
from manifold_mpc_ros.control.devices import magnetorquers
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.sim.plant import Plant
from manifold_mpc_ros.sim.wheel_plant import WheelPlant

RESULT = Path(__file__).parents[1] / 'docs' / 'results' / 'magnetorquers.json'
INERTIA = np.diag([0.05, 0.06, 0.02])
AXES_B = [[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]]
AXES_B_T = np.array(AXES_B).T / np.sqrt(3.0)
WHEEL_INERTIA, DIPOLE = 1.72e-5, np.full(3, 0.5)
ORBIT = CircularOrbit(500e3, np.radians(97.4), 0.3, 0.2)
STEP_S, TIME_S = 1.0, 600.0


def desaturation(direction_B: list[float]) -> dict[str, Any]:
    """Dump momentum while pointing; return how long it took and the largest pointing error."""
    wheels = WheelArray(AXES_B, 7e-4, 0.01082, inertia_kg_m2=WHEEL_INERTIA)
    reach = float(wheels.momenta.bounds.min())
    stored = 0.8 * reach * np.array(direction_B) / np.linalg.norm(direction_B)
    motors = WheelMotors(wheels, wheels.inverse @ stored / WHEEL_INERTIA)
    plant = WheelPlant(SimulatorConfig(
        inertia_kg_m2=INERTIA, step_s=0.25, state_period_s=STEP_S, control_period_s=STEP_S,
        initial_attitude_xyzw=(0.0, 0.0, 0.0, 1.0), orbit=ORBIT, wheel_motors=motors), motors)
    mpc = AttitudeMpc(AttitudeMpcConfig(
        inertia_kg_m2=INERTIA, step_s=STEP_S, horizon=30, attitude_weight=np.eye(3),
        rate_weight=2.0 * np.eye(3), torque_weight=1e4 * np.eye(3), max_torque_n_m=3e-3,
        max_rate_rad_s=np.radians(3.0), wheels=wheels))
    largest, used, k = 0.0, 0.0, 0
    while np.linalg.norm(AXES_B_T @ plant.momentum_n_m_s) > 0.1 * reach and k < 20_000:
        field_B, stored = plant.field_B_t, AXES_B_T @ plant.momentum_n_m_s
        dipole = magnetorquers.desaturating(stored, TIME_S, field_B, DIPOLE)
        plant.dipole_B_a_m2 = dipole
        plan = mpc.solve(plant.R_NB, plant.omega_BN_B,
                         wheel_momentum_n_m_s=plant.momentum_n_m_s,
                         disturbance_B_n_m=np.cross(dipole, field_B))
        assert plan.wheel_torque_n_m is not None
        for _ in range(round(STEP_S / plant.step_s)):
            plant.step(plan.wheel_torque_n_m)
        largest = max(largest, float(so3.angle(plant.R_NB)))
        used, k = max(used, float(np.abs(dipole).max())), k + 1
    left = float(np.linalg.norm(AXES_B_T @ plant.momentum_n_m_s)) / reach
    return {'stored': 0.8, 'left': left, 'time_s': k * STEP_S,
            'largest_error_deg': float(np.degrees(largest)), 'largest_dipole_a_m2': used}


def detumble(rate_rad_s: list[float]) -> dict[str, Any]:
    """Brake a body by magnetorquers alone; return its rate after each orbit."""
    plant = Plant(SimulatorConfig(
        inertia_kg_m2=INERTIA, step_s=0.5, state_period_s=STEP_S, control_period_s=STEP_S,
        initial_rate_rad_s=np.array(rate_rad_s), orbit=ORBIT))
    n = ORBIT.rate_rad_s
    gain = 2.0 * n * (1.0 + np.sin(ORBIT.inclination_rad)) * float(np.diag(INERTIA).min())
    rates = []
    for _ in range(3):
        for _ in range(round(2.0 * np.pi / n / STEP_S)):
            plant.dipole_B_a_m2 = magnetorquers.detumbling(
                plant.omega_BN_B, gain, plant.field_B_t, DIPOLE)
            plant.step(np.zeros(3))
            plant.step(np.zeros(3))
        rates.append(float(np.degrees(np.linalg.norm(plant.omega_BN_B))))
    return {'begin_deg_s': float(np.degrees(np.linalg.norm(rate_rad_s))),
            'after_each_orbit_deg_s': rates}


def main() -> None:
    """Run, write and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument('--output', type=Path, default=RESULT)
    given = parser.parse_args()
    five = np.radians(5.0)
    found = {'orbit_s': 2.0 * np.pi / ORBIT.rate_rad_s,
             'desaturation': [desaturation(d) for d in ([1, 0, 0], [0, 1, 1], [1, -1, 1])],
             'detumbling': [detumble((five * np.array(d)).tolist()) for d in (
                 [1, 0, 0], [0, 0, 1], [0.6, -0.6, 0.53])]}
    text = json.dumps(found, indent=2)
    given.output.write_text(text + '\n', encoding='utf-8')
    print(text)


if __name__ == '__main__':
    main()
