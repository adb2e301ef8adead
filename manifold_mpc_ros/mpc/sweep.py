# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One stage of the backward Riccati sweep and of the forward roll-out, as CasADi functions.

The optimal control problem is solved by Gauss-Newton SQP on the tangent space with a
primal-dual interior point: inequalities add ``C^T W C`` to the Hessian of their own stage, so
one Riccati sweep solves the whole Newton system. The roll-out applies the true LGVI step, so
every iterate is a real trajectory and strictly inside its (elastic) inequalities.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from manifold_mpc_ros.dynamics.symbolic import (
    cayley_residual,
    cayley_step,
    lgvi_step,
    lgvi_step_jacobian,
    step_derivative,
)
from manifold_mpc_ros.mpc import stage
from manifold_mpc_ros.mpc.curvature import stage_curvature, terminal_curvature
from manifold_mpc_ros.mpc.scaling import PARAMETERS, Parameters, unpack

# Fraction of the way to a bound that one step may go.
BOUNDARY = 0.995
# Multipliers stay within this factor of mu / slack (as in primal-dual methods at large).
MULTIPLIER_SPREAD = 1e8
# Cost of one unit of relative violation of a rate limit and of the terminal level, in units
# of tr(Qg)/3: exact penalties as long as they exceed the multipliers of the hard problem.
RATE_PENALTY = 1e4
TERMINAL_PENALTY = 1e3
# A Newton residual above this marks a roll-out that left the principal branch.
STEP_RESIDUAL = 1e-9


class Structure(NamedTuple):
    """What the generated code depends on; all numbers are run-time parameters."""

    horizon: int
    symmetric: bool
    torque_box: bool
    rate_box: bool
    terminal_set: bool

    @property
    def stage_duals(self) -> int:
        """Return the length of one stage's barrier vector: torque (y, s), rate (y, t, s)."""
        return 12 * self.torque_box + 18 * self.rate_box

    @property
    def terminal_duals(self) -> int:
        """Return the length of the terminal barrier vector (y, t, s)."""
        return 3 * self.terminal_set


def split_duals(dual: ca.SX, structure: Structure) -> list[ca.SX]:
    """Return torque (y, s) and rate (y, t, s), each (6,), empty where not present."""
    torque, rate = 6 * structure.torque_box, 6 * structure.rate_box
    return list(ca.vertsplit(dual, [0, torque, 2 * torque, 2 * torque + rate,
                                    2 * (torque + rate), 2 * torque + 3 * rate]))


def dense(*values: ca.SX) -> list[ca.SX]:
    """Return the values without structural zeros, as the horizon's buffers want them."""
    return [ca.densify(value) for value in values]


class _Inputs(NamedTuple):
    """Symbols shared by the stage functions."""

    node: ca.SX
    node_next: ca.SX
    step_cayley: ca.SX
    torque: ca.SX
    dual: ca.SX
    mu: ca.SX
    flat: ca.SX


def _inputs(structure: Structure) -> _Inputs:
    """Return fresh symbols for one stage."""
    return _Inputs(
        ca.SX.sym('node', stage.NODE), ca.SX.sym('node_next', stage.NODE),
        ca.SX.sym('step_cayley', 3), ca.SX.sym('torque', 3),
        ca.SX.sym('dual', structure.stage_duals), ca.SX.sym('mu'),
        ca.SX.sym('flat', PARAMETERS))


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
    form = stage.terminal_form(node, free, p)
    adjoint = form.gradient
    p_xi = p.terminal_weight @ stage.terminal_coordinates(node)
    form_hessian = form.hessian + exact * terminal_curvature(node, free, p_xi, p)
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


def _add_inequalities(structure: Structure, i: _Inputs, v_xx: ca.SX, v_x: ca.SX, adjoint: ca.SX,
                      p: Parameters) -> _Constrained:
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
    i = _inputs(structure)
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


def _advance_multiplier(bounds: stage.Bounds, change: ca.SX, alpha: ca.SX, mu: ca.SX,
                        slack_new: ca.SX) -> ca.SX:
    """Return the new multipliers after the constraint values moved by ``change``."""
    s = bounds.multiplier
    s_new = s + bounds.weight * (change + alpha * bounds.offset)
    s_new = ca.fmax(s_new, (1 - BOUNDARY) * s)
    return ca.fmin(ca.fmax(s_new, mu / slack_new / MULTIPLIER_SPREAD),
                   mu / slack_new * MULTIPLIER_SPREAD)


def _advance_elastic(bounds: stage.Bounds, change: ca.SX, predicted: ca.SX, t: ca.SX,
                     alpha: ca.SX, mu: ca.SX, penalty: float) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return new (y, t, s) of elastic inequalities; y and t shrink by at most BOUNDARY.

    ``change`` is what the values did in the roll-out, ``predicted`` what the linear model says;
    multipliers follow the latter, which stays accurate when the step is tiny. y and t are moved
    by differences and never recomputed from the values, for the same reason.
    """
    s, gap, keep = bounds.multiplier, penalty - bounds.multiplier, 1 - BOUNDARY
    d_s = bounds.weight * (predicted + alpha * bounds.offset)
    d_t = alpha * (mu / gap - t) + t / gap * d_s
    d_t = ca.fmax(ca.fmax(d_t, (keep - 1) * t), change + (keep - 1) * bounds.slack)
    y_new = bounds.slack + d_t - change
    s_new = _advance_multiplier(bounds, predicted, alpha, mu, y_new)
    return y_new, t + d_t, ca.fmin(s_new, s + BOUNDARY * gap)


def _log_sum(values: ca.SX) -> ca.SX:
    """Return the sum of logarithms of positive entries."""
    return ca.sum1(ca.log(values))


def predict(structure: Structure, node: ca.SX, u: ca.SX, flat: ca.SX
            ) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return (next node, Cayley parameter of this step, largest Newton residual)."""
    p = unpack(flat)
    q, omega, free = stage.split_node(node)
    step = lgvi_step(q, omega, u, p.inertia, p.inertia_inverse, 1, structure.symmetric,
                     None if structure.symmetric else free)
    momentum = p.inertia @ step.omega
    c = cayley_step(momentum, p.inertia, p.inertia_inverse)
    residual = ca.fmax(cayley_residual(c, momentum, p.inertia),
                       cayley_residual(step.cayley, step.momentum, p.inertia))
    unit = step.quaternion / ca.norm_2(step.quaternion)
    return ca.vertcat(unit, step.omega, c), step.cayley, residual


def forward_stage(structure: Structure) -> ca.Function:
    """Map a new node, the old stage and its gains to the new stage and its share of the merit.

    Sums are (cost with penalties, logarithms, largest Newton residual), accumulated.
    """
    i = _inputs(structure)
    p = unpack(i.flat)
    node_new, gains = ca.SX.sym('node_new', stage.NODE), ca.SX.sym('gains', 3, 7)
    model, linear = ca.SX.sym('model', 6, 9), ca.SX.sym('linear', 6)
    alpha, sums = ca.SX.sym('alpha'), ca.SX.sym('sums', 3)
    y_torque, s_torque, y_rate, t_rate, s_rate = split_duals(i.dual, structure)
    deviation = stage.tangent_difference(node_new, i.node)
    d_u = alpha * gains[:, 0] + gains[:, 1:] @ deviation
    linear_u = alpha * gains[:, 0] + gains[:, 1:] @ linear
    linear_next = model @ ca.vertcat(linear, linear_u)
    cost = stage.state_cost_value(node_new, p)
    logs, duals = ca.SX(0), []
    if structure.torque_box:
        bounds = stage.hard_bounds(y_torque, s_torque, i.mu)
        room = BOUNDARY * y_torque
        ratio = ca.fmin(ca.fmax(d_u / p.max_torque, -room[3:6]), room[0:3])
        d_u, change = ratio * p.max_torque, ca.vertcat(ratio, -ratio)
        y_new = y_torque - change
        ratio = linear_u / p.max_torque
        duals += [y_new, _advance_multiplier(bounds, ca.vertcat(ratio, -ratio), alpha, i.mu,
                                             y_new)]
        logs += _log_sum(y_new)
    u_new = i.torque + d_u
    node_next_new, cayley, residual = predict(structure, node_new, u_new, i.flat)
    if structure.rate_box:
        ratio = (node_next_new[4:7] - i.node_next[4:7]) / p.max_rate
        predicted = linear_next[3:6] / p.max_rate
        bounds = stage.elastic_bounds(y_rate, t_rate, s_rate, i.mu, RATE_PENALTY)
        moved = _advance_elastic(bounds, ca.vertcat(ratio, -ratio),
                                 ca.vertcat(predicted, -predicted), t_rate, alpha, i.mu,
                                 RATE_PENALTY)
        duals += moved
        cost += RATE_PENALTY * ca.sum1(moved[1])
        logs += _log_sum(moved[0]) + _log_sum(moved[1])
    cost += stage.torque_cost(u_new, p)
    sums_out = ca.vertcat(sums[0] + cost, sums[1] + logs, ca.fmax(sums[2], residual))
    return ca.Function(
        'forward_stage', [*i, node_new, gains, model, linear, alpha, sums],
        dense(node_next_new, cayley, u_new, ca.vertcat(*duals), linear_next, sums_out))


def forward_terminal(structure: Structure) -> ca.Function:
    """Map old and new node N to the new terminal duals and the complete merit sums."""
    node, node_new = ca.SX.sym('node', stage.NODE), ca.SX.sym('node_new', stage.NODE)
    dual, linear = ca.SX.sym('dual', structure.terminal_duals), ca.SX.sym('linear', 6)
    alpha, mu = ca.SX.sym('alpha'), ca.SX.sym('mu')
    sums, flat = ca.SX.sym('sums', 3), ca.SX.sym('flat', PARAMETERS)
    p = unpack(flat)
    xi_new = stage.terminal_coordinates(node_new)
    form_new = ca.dot(xi_new, p.terminal_weight @ xi_new)
    cost, logs, dual_new = form_new / 2, ca.SX(0), dual
    if structure.terminal_set:
        form = stage.terminal_form(node, stage.free_step_derivative(node, p), p)
        change = (form_new - 2 * form.value) / p.terminal_level
        predicted = 2 * ca.dot(form.gradient, linear) / p.terminal_level
        bounds = stage.elastic_bounds(dual[0], dual[1], dual[2], mu, TERMINAL_PENALTY)
        moved = _advance_elastic(bounds, change, predicted, dual[1], alpha, mu,
                                 TERMINAL_PENALTY)
        dual_new = ca.vertcat(*moved)
        cost += TERMINAL_PENALTY * moved[1]
        logs = ca.log(moved[0]) + ca.log(moved[1])
    return ca.Function('forward_terminal', [node, node_new, dual, linear, alpha, mu, sums, flat],
                       dense(dual_new, sums + ca.vertcat(cost, logs, 0)))
