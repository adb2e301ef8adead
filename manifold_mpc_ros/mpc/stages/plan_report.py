# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the caller of a solve wants to know of a plan, in the caller's frames."""

from __future__ import annotations

import casadi as ca

from manifold_mpc_ros.lie.symbolic import rotation_from_quaternion
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.phase import Field, Order, Phase, Read, Structure, phase
from manifold_mpc_ros.mpc.scaling import unpack
from manifold_mpc_ros.mpc.stages import merit
from manifold_mpc_ros.mpc.stages.barrier import least, most
from manifold_mpc_ros.mpc.stages.inequalities import (
    cone_inequalities,
    node_inequalities,
    terminal_level,
    torque_inequalities,
)
from manifold_mpc_ros.mpc.stages.initial_state import row_by_row
from manifold_mpc_ros.mpc.stages.reference import errors, excess_torque
from manifold_mpc_ros.mpc.stages.terminal import form_of


def report_phases(structure: Structure) -> tuple[Phase, ...]:
    """Return the phases that describe a plan."""
    return _first_phase(structure), *_limit_phases(structure), _last_phase(structure)


def _level(structure: Structure, read: Read) -> ca.SX:
    """Return ``xi^T P xi / c`` of a node."""
    p = unpack(read(f.PARAMETER))
    off = errors(structure, read, read(f.ATTITUDE), read(f.FREE))
    return form_of(*off, structure.pointing, p) / p.terminal_level


def _first_phase(structure: Structure) -> Phase:
    """Cost of the first stage, level of the first node."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        p = unpack(read(f.PARAMETER))
        cost = merit.state_cost(*errors(structure, read, read(f.ATTITUDE), read(f.FREE)), p)
        effort = merit.torque_cost(excess_torque(structure, read, read(f.TORQUE)), p)
        return {f.FIRST_COST: cost + effort,
                f.FIRST_LEVEL: _level(structure, read), f.LEAST_CONE_SLACK: ca.SX(1e30),
                f.LARGEST_MULTIPLIER: ca.SX(0),
                **{each.excess: ca.SX.zeros(2) for each in node_inequalities(structure)}}

    return phase('report_first', expression, only=1)


def _limit_phases(structure: Structure) -> tuple[Phase, ...]:
    """Sum of the elastic parts t of each kind of a node's limits and largest v = t - y, k >= 1.

    And the largest multiplier, of stage k and node k + 1.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        writes = {}
        for each in node_inequalities(structure):
            excess, t = read(each.excess), read(each.elastic, 1)
            writes[each.excess] = ca.vertcat(
                excess[0] + ca.sum1(t), ca.fmax(excess[1], most(t - read(each.slack, 1))))
        if cones := cone_inequalities(structure):
            slacks = ca.vertcat(*(read(each.slack, 1) for each in cones))
            writes[f.LEAST_CONE_SLACK] = ca.fmin(read(f.LEAST_CONE_SLACK), least(slacks))
        writes[f.LARGEST_MULTIPLIER] = most(ca.vertcat(
            read(f.LARGEST_MULTIPLIER),
            *(read(each.multiplier) for each in torque_inequalities(structure)),
            *(read(each.multiplier, 1) for each in node_inequalities(structure))))
        return writes

    if not (node_inequalities(structure) or torque_inequalities(structure)):
        return ()
    return (phase('report_limits', expression, order=Order.FORWARD),)


def _last_phase(structure: Structure) -> Phase:
    """Level of the last node, by how much it misses the terminal set, and all penalties."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        limit, nodes = terminal_level(structure), node_inequalities(structure)
        missed, held = ca.SX(0), read(f.LARGEST_MULTIPLIER)
        if limit is not None:
            missed, held = read(limit.elastic), ca.fmax(held, read(limit.multiplier))
        penalties = sum((each.penalty * read(each.excess)[0] for each in nodes), start=ca.SX(0))
        if limit is not None:
            penalties += limit.penalty * missed
        violations = [read(each.excess)[1] for each in nodes]
        return {f.LAST_LEVEL: _level(structure, read), f.MISSED: missed,
                f.LARGEST_MULTIPLIER: held, f.PENALTIES: penalties,
                f.LARGEST_VIOLATION: most(ca.vertcat(*violations)) if violations else ca.SX(0)}

    return phase('report_last', expression, beyond=1, last=1)


def pose_phase() -> Phase:
    """Attitude R_NB, row by row, and dimensionless rate of every node."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        p = unpack(read(f.PARAMETER))
        attitude = row_by_row(read(f.MEASURED)[9:18]) @ rotation_from_quaternion(
            read(f.ATTITUDE))
        return {f.POSE: ca.vertcat(ca.vec(attitude.T),
                                   p.inertia_inverse @ read(f.MOMENTUM))}

    return phase('report_pose', expression, beyond=1)
