# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A measured state moved on in time, under torques that are known."""

from __future__ import annotations

import math
from collections.abc import Iterable

from manifold_mpc_ros.config.checks import FloatArray
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.dynamics.lgvi import lgvi_step


def moved_on(
    R_NB: FloatArray, omega_BN_B: FloatArray, torques: Iterable[tuple[int, FloatArray]],
    config: AttitudeMpcConfig,
) -> tuple[FloatArray, FloatArray]:
    """Return attitude and rate [rad/s] after torques (3,) [N m], each with its duration [ns].

    LGVI steps, none longer than that of the controller.

    Raises StepExistenceError where the implicit step is not guaranteed.
    """
    for lasting_ns, torque_B_n_m in torques:
        lasting_s = lasting_ns / NANOSECONDS
        steps = math.ceil(lasting_s / config.step_s)
        for _ in range(steps):
            R_NB, omega_BN_B = lgvi_step(
                R_NB, omega_BN_B, torque_B_n_m, inertia_kg_m2=config.inertia_kg_m2,
                step_s=lasting_s / steps)
    return R_NB, omega_BN_B
