# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Costs, penalties and barrier terms, and their sums over a trajectory."""

from __future__ import annotations

import operator

import casadi as ca

from manifold_mpc_ros.lie.symbolic import trace_hessian
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.phase import Field, Order, Phase, Read, Structure, phase
from manifold_mpc_ros.mpc.scaling import Parameters
from manifold_mpc_ros.mpc.stages.barrier import join, product, where
from manifold_mpc_ros.mpc.stages.inequalities import (
    node_inequalities,
    torque_inequalities,
    wheel_inequalities,
)
from manifold_mpc_ros.mpc.stages.terminal_level import TerminalLevel


def state_cost(q: ca.SX, free: ca.SX, p: Parameters) -> ca.SX:
    """Return ``tr(Qg (I - g)) + tr(Qf (I - f))`` without cancellation near the identity.

    For a unit quaternion (w, v) and symmetric Q, ``tr(Q (I - R)) = 2 v^T (tr(Q) I - Q) v``.
    """
    v, c = q[1:4], free[1:4]
    return 2 * (ca.dot(v, trace_hessian(p.attitude_weight) @ v)
                + ca.dot(c, trace_hessian(p.rate_weight) @ c))


def torque_cost(u: ca.SX, p: Parameters) -> ca.SX:
    """Return ``tr(hat(u)^T R hat(u)) / 2 = u^T (tr(R) I - R) u / 2``."""
    return ca.dot(u, p.torque_hessian @ u) / 2


def node_merit(structure: Structure, later: ca.SX, writes: dict[Field, ca.SX]
               ) -> dict[Field, ca.SX]:
    """Return penalty and barrier product of a node's limits; neutral at k = 0.

    ``writes`` has their slacks and elastic parts.
    """
    limits, wheels = node_inequalities(structure), wheel_inequalities(structure)
    if not limits:
        return {}
    penalty = sum(each.penalty * ca.sum1(writes[each.elastic]) for each in limits)
    slacks = join(operator.mul, [product(ca.vertcat(writes[each.slack], writes[each.elastic]))
                                 for each in limits if each not in wheels] or [ca.SX(1)])
    return {f.PENALTY_NODE: where(later, penalty),
            f.SLACKS_NODE: ca.if_else(later != 0, slacks, 1),
            **{each.parts: each.products_of(writes[each.slack], writes[each.elastic])
               for each in wheels}}


def terminal_sums(value: ca.SX, limit: TerminalLevel, y: ca.SX, t: ca.SX) -> ca.SX:
    """Return the terminal share (3,) of the sums: cost, logarithms, soundness.

    ``value / 2 + penalty t``, ``log(y t)`` and 1; ``value`` is ``xi^T P xi``.
    """
    return ca.vertcat(value / 2 + limit.penalty * t, ca.log(y * t), 1)


def gather_phase(structure: Structure) -> Phase:
    """Add the terms of stage k and node k + 1 to the sums (3,), from N - 1 back.

    They are the cost ``sum_k L_k`` with penalties, ``sum log`` of slacks and elastic parts, and
    the least soundness, positive when all are sound; the merit is ``cost - mu logs``.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        sums = read(f.SUMS)
        cost = read(f.COST_NODE) + read(f.COST_STAGE)
        sound = ca.fmin(ca.fmin(read(f.SOUND_NODE), read(f.SOUND_NODE, 1)), read(f.SOUND_STAGE))
        slacks = ca.SX(1)
        if node_inequalities(structure):
            cost += read(f.PENALTY_NODE, 1)
            slacks *= read(f.SLACKS_NODE, 1)
        if torque_inequalities(structure):
            slacks *= read(f.SLACKS_STAGE)
        logs = ca.SX(0) if slacks.is_constant() else ca.log(slacks)
        for each in wheel_inequalities(structure):
            logs += ca.sum1(ca.log(read(each.parts, 1)))
        return {f.SUMS: ca.vertcat(sums[0] + cost, sums[1] + logs, ca.fmin(sums[2], sound))}

    return phase('gather', expression, order=Order.BACKWARD)
