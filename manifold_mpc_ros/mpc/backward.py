# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One stage of the backward Riccati sweep, as CasADi functions.

SQP on the tangent space with a primal-dual interior point: inequalities add ``C^T W C`` to the
Hessian of their own stage, so one Riccati sweep solves the whole Newton system.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from manifold_mpc_ros.dynamics.symbolic import lgvi_step_jacobian, step_derivative
from manifold_mpc_ros.mpc import stage
from manifold_mpc_ros.mpc.curvature import stage_curvature, terminal_curvature
from manifold_mpc_ros.mpc.scaling import PARAMETERS, Parameters, unpack
from manifold_mpc_ros.mpc.structure import (
    RATE_PENALTY,
    TERMINAL_PENALTY,
    StageInputs,
    Structure,
    dense,
    split_duals,
    stage_inputs,
)


def _largest(*values: ca.SX) -> ca.SX:
    """Return the largest absolute entry over vectors, 0 when all are empty."""
    largest = ca.SX(0)
    for value in values:
        for i in range(value.numel()):
            largest = ca.fmax(largest, ca.fabs(value[i]))
    return largest


def _solve_spd(a: ca.SX, b: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return ``a^-1 b`` for a symmetric a (3, 3), by LDL^T, and its smallest relative pivot."""
    d0 = a[0, 0]
    l10, l20 = a[1, 0] / d0, a[2, 0] / d0
    d1 = a[1, 1] - l10 * a[1, 0]
    l21 = (a[2, 1] - l20 * a[1, 0]) / d1
    d2 = a[2, 2] - l20 * a[2, 0] - l21 * l21 * d1
    y0 = b[0, :]
    y1 = b[1, :] - l10 * y0
    y2 = b[2, :] - l20 * y0 - l21 * y1
    x2 = y2 / d2
    x1 = y1 / d1 - l21 * x2
    x0 = y0 / d0 - l10 * x1 - l20 * x2
    pivot = ca.fmin(d0, ca.fmin(d1, d2)) / (ca.fabs(d0) + ca.fabs(d1) + ca.fabs(d2))
    return ca.vertcat(x0, x1, x2), pivot


def backward_terminal(structure: Structure) -> ca.Function:
    """Map (node_N, dual_N, mu, exact, p) to (Vxx, Vx, adjoint, residuals)."""
    node, dual = ca.SX.sym('node', stage.NODE), ca.SX.sym('dual', structure.terminal_duals)
    mu, exact, flat = ca.SX.sym('mu'), ca.SX.sym('exact'), ca.SX.sym('flat', PARAMETERS)
    p = unpack(flat)
    free = stage.free_step_derivative(node, p)
    form = stage.terminal_form(node, free, structure.pointing, p)
    adjoint = form.gradient
    p_xi = p.terminal_weight @ stage.terminal_coordinates(node, structure.pointing, p)
    form_hessian = form.hessian + exact * terminal_curvature(
        node, free, p_xi, structure.pointing, p)
    v_xx, v_x, complementarity = form_hessian, form.gradient, ca.SX(0)
    if structure.terminal_set:
        y, t, s = dual[0], dual[1], dual[2]
        bounds = stage.elastic_bounds(y, t, s, mu, TERMINAL_PENALTY)
        slope = 2 / p.terminal_level * form.gradient
        v_xx += bounds.weight * slope @ slope.T + s * 2 / p.terminal_level * form_hessian
        v_x = v_x + slope * bounds.pull
        adjoint = adjoint + slope * s
        complementarity = _largest(y * s, (TERMINAL_PENALTY - s) * t)
    return ca.Function('backward_terminal', [node, dual, mu, exact, flat],
                       dense(v_xx, v_x, adjoint, ca.vertcat(0, complementarity, 0, 1)))


class _Constrained(NamedTuple):
    """A stage's model with its inequalities added: value behind it and torque terms."""

    hessian: ca.SX
    gradient: ca.SX
    multipliers: ca.SX
    q_uu: ca.SX
    q_u: ca.SX
    stationarity: ca.SX
    products: list[ca.SX]


def _add_inequalities(structure: Structure, i: StageInputs, v_xx: ca.SX, v_x: ca.SX,
                      adjoint: ca.SX, p: Parameters) -> _Constrained:
    """Add the rate box of the next node and the torque box of this stage."""
    y_torque, s_torque, y_rate, t_rate, s_rate = split_duals(i.dual, structure)
    q_uu, q_u = p.torque_hessian, p.torque_hessian @ i.torque
    stationarity, products = q_u, []
    if structure.rate_box:
        bounds = stage.elastic_bounds(y_rate, t_rate, s_rate, i.mu, RATE_PENALTY)
        zero = ca.SX.zeros(3)
        v_xx = v_xx + ca.diagcat(zero @ zero.T, stage.box_hessian(bounds.weight, p.max_rate))
        v_x = v_x + ca.vertcat(zero, stage.box_transpose(bounds.pull, p.max_rate))
        adjoint = adjoint + ca.vertcat(zero, stage.box_transpose(s_rate, p.max_rate))
        products += [y_rate * s_rate, (RATE_PENALTY - s_rate) * t_rate]
    if structure.torque_box:
        bounds = stage.hard_bounds(y_torque, s_torque, i.mu)
        q_uu = q_uu + stage.box_hessian(bounds.weight, p.max_torque)
        q_u = q_u + stage.box_transpose(bounds.pull, p.max_torque)
        stationarity = stationarity + stage.box_transpose(s_torque, p.max_torque)
        products.append(y_torque * s_torque)
    return _Constrained(v_xx, v_x, adjoint, q_uu, q_u, stationarity, products)


def backward_stage(structure: Structure) -> ca.Function:
    """Map one stage and the value model behind it to its gains and the model before it.

    ``exact`` blends from Gauss-Newton (0) to the exact Hessian (1). Residuals, accumulated:
    stationarity, complementarity, expected decrease, smallest pivot of Quu (relative).
    """
    i = stage_inputs(structure)
    p = unpack(i.flat)
    exact = ca.SX.sym('exact')
    v_xx, v_x = ca.SX.sym('v_xx', 6, 6), ca.SX.sym('v_x', 6)
    adjoint, residuals = ca.SX.sym('adjoint', 6), ca.SX.sym('residuals', 4)
    m = _add_inequalities(structure, i, v_xx, v_x, adjoint, p)
    free = stage.free_step_derivative(i.node, p)
    cayley, step = i.node[7:10], free
    if structure.symmetric:
        cayley = i.step_cayley
        step = step_derivative(cayley, p.inertia @ i.node[4:7] + i.torque / 2, p.inertia)
    a, b = lgvi_step_jacobian(step, p.inertia, p.inertia_inverse, 1, structure.symmetric)
    cost = stage.state_cost(i.node, free, p)
    curved = stage_curvature(i.node, cayley, free, step, m.multipliers, p, structure.symmetric)
    hb = m.hessian @ b
    q_u = m.q_u + b.T @ m.gradient
    q_uu = m.q_uu + b.T @ hb + exact * curved.torque
    q_ux = hb.T @ a + exact * curved.cross
    q_xx = cost.hessian + exact * (curved.state - cost.hessian) + a.T @ m.hessian @ a
    solution, pivot = _solve_spd(q_uu, ca.horzcat(q_u, q_ux))
    k, feedback = -solution[:, 0], -solution[:, 1:]
    v_xx_out = q_xx + q_ux.T @ feedback
    v_x_out = cost.gradient + a.T @ m.gradient + q_ux.T @ k
    residuals_out = ca.vertcat(
        ca.fmax(residuals[0], _largest(m.stationarity + b.T @ m.multipliers)),
        ca.fmax(residuals[1], _largest(*m.products)),
        residuals[2] - ca.dot(q_u, k),
        ca.fmin(residuals[3], pivot))
    return ca.Function(
        'backward_stage', [*i, exact, v_xx, v_x, adjoint, residuals],
        dense(ca.horzcat(k, feedback), (v_xx_out + v_xx_out.T) / 2, v_x_out,
              cost.gradient + a.T @ m.multipliers, residuals_out, ca.horzcat(a, b)))
