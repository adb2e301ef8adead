# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The double integrator on R^2, where the general procedure must give textbook LQR and MPC.

State (position, velocity), input a constant acceleration over the step:

    A = [1, h; 0, 1],  B = [h^2/2; h],    L = (x^T diag(q) x + r u^2) / 2
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from manifold_mpc_ros.terminal.manifold import Euclidean
from manifold_mpc_ros.terminal.problem import ManifoldProblem


def double_integrator_problem(
    *, step_s: float = 0.5, position_weight: float = 1.0, velocity_weight: float = 1.0,
    input_weight: float = 1.0, terminal_scale: float = 0.9, max_input: float | None = None,
    max_velocity: float | None = None,
) -> ManifoldProblem:
    """Map weights and limits (None: no limit) to the problem; units are the caller's own."""
    h = step_s

    def step(x: ca.SX, u: ca.SX) -> ca.SX:
        return ca.vertcat(x[0] + h * x[1] + h * h / 2 * u, x[1] + h * u)

    def stage_cost(x: ca.SX, u: ca.SX) -> ca.SX:
        return (position_weight * x[0] ** 2 + velocity_weight * x[1] ** 2
                + input_weight * u ** 2) / 2

    return ManifoldProblem(
        name='double integrator', states=Euclidean(2), controls=Euclidean(1), step=step,
        stage_cost=stage_cost, terminal_scale=terminal_scale,
        state_units=np.array([1.0, 1 / h]), control_units=np.array([1 / h ** 2]),
        control_limits=None if max_input is None else np.array([max_input]),
        state_limits={} if max_velocity is None else {
            'velocity': lambda x: ca.vertcat(x[1], -x[1]) / max_velocity - 1})
