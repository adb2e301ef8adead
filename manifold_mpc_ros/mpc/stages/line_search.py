# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The line search of a pass: a new trajectory, its inequalities, cost, and whether it is sound.

The steps turn by the increments of the linear roll-out; torques, momenta and attitudes follow
from them without solving anything, so every trial step is a true trajectory of the LGVI.
"""

from __future__ import annotations

import casadi as ca

from manifold_mpc_ros.lie.symbolic import quaternion_product, rotation_from_quaternion
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.options import BOUNDARY
from manifold_mpc_ros.mpc.program.phase import Field, Order, Phase, Read, Structure, phase
from manifold_mpc_ros.mpc.scaling import unpack
from manifold_mpc_ros.mpc.stages import merit
from manifold_mpc_ros.mpc.stages import step_derivatives as form
from manifold_mpc_ros.mpc.stages.barrier import advance_elastic, elastic_bounds, least, product
from manifold_mpc_ros.mpc.stages.implicit_step import implicit_step
from manifold_mpc_ros.mpc.stages.inequalities import (
    node_inequalities,
    terminal_level,
    torque_inequalities,
)
from manifold_mpc_ros.mpc.stages.inequality import Variation
from manifold_mpc_ros.mpc.stages.quadratic_model import node_at
from manifold_mpc_ros.mpc.stages.reference import errors, excess_torque
from manifold_mpc_ros.mpc.stages.terminal import form_of

# A step may turn by at most this much in one trial [rad]: it stays on its branch.
_LARGEST_TURN = 1.0


def _turned_step(step: ca.SX, beta: ca.SX) -> ca.SX:
    """Return ``cay(beta / 2) step`` as a unit quaternion, ``exp(beta) step`` to second order."""
    longer = quaternion_product(ca.vertcat(1, beta / 2), step)
    return longer / ca.sqrt(ca.dot(longer, longer))


def turn_phase(structure: Structure) -> Phase:
    """Turn every step by its increment: momenta at its ends, and whether it is sound.

    ``f <- cay(beta / 2) f`` with ``beta = length g^T alpha`` (3,) in body axes [rad], m+ and m- of
    the new step. It is sound while ``det D+ > 0`` (its branch) and ``|beta| < 1``; the least of
    ``det D+`` and ``1 - |beta|^2`` says so.
    """
    field, increment = (f.STEP, f.CONTROL) if structure.symmetric else (f.FREE, f.MOVE)

    def expression(read: Read) -> dict[Field, ca.SX]:
        p = unpack(read(f.PARAMETER))
        g = rotation_from_quaternion(read(f.ATTITUDE))
        beta = read(f.LENGTH) * (g.T @ read(increment))
        step = _turned_step(read(field), beta)
        after, before = form.momenta(step, p.inertia)
        sound = ca.fmin(form.principal(step, p.inertia), _LARGEST_TURN ** 2 - ca.dot(beta, beta))
        writes = {field: step, f.MOMENTUM_BEFORE: before, f.SOUND_STEP: sound}
        return writes | {f.MOMENTUM_AFTER if structure.symmetric else f.MOMENTUM: after}

    return phase('turn', expression, beyond=0 if structure.symmetric else 1)


def chain_phase(structure: Structure) -> Phase:
    """Chain the steps: ``g_{k+1} = g_k f_k``, and ``Pi_{k+1} = m+ + m- - Pi_k`` (symmetric)."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        node = ca.if_else(read(f.LATER) != 0, read(f.CHAIN), read(f.START))
        q, momentum = node[0:4], node[4:7]
        if structure.symmetric:
            passed = read(f.MOMENTUM_AFTER) + read(f.MOMENTUM_BEFORE)
            after = passed / form.periods(structure, read) - momentum
            return {f.ATTITUDE: q, f.MOMENTUM: momentum, f.CHAIN: ca.vertcat(
                quaternion_product(q, read.new(f.STEP)), after)}
        return {f.ATTITUDE: q, f.CHAIN: ca.vertcat(
            quaternion_product(q, read.new(f.FREE)), momentum)}

    return phase('chain', expression, order=Order.FORWARD, beyond=1)


def node_phase(structure: Structure) -> Phase:
    """Free step, limits and cost of a node."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        p, alpha = unpack(read(f.PARAMETER)), read(f.LENGTH)
        momentum, sound = read.new(f.MOMENTUM), ca.SX(1)
        writes: dict[Field, ca.SX] = {}
        if structure.symmetric:
            free, sound = implicit_step(momentum, p, read(f.FREE))
            writes[f.FREE] = free
        else:
            free = read.new(f.FREE)
        cost = read(f.INNER) * merit.state_cost(
            *errors(structure, read, read.new(f.ATTITUDE), free), p)
        moved = read(f.MOVE) if structure.symmetric else (
            ca.reshape(read(f.AFTER), 3, 3) @ read(f.MOVE))
        step = Variation(alpha * read(f.TURN), alpha * (p.inertia_inverse @ moved))
        rate_change = p.inertia_inverse @ (momentum - read(f.MOMENTUM))
        for each in node_inequalities(structure):
            writes |= each.advance(
                read, node_at(read, p, new=True), node_at(read, p), rate_change, step)
        writes |= merit.node_merit(structure, read(f.LATER), writes)
        return writes | {f.COST_NODE: cost, f.SOUND_NODE: sound}

    return phase('node_trial', expression, beyond=1)


def stage_phase(structure: Structure) -> Phase:
    """Torque, its limits and cost of a stage.

    ``u_k = 2 (m+(f_k) - Pi_k)`` symmetric, ``m+(f_{k+1}) - m-(f_k)`` with the paper's forcing: no
    equation is solved. The stage is sound while each slack keeps half of what a step may leave,
    ``y_new > (1 - BOUNDARY) / 2 y``.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        p, r = unpack(read(f.PARAMETER)), form.periods(structure, read)
        if structure.symmetric:
            u = 2 * (read(f.MOMENTUM_AFTER) / r - read.new(f.MOMENTUM)) / r
        else:
            u = read.new(f.MOMENTUM, 1) - read(f.MOMENTUM_BEFORE)
        cost = r * merit.torque_cost(excess_torque(structure, read, u), p)
        writes = {f.TORQUE: u, f.COST_STAGE: cost,
                  f.SOUND_STAGE: read(f.SOUND_STEP, 0 if structure.symmetric else 1)}
        limits = torque_inequalities(structure)
        for each in limits:
            moved = each.advance(read, u)
            writes |= moved
            writes[f.SOUND_STAGE] = ca.fmin(writes[f.SOUND_STAGE], least(
                moved[each.slack] - (1 - BOUNDARY) / 2 * read(each.slack)))
        if limits:
            writes[f.SLACKS_STAGE] = product(ca.vertcat(*(writes[each.slack] for each in limits)))
        return writes

    return phase('stage_trial', expression)


def terminal_phase(structure: Structure) -> Phase:
    """Terminal cost ``xi^T P xi / 2`` and set ``xi^T P xi / c - 1 <= t``; sums start here.

    The value's change is a difference of two forms, its linear model ``2/c (D^T P xi) . step``,
    D = d xi / d (theta, sigma) of `terminal.terminal_phase`.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        p, mu, alpha = unpack(read(f.PARAMETER)), read(f.BARRIER), read(f.LENGTH)
        new = form_of(*errors(structure, read, read.new(f.ATTITUDE), read.new(f.FREE)),
                      structure.pointing, p)
        limit = terminal_level(structure)
        if limit is None:
            return {f.SUMS: ca.vertcat(new / 2, 0, 1)}
        old = form_of(*errors(structure, read, read(f.ATTITUDE), read(f.FREE)),
                      structure.pointing, p)
        t = read(limit.elastic)
        bounds = elastic_bounds(read(limit.slack), t, read(limit.multiplier), mu, limit.penalty)
        predicted = alpha * 2 * ca.dot(read(f.FORM_GRADIENT), ca.vertcat(
            read(f.TURN), read(f.MOVE))) / p.terminal_level
        y, t, s = advance_elastic(bounds, (new - old) / p.terminal_level, predicted, t, alpha, mu,
                                  limit.penalty)
        return {limit.slack: y, limit.elastic: t, limit.multiplier: s,
                f.SUMS: merit.terminal_sums(new, limit, y, t)}

    return phase('terminal_trial', expression, beyond=1, last=1)
