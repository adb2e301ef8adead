# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pointing of one body axis as a problem on S^2 x SO(3), the roll about the axis divided out.

State (Gamma, f): the commanded direction seen from the body, ``Gamma = g^T b`` with
``g = R_ND^T R_NB`` and b the body axis that should meet it, and the free step f of the body.
From ``g+ = g turn`` the roll drops out exactly, ``Gamma+ = turn^T Gamma``, and f never knew it.

Chart ``xi = (E^T x, Log f / h)`` in R^5: E (3, 2) is a right-handed basis of the plane across b,
x the rotation vector without roll, ``Gamma = exp(-hat x) b``. At rest at the equilibrium

    A = [I, h E^T; 0, I],   B = [h^2/2 E^T J^-1; h J^-1] (symmetric),  [0; h J^-1] (paper),

and the stage cost, ``1 - b . Gamma = |Gamma - b|^2 / 2``, has Q = diag(w I, tr(Qf) I - Qf):

    L = w (1 - b . Gamma) + tr(Qf (I - f)) / h^2 + tr(u^T R u) / 2.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.symbolic import rotation_from_quaternion
from manifold_mpc_ros.terminal.manifold import Sphere
from manifold_mpc_ros.terminal.problem import ManifoldProblem
from manifold_mpc_ros.terminal.rigid_body import RigidBody


def pointing_problem(config: AttitudeMpcConfig) -> ManifoldProblem:
    """Map a configuration to its pointing problem (its ``target`` is not looked at)."""
    axis = np.asarray(config.pointing_axis_B)
    return RigidBody(config).problem(
        'pointing', Sphere(axis),
        lambda gamma, turn: rotation_from_quaternion(turn).T @ gamma,
        lambda gamma: config.pointing_weight / 2 * ca.sumsqr(gamma - axis))
