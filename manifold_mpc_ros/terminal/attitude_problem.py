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

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.symbolic import quaternion_product
from manifold_mpc_ros.terminal.manifold import RotationGroup
from manifold_mpc_ros.terminal.problem import ManifoldProblem
from manifold_mpc_ros.terminal.rigid_body import RigidBody, quadratic, trace_hessian


def attitude_problem(config: AttitudeMpcConfig) -> ManifoldProblem:
    """Map a configuration to its attitude problem (its ``target`` is not looked at)."""
    weight = trace_hessian(config.attitude_weight)
    return RigidBody(config).problem(
        'attitude', RotationGroup(), quaternion_product,
        lambda g: 2 * quadratic(weight, g[1:4]))
