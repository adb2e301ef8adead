# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which problem a configuration poses, attitude control or pointing, and its terminal design."""

from __future__ import annotations

import casadi as ca
import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.symbolic import quaternion_product, rotation_from_quaternion
from manifold_mpc_ros.terminal.cone_cut import cut_design
from manifold_mpc_ros.terminal.design import TerminalDesign, design_terminal
from manifold_mpc_ros.terminal.manifold import RotationGroup, Sphere
from manifold_mpc_ros.terminal.problem import ManifoldProblem
from manifold_mpc_ros.terminal.rigid_body import RigidBody, quadratic, trace_hessian


def attitude_problem(config: AttitudeMpcConfig) -> ManifoldProblem:
    """Map a configuration (its ``target`` aside) to attitude control, on SO(3) x SO(3).

    The paper's section 5. State (g, f): the attitude error ``g = R_ND^T R_NB`` and the free step
    f, both unit quaternions; chart ``xi = (Log g, Log f / h)`` in R^6; input tau_B in R^3. The
    step is the variational integrator ``g+ = g turn`` of docs/theory.md (1) to (4), and (6) is
    the stage cost

        L = tr(Qg (I - g)) + tr(Qf (I - f)) / h^2 + tr(u^T R u) / 2,
        tr(Q (I - R)) = 2 v . (tr(Q) I - Q) v   of the unit quaternion (w, v), no cancellation.
    """
    weight = trace_hessian(config.attitude_weight)
    return RigidBody(config).problem(
        'attitude', RotationGroup(), quaternion_product,
        lambda g: 2 * quadratic(weight, g[1:4]))


def pointing_problem(config: AttitudeMpcConfig) -> ManifoldProblem:
    """Map a configuration (its ``target`` aside) to pointing of one body axis, on S^2 x SO(3).

    The roll about the axis is divided out. State (Gamma, f): the commanded direction seen from
    the body, ``Gamma = g^T b`` with ``g = R_ND^T R_NB`` and b the body axis that should meet it,
    and the free step f of the body. From ``g+ = g turn`` the roll drops out exactly,
    ``Gamma+ = turn^T Gamma``, and f never knew it.

    Chart ``xi = (E^T x, Log f / h)`` in R^5: E (3, 2) is a right-handed basis of the plane across
    b, x the rotation vector without roll, ``Gamma = exp(-hat x) b``. At rest at the equilibrium

        A = [I, h E^T; 0, I],   B = [h^2/2 E^T J^-1; h J^-1] (symmetric),  [0; h J^-1] (paper),

    and the stage cost, ``1 - b . Gamma = |Gamma - b|^2 / 2``, has Q = diag(w I, tr(Qf) I - Qf):

        L = w (1 - b . Gamma) + tr(Qf (I - f)) / h^2 + tr(u^T R u) / 2.
    """
    axis = np.asarray(config.pointing_axis_B)
    return RigidBody(config).problem(
        'pointing', Sphere(axis),
        lambda gamma, turn: rotation_from_quaternion(turn).T @ gamma,
        lambda gamma: config.pointing_weight / 2 * ca.sumsqr(gamma - axis))


def problem_of(config: AttitudeMpcConfig) -> ManifoldProblem:
    """Map a configuration to the problem of its ``target``: on SO(3) x SO(3), or S^2 x SO(3)."""
    return pointing_problem(config) if config.target == 'pointing' else attitude_problem(config)


def terminal_design(config: AttitudeMpcConfig) -> TerminalDesign:
    """Map a configuration to the terminal design of its problem, for the identity as target.

    Raises DesignError when the design does not exist; the message names the condition that fails.
    """
    design = design_terminal(problem_of(config.planned))
    return cut_design(config, design) if config.cones else design
