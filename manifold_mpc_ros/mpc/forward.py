# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One stage of the forward roll-out, as CasADi functions.

The roll-out applies the true LGVI step, so every iterate is a real trajectory and strictly
inside its (elastic) inequalities.
"""

from __future__ import annotations

import casadi as ca

from manifold_mpc_ros.dynamics.symbolic import cayley_residual, cayley_step, lgvi_step
from manifold_mpc_ros.mpc import stage
from manifold_mpc_ros.mpc.scaling import PARAMETERS, unpack
from manifold_mpc_ros.mpc.structure import (
    RATE_PENALTY,
    TERMINAL_PENALTY,
    Structure,
    dense,
    split_duals,
    stage_inputs,
)

# Fraction of the way to a bound that one step may go.
BOUNDARY = 0.995
# Multipliers stay within this factor of mu / slack (as in primal-dual methods at large).
MULTIPLIER_SPREAD = 1e8
# A Newton residual above this marks a roll-out that left the principal branch.
STEP_RESIDUAL = 1e-9


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
    i = stage_inputs(structure)
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
    xi_new = stage.terminal_coordinates(node_new, structure.pointing, p)
    form_new = ca.dot(xi_new, p.terminal_weight @ xi_new)
    cost, logs, dual_new = form_new / 2, ca.SX(0), dual
    if structure.terminal_set:
        form = stage.terminal_form(node, stage.free_step_derivative(node, p),
                                   structure.pointing, p)
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
