# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A slew on on/off thrusters, and the limit cycle after it against the shortest pulse.

    python benchmarks/thrusters.py [--output docs/results/thrusters.json]

Twelve thrusters of 0.5 N on arms of 0.4 m, pulses of 20 ms or more, a slew of 86 degrees and ten
minutes of holding: without a disturbance; with one that plans do not know of; with the thruster
that pushes longest stuck off from 5 s on, found by the answer of the body, named as failed 5 s
later, or neither. One pulse changes the rate about a body axis by F l t_min / J; the amplitude of
the rate is in parts of it.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from manifold_mpc_ros import AttitudeMpc, AttitudeMpcConfig
from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.config.thrusters import ThrusterArray
from manifold_mpc_ros.control.devices.thruster_actuator import ThrusterActuator
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.sim.thruster_plant import ThrusterPlant

RESULT = Path(__file__).parents[1] / 'docs' / 'results' / 'thrusters.json'
INERTIA, STEP_S, TICKS, LATE = np.diag([2.0, 1.5, 1.0]), 0.5, 1200, 300
PLACES = 0.4 * np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0]])
PUSHES = np.array([[0, 0, 1], [0, 0, 1], [1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]])
THRUSTERS = ThrusterArray(np.vstack([PLACES, PLACES]), np.vstack([PUSHES, -PUSHES]),
                          0.5)  # type: ignore[arg-type]


def run(told: Mapping[float, Sequence[str]] | None = None, *, watched: bool = True, **changes: Any
        ) -> tuple[dict[str, Any], int]:
    """Slew and hold; return errors, rates, pulses and propellant, and what pushed longest."""
    mpc = AttitudeMpc(AttitudeMpcConfig(
        inertia_kg_m2=INERTIA, step_s=STEP_S, horizon=40, attitude_weight=np.eye(3),
        rate_weight=2.0 * np.eye(3), torque_weight=10.0 * np.eye(3), max_torque_n_m=0.15,
        max_rate_rad_s=np.radians(8.0), thrusters=THRUSTERS))
    w, x, y, z = so3.quaternion_from_rotation(so3.exp([1.2, 0.5, -0.8]))
    plant = ThrusterPlant(SimulatorConfig(
        inertia_kg_m2=INERTIA, initial_attitude_xyzw=(x, y, z, w), thrusters=THRUSTERS,
        **changes), THRUSTERS)
    actuator = ThrusterActuator(THRUSTERS, STEP_S, INERTIA if watched else None)
    found_s: float | None = None
    errors, rates, on = [], [], np.zeros(12)
    for k in range(TICKS):
        if told and k * STEP_S in told:
            actuator = ThrusterActuator(
                replace(THRUSTERS, failed=told[k * STEP_S]), STEP_S)
        actuator.observe(plant.omega_BN_B, None)
        if actuator.found and found_s is None:
            found_s = k * STEP_S
        torque = mpc.solve(plant.R_NB, plant.omega_BN_B).torque_B_n_m
        done = actuator.allocate(actuator.limited(torque))
        on += done.device
        for _ in range(round(STEP_S / plant.step_s)):
            plant.step(done.device)
        errors.append(float(so3.angle(plant.R_NB)))
        rates.append(plant.omega_BN_B)
        if len(errors) == LATE:
            early = dict(plant.usage)
    bit = THRUSTERS.min_on_time_s[0] * np.abs(THRUSTERS.matrix).max() / np.diag(INERTIA)
    late = np.degrees(errors[LATE:])
    outside = int(np.flatnonzero(np.degrees(errors) > 0.2)[-1])
    found = {'found': actuator.found, 'found_s': found_s,
             'settled_s': None if outside == TICKS - 1 else STEP_S * (1 + outside),
             'largest_error_late_deg': float(late.max()),
             'largest_rate_late_in_pulses': (np.abs(rates[LATE:]).max(axis=0) / bit).tolist(),
             'pulses': early['pulses'], 'propellant_g': 1e3 * early['propellant_kg'],
             'pulses_late_per_min': 60.0 * (plant.usage['pulses'] - early['pulses']) / (
                (TICKS - LATE) * STEP_S),
             'propellant_late_mg_per_min': 6e7 * (
                 plant.usage['propellant_kg'] - early['propellant_kg']) / (
                     (TICKS - LATE) * STEP_S)}
    return found, int(np.argmax(on))


def main() -> None:
    """Run every case, write and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument('--output', type=Path, default=RESULT)
    given = parser.parse_args()
    alone, longest = run()
    off = np.where(np.arange(12) == longest, 5.0, np.inf)
    text = json.dumps({
        'alone': alone, 'disturbed': run(disturbance_torque_n_m=(2e-4, -1e-4, 5e-5))[0],
        'stuck_off': run(thruster_off_from_s=off)[0],
        'stuck_off_told': run({10.0: [THRUSTERS.names[longest]]}, watched=False,
                              thruster_off_from_s=off)[0],
        'stuck_off_untold': run(watched=False, thruster_off_from_s=off)[0]}, indent=2)
    given.output.write_text(text + '\n', encoding='utf-8')
    print(text)


if __name__ == '__main__':
    main()
