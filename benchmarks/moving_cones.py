# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A Sun that passes straight through the target: followed from stamped messages, and not.

    python benchmarks/moving_cones.py [--output FILE.json]

The telescope rests on its target, the Sun passes it about one axis, the body gives way and comes
back. Closed loops of the control loop on the model, integrated five times finer, without ROS; a
direction without a stamp is taken for fixed over the horizon.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from manifold_mpc_ros import AttitudeMpc, AttitudeMpcConfig, Cone
from manifold_mpc_ros.control.command import Law
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.input_gate import NANOSECONDS, StateGate, StateSample
from manifold_mpc_ros.control.solver_thread import DirectSolver, solve_with
from manifold_mpc_ros.control.tick_time import LOCKSTEP
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

RESULT = Path(__file__).parents[1] / 'docs' / 'results' / 'moving_cones.json'
J, STEP_S, FINER = np.diag([1.0, 0.9, 0.6]), 0.5, 5
BEGIN_RAD = np.radians(35.0)
SUN = Cone('sun', (1.0, 0.0, 0.0), (np.cos(BEGIN_RAD), np.sin(BEGIN_RAD), 0.0), np.radians(15.0))
#: Torque limit [N m], rate limit [rad/s], rate of the Sun [deg/s], time between messages [s].
CASES = ((0.3, 0.2, 0.5, 2.0), (0.05, 0.1, 0.5, 2.0), (0.02, 0.1, 1.0, 1.0))


def fly(torque_n_m: float, rate_rad_s: float, sun_deg_s: float, every_s: float, *, stamped: bool
        ) -> dict[str, Any]:
    """Return the least angle to the cone at any time, the modes, and the error at the end."""
    config = AttitudeMpcConfig(
        inertia_kg_m2=J, step_s=STEP_S, horizon=20, attitude_weight=np.eye(3),
        rate_weight=np.trace(J) / 2 * np.eye(3) - J, torque_weight=2.0 * np.eye(3),
        max_torque_n_m=torque_n_m, max_rate_rad_s=rate_rad_s, cones=(SUN,))
    loop = ControlLoop(
        Law(config, DirectSolver(solve_with(AttitudeMpc(config))), 5.0 * STEP_S),
        StateGate('inertial', 'base_link', step_s=STEP_S, timeout_s=5.0 * STEP_S, timed=False),
        initial_setpoint='identity')

    def sun(time_s: float) -> Array:
        return np.asarray(so3.exp(
            np.array([0.0, 0.0, -np.radians(sun_deg_s) * time_s])) @ SUN.direction_N)
    R, omega, least, modes = np.eye(3), np.zeros(3), np.inf, Counter[str]()
    for k in range(round((2.0 * BEGIN_RAD / np.radians(sun_deg_s) + 30.0) / STEP_S)):
        time_s = k * STEP_S
        now_ns = round((1.0 + time_s) * NANOSECONDS)
        if k % round(every_s / STEP_S) == 0:
            loop.direct('sun', sun(time_s), now_ns if stamped else 0)
        loop.admit(StateSample(now_ns, R, omega))
        command = loop.tick(LOCKSTEP)
        modes[command.mode.name] += 1
        for i in range(FINER):
            R, omega = lgvi_step(R, omega, command.torque_B_n_m, inertia_kg_m2=J,
                                 step_s=STEP_S / FINER)
            least = min(least, float(SUN.margins_rad(R, sun(time_s + (i + 1) * STEP_S / FINER))))
    return {'least_angle_deg': float(np.degrees(least)), 'modes': dict(modes),
            'end_error_deg': float(np.degrees(so3.angle(R)))}


def main() -> None:
    """Fly every case with stamps and without, and write the file."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--output', type=Path, default=RESULT)
    output = parser.parse_args().output
    rows = [{'max_torque_n_m': case[0], 'max_rate_rad_s': case[1], 'sun_deg_s': case[2],
             'message_s': case[3], 'followed': fly(*case, stamped=True),
             'taken_for_fixed': fly(*case, stamped=False)} for case in CASES]
    output.write_text(json.dumps({'rows': rows}, indent=1) + '\n', encoding='utf-8')
    print(output.read_text(encoding='utf-8'))


if __name__ == '__main__':
    main()
