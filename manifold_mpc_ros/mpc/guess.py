# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starting trajectories: a slew by a simple saturated law, on either side and out of the plane.

The sign of the starting quaternion chooses the side: the law follows the continuous rotation
vector of length up to 2 pi, so ``q`` turns the short way and ``-q`` the long way round. A lean
(three signs) saturates the torques in that octant for the first steps, which leaves the plane
of the eigenaxis slew; planar slews are stationary points that no descent method leaves. When
pointing without torque limits the lean is the axis (a unit vector) of the first turn instead.
"""

from __future__ import annotations

import casadi as ca

from manifold_mpc_ros.dynamics.symbolic import cayley_step, solve_3x3
from manifold_mpc_ros.mpc import stage
from manifold_mpc_ros.mpc.forward import predict
from manifold_mpc_ros.mpc.scaling import PARAMETERS, Parameters, unpack
from manifold_mpc_ros.mpc.structure import RATE_PENALTY, TERMINAL_PENALTY, Structure

# Fractions of the limits that a starting trajectory uses.
_TORQUE_FRACTION = 0.9
_RATE_FRACTION = 0.85
_BRAKING_FRACTION = 0.6
# A starting slew turns at most this much per step [rad], and loads the existence guard so far.
_FREE_RATE = 0.7
_GUARD_FRACTION = 0.6
# Multipliers of state inequalities start at most here (dimensionless cost per relative unit).
_LARGEST_START_MULTIPLIER = 10.0


def _continuous_log(q: ca.SX) -> ca.SX:
    """Map a unit quaternion to its rotation vector of length up to 2 pi, ``q = -1`` to zero."""
    v = q[1:4]
    sine = ca.sqrt(ca.dot(v, v) + 1e-30)
    return 2 * ca.atan2(sine, q[0]) / sine * v


def _slew_torque(structure: Structure, node: ca.SX, lean: ca.SX, p: Parameters) -> ca.SX:
    """Map (node, lean (3,)) to a torque: the local law with its rate capped for braking."""
    q, omega, _ = stage.split_node(node)
    error = _continuous_log(q)
    if structure.pointing:
        error = stage.error_vector(q, True, p)
        if not structure.torque_box:
            aside = ca.norm_2(error) * lean
            error = ca.if_else(ca.dot(lean, lean) > 0, aside, error)
    length = ca.sqrt(ca.dot(error, error) + 1e-30)
    axis = error / length
    cap = ca.fmin(_FREE_RATE, _GUARD_FRACTION * p.guard / ca.norm_2(p.inertia @ axis))
    if structure.torque_box:
        effort = p.inertia @ axis / p.max_torque
        braking = 1 / ca.sqrt(ca.dot(effort, effort))
        cap = ca.fmin(cap, ca.sqrt(2 * _BRAKING_FRACTION * braking * length))
    if structure.rate_box:
        share = axis / p.max_rate
        cap = ca.fmin(cap, _RATE_FRACTION / ca.sqrt(ca.dot(share, share)))
    by_angle, by_rate = p.terminal_gain[:, 0:3], p.terminal_gain[:, 3:6]
    wanted = by_angle @ error
    natural = solve_3x3(by_rate, wanted)
    shrink = ca.fmin(1, cap / ca.sqrt(ca.dot(natural, natural) + 1e-30))
    torque = shrink * wanted + by_rate @ omega
    if structure.torque_box:
        leaning = lean * p.max_torque
        if structure.rate_box:
            room = _RATE_FRACTION * p.max_rate
            inertia = ca.diag(p.inertia)
            leaning = ca.fmin(ca.fmax(leaning, inertia * (-room - omega)),
                              inertia * (room - omega))
        torque = ca.if_else(ca.dot(lean, lean) > 0, leaning, torque)
        torque = _clip(torque, _TORQUE_FRACTION * p.max_torque)
    return torque


def _clip(torque: ca.SX, limit: ca.SX) -> ca.SX:
    """Return the torque clipped to ``|torque_i| <= limit_i``."""
    return ca.fmin(ca.fmax(torque, -limit), limit)


def start_torque(structure: Structure) -> ca.Function:
    """Map (node, given (3,), lean (3,), source, p) to the torque a start uses at this stage."""
    node, given = ca.SX.sym('node', stage.NODE), ca.SX.sym('given', 3)
    lean, source = ca.SX.sym('lean', 3), ca.SX.sym('source')
    flat = ca.SX.sym('flat', PARAMETERS)
    p = unpack(flat)
    local = p.terminal_gain @ stage.terminal_coordinates(node, structure.pointing, p)
    if structure.torque_box:
        local = _clip(local, p.max_torque)
    slew = _slew_torque(structure, node, lean, p)
    torque = ca.if_else(source == 1, given, ca.if_else(source == 2, local, slew))
    return ca.Function('start_torque', [node, given, lean, source, flat], [torque])


def _elastic_start(value: ca.SX, mu: ca.SX, penalty: float) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return (y, t, s): y = t - value and t on the central path of mu, s capped.

    On a bound the central multiplier is half the penalty, far above any real one, and the first
    steps would creep; the cap lets them move inside.
    """
    scaled = penalty * value
    t = (scaled + 2 * mu + ca.sqrt(scaled * scaled + 4 * mu * mu)) / (2 * penalty)
    y = t - value
    return y, t, ca.fmin(mu / y, _LARGEST_START_MULTIPLIER)


def start_stage(structure: Structure) -> ca.Function:
    """Map (node, torque, mu, p, sums) to (next node, cayley, torque, barrier variables, sums)."""
    node, torque = ca.SX.sym('node', stage.NODE), ca.SX.sym('torque', 3)
    mu, flat, sums = ca.SX.sym('mu'), ca.SX.sym('flat', PARAMETERS), ca.SX.sym('sums', 3)
    p = unpack(flat)
    u, duals, logs, cost = torque, [], ca.SX(0), stage.state_cost_value(node, p)
    if structure.torque_box:
        # Keep the given torque off its bounds by about its distance on the central path.
        margin = ca.fmin(0.1, ca.sqrt(mu))
        ratio = ca.fmin(ca.fmax(torque / p.max_torque, margin - 1), 1 - margin)
        u = ratio * p.max_torque
        y = ca.vertcat(1 - ratio, 1 + ratio)
        duals += [y, mu / y]
        logs += ca.sum1(ca.log(y))
    node_next, cayley, residual = predict(structure, node, u, flat)
    if structure.rate_box:
        y, t, s = _elastic_start(stage.box(node_next[4:7], p.max_rate), mu, RATE_PENALTY)
        duals += [y, t, s]
        cost += RATE_PENALTY * ca.sum1(t)
        logs += ca.sum1(ca.log(y)) + ca.sum1(ca.log(t))
    cost += stage.torque_cost(u, p)
    sums_out = ca.vertcat(sums[0] + cost, sums[1] + logs, ca.fmax(sums[2], residual))
    return ca.Function('start_stage', [node, torque, mu, flat, sums],
                       [node_next, cayley, u, ca.vertcat(*duals), sums_out])


def start_terminal(structure: Structure) -> ca.Function:
    """Map (node_N, mu, p, sums) to the terminal barrier variables and the complete sums."""
    node, mu = ca.SX.sym('node', stage.NODE), ca.SX.sym('mu')
    flat, sums = ca.SX.sym('flat', PARAMETERS), ca.SX.sym('sums', 3)
    p = unpack(flat)
    xi = stage.terminal_coordinates(node, structure.pointing, p)
    form = ca.dot(xi, p.terminal_weight @ xi)
    cost, logs, dual = form / 2, ca.SX(0), ca.SX(0, 1)
    if structure.terminal_set:
        y, t, s = _elastic_start(form / p.terminal_level - 1, mu, TERMINAL_PENALTY)
        dual = ca.vertcat(y, t, s)
        cost += TERMINAL_PENALTY * t
        logs = ca.log(y) + ca.log(t)
    return ca.Function('start_terminal', [node, mu, flat, sums],
                       [dual, sums + ca.vertcat(cost, logs, 0)])


def initial_node() -> ca.Function:
    """Map (q, omega, p) to the node (q, omega, c)."""
    q, omega, flat = ca.SX.sym('q', 4), ca.SX.sym('omega', 3), ca.SX.sym('flat', PARAMETERS)
    p = unpack(flat)
    c = cayley_step(p.inertia @ omega, p.inertia, p.inertia_inverse)
    return ca.Function('initial_node', [q, omega, flat], [ca.vertcat(q, omega, c)])


def stage_cost() -> ca.Function:
    """Map (node, torque, p) to the stage cost L."""
    node, torque = ca.SX.sym('node', stage.NODE), ca.SX.sym('torque', 3)
    flat = ca.SX.sym('flat', PARAMETERS)
    p = unpack(flat)
    cost = stage.state_cost_value(node, p) + stage.torque_cost(torque, p)
    return ca.Function('stage_cost', [node, torque, flat], [cost])


def terminal_value(structure: Structure) -> ca.Function:
    """Map (node, p) to ``xi^T P xi / c``, at most 1 in the terminal set."""
    node, flat = ca.SX.sym('node', stage.NODE), ca.SX.sym('flat', PARAMETERS)
    p = unpack(flat)
    xi = stage.terminal_coordinates(node, structure.pointing, p)
    form = ca.dot(xi, p.terminal_weight @ xi) / p.terminal_level
    return ca.Function('terminal_value', [node, flat], [form])
