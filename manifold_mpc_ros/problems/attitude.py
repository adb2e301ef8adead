# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Attitude control as a problem on SO(3) x SO(3): the paper's section 5.

State (g, f): the attitude error ``g = R_ND^T R_NB`` and the free step f, both unit quaternions;
chart ``xi = (Log g, Log f / h)`` in R^6; input tau_B in R^3. The step is the variational
integrator ``g+ = g turn`` of docs/theory.md (1) to (4), and (6) is the stage cost

    L = tr(Qg (I - g)) + tr(Qf (I - f)) / h^2 + tr(u^T R u) / 2,
    tr(Q (I - R)) = 2 v . (tr(Q) I - Q) v   of the unit quaternion (w, v), without cancellation.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from manifold_mpc_ros.config import AttitudeMpcConfig
from manifold_mpc_ros.lie.symbolic import quaternion_product
from manifold_mpc_ros.problems.rigid_body import RigidBody, quadratic, trace_hessian
from manifold_mpc_ros.theory.manifold import Euclidean, Product, RotationGroup
from manifold_mpc_ros.theory.problem import ManifoldProblem


def attitude_problem(config: AttitudeMpcConfig) -> ManifoldProblem:
    """Map a configuration to its attitude problem (its ``target`` is not looked at)."""
    body = RigidBody(config)
    weight = trace_hessian(config.attitude_weight)

    def step(x: ca.SX, torque: ca.SX) -> ca.SX:
        motion = body.motion(x[4:8], torque)
        return ca.vertcat(quaternion_product(x[0:4], motion.turn), motion.step)

    def stage_cost(x: ca.SX, torque: ca.SX) -> ca.SX:
        return 2 * quadratic(weight, x[1:4]) + body.motion_cost(x[4:8], torque)

    return ManifoldProblem(
        name='attitude',
        states=Product(RotationGroup(), RotationGroup(scale=config.step_s)),
        controls=Euclidean(3),
        step=step,
        stage_cost=stage_cost,
        terminal_scale=config.terminal_scale,
        state_units=np.array([1.0] * 3 + [body.rate_unit] * 3),
        control_units=np.full(3, body.torque_unit),
        control_limits=config.max_torque_n_m,
        control_name='torque',
        state_limits={'rate': lambda x: body.rate_limits(x[4:8])} if body.limited else {},
        existence=lambda x, torque: body.load(x[4:8], torque),
    )
