# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Second-order terms that turn the Gauss-Newton model into the exact Hessian of the Lagrangian.

Everything nonlinear in a stage is a function of the attitude or of the Cayley parameter c of an
implicit step ``m = 2 (J c + c x J c)/(1 + |c|^2)``. For any psi(c) the Hessian in m is
``(dc/dm)^T (psi'' - nu . m'') dc/dm`` with ``nu = (dc/dm)^T psi'``, so the Newton iterations of
the implicit equation are never differentiated (docs/solver.md).
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from manifold_mpc_ros.dynamics.symbolic import StepDerivative, legendre_hessian, rational_hessian
from manifold_mpc_ros.lie.symbolic import (
    cayley_quaternion,
    hat,
    quaternion_log,
    rotation_from_quaternion,
    trace_hessian,
)
from manifold_mpc_ros.mpc.scaling import Parameters
from manifold_mpc_ros.mpc.stage import split_node, turned_error


class StageCurvature(NamedTuple):
    """Exact Hessian blocks of a stage in (d theta, d omega, d u)."""

    state: ca.SX
    cross: ca.SX
    torque: ca.SX


def attitude_hessian(q: ca.SX, p: Parameters) -> ca.SX:
    """Return the exact Hessian of ``tr(Qg (I - g))``: ``tr(Z) I - sym(Z)``, Z = Qg g."""
    z = p.attitude_weight @ rotation_from_quaternion(q)
    return trace_hessian((z + z.T) / 2)


def rate_cost_hessian(c: ca.SX, free: StepDerivative, p: Parameters) -> ca.SX:
    """Return the exact Hessian in m of ``tr(Qf (I - cay(c))) = 2 c^T Q c / (1 + |c|^2)``."""
    weight = trace_hessian(p.rate_weight)
    w = 1 / (1 + ca.dot(c, c))
    form = ca.dot(c, weight @ c)
    gradient = 4 * w * (weight @ c) - 4 * w * w * form * c
    hessian = rational_hessian(c, form, 2 * weight @ c, 2 * weight)
    nu = free.cayley.T @ gradient
    return free.cayley.T @ (hessian - legendre_hessian(c, nu, p.inertia, 1)) @ free.cayley


def step_hessian(c: ca.SX, step: StepDerivative, turn: ca.SX, momentum: ca.SX, p: Parameters
                 ) -> ca.SX:
    """Return the Hessian in m of ``turn . angle(c) + momentum . (f^T m)``.

    ``turn`` and ``momentum`` are the multipliers of the attitude and momentum equations.
    """
    w = 1 / (1 + ca.dot(c, c))
    lever = (turn + ca.cross(c, turn)) @ c.T
    nu = step.angle.T @ turn + step.turned.T @ momentum
    hessian = (legendre_hessian(c, momentum, p.inertia, -1) - 2 * w * w * (lever + lever.T)
               - legendre_hessian(c, nu, p.inertia, 1))
    return step.cayley.T @ hessian @ step.cayley


def stage_curvature(node: ca.SX, cayley: ca.SX, free: StepDerivative, step: StepDerivative,
                    multipliers: ca.SX, p: Parameters, symmetric: bool) -> StageCurvature:
    """Return the exact Hessian of stage cost plus multipliers (6,) times the next node."""
    q, _, c = split_node(node)
    turn, momentum = multipliers[0:3], p.inertia_inverse @ multipliers[3:6]
    by_step = step_hessian(cayley, step, turn, momentum, p)
    mixed = -step.rotation @ hat(turn) @ step.angle / 2
    by_rate = p.inertia @ (by_step + rate_cost_hessian(c, free, p)) @ p.inertia
    mixed_rate = mixed @ p.inertia
    state = ca.vertcat(ca.horzcat(attitude_hessian(q, p), mixed_rate),
                       ca.horzcat(mixed_rate.T, by_rate))
    if not symmetric:
        return StageCurvature(state, ca.SX(3, 6), ca.SX(3, 3))
    cross = ca.horzcat(mixed.T, by_step @ p.inertia) / 2
    return StageCurvature(state, cross, by_step / 4)


def terminal_curvature(node: ca.SX, free: StepDerivative, weight: ca.SX, pointing: bool,
                       p: Parameters) -> ca.SX:
    """Return the second-order part (6, 6) of ``weight . xi(node)`` in tangent coordinates."""
    q, _, c = split_node(node)
    turn, shift = ca.SX.sym('turn', 3), ca.SX.sym('shift', 3)
    turned = turned_error(q, turn, pointing, p)
    by_turn = ca.hessian(ca.dot(weight[0:3], turned), turn)[0]
    log_f = ca.dot(weight[3:6], quaternion_log(cayley_quaternion(c + shift)))
    by_shift, gradient = ca.hessian(log_f, shift)
    nu = free.cayley.T @ gradient
    by_shift = by_shift - legendre_hessian(c, nu, p.inertia, 1)
    by_rate = p.inertia @ free.cayley.T @ by_shift @ free.cayley @ p.inertia
    zero = ca.SX.zeros(3)
    at_zero = ca.substitute([by_turn, by_rate], [turn, shift], [zero, zero])
    return ca.diagcat(*at_zero)
