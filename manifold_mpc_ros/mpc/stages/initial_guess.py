# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starting trajectories: a slew by a simple saturated law, or a plan shifted by one step.

The sign of the starting quaternion chooses the side: the law follows the continuous rotation
vector of length up to 2 pi, so ``q`` turns the short way and ``-q`` the long way round. A lean
(three signs) saturates the torques in that octant for the first steps, which leaves the plane
of the eigenaxis slew; planar slews are stationary points that no descent method leaves. When
pointing without torque limits the lean is the axis (a unit vector) of the first turn instead.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from manifold_mpc_ros.dynamics.symbolic import solve_3x3
from manifold_mpc_ros.lie.symbolic import quaternion_product
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.phase import Field, Order, Phase, Read, Structure, phase
from manifold_mpc_ros.mpc.scaling import Parameters, unpack
from manifold_mpc_ros.mpc.stages import merit
from manifold_mpc_ros.mpc.stages import step_derivatives as form
from manifold_mpc_ros.mpc.stages.barrier import elastic_start, join, most, product
from manifold_mpc_ros.mpc.stages.cone import AIM, WAY, WAY_LIMITS
from manifold_mpc_ros.mpc.stages.implicit_step import implicit_step
from manifold_mpc_ros.mpc.stages.inequalities import (
    cone_inequalities,
    node_inequalities,
    rate_box,
    rate_inequalities,
    terminal_level,
    torque_box,
    torque_inequalities,
)
from manifold_mpc_ros.mpc.stages.quadratic_model import node_at
from manifold_mpc_ros.mpc.stages.reference import (
    errors,
    excess_rate,
    excess_torque,
    own_torque,
)
from manifold_mpc_ros.mpc.stages.terminal import coordinates, error_vector, form_of

# Fractions of the limits that a starting trajectory uses.
_TORQUE_FRACTION = 0.9
_RATE_FRACTION = 0.85
_BRAKING_FRACTION = 0.6
# A starting slew turns at most this much per step [rad], and loads the existence guard so far.
_FREE_RATE = 0.7
_GUARD_FRACTION = 0.6
# Largest distance of a starting torque from its limit, as a fraction of it.
_LARGEST_MARGIN = 0.1


def _continuous_log(q: ca.SX) -> ca.SX:
    """Map a unit quaternion to its rotation vector of length up to 2 pi, ``q = -1`` to zero."""
    v = q[1:4]
    sine = ca.sqrt(ca.dot(v, v) + 1e-30)
    return 2 * ca.atan2(sine, q[0]) / sine * v


def slew_torque(structure: Structure, q: ca.SX, omega: ca.SX, p: Parameters, read: Read
                ) -> ca.SX:
    """Map (q, omega) to a torque: the local law with its rate capped for braking, or a lean."""
    lean, max_torque = read(f.LEAN), torque_box(structure, read)
    by_angle, by_rate = p.terminal_gain[:, 0:3], p.terminal_gain[:, 3:6]
    cones, straight = cone_inequalities(structure), ca.SX(1)
    if cones:
        aim = read(AIM)
        straight = aim[0] == 1
        q = quaternion_product(ca.vertcat(aim[0], -aim[1:4]), q)
    error = _continuous_log(q)
    if structure.pointing:
        error = ca.if_else(straight, error_vector(q, True, p), error)
        if cones:  # the way to an aim has a roll, which the gain does not see
            by_angle += ca.trace(by_angle) / 2 * p.pointing_axis @ p.pointing_axis.T
        if max_torque is None:
            aside = ca.norm_2(error) * lean
            error = ca.if_else(ca.dot(lean, lean) > 0, aside, error)
    length = ca.sqrt(ca.dot(error, error) + 1e-30)
    axis = error / length
    r = form.periods(structure, read)
    cap = ca.fmin(_FREE_RATE, _GUARD_FRACTION * p.guard / ca.norm_2(p.inertia @ axis)) / r
    if max_torque is not None:
        effort = p.inertia @ axis / max_torque
        braking = 1 / ca.sqrt(ca.dot(effort, effort))
        cap = ca.fmin(cap, ca.sqrt(2 * _BRAKING_FRACTION * braking * length))
    for each in rate_inequalities(structure):
        cap = ca.fmin(cap, _RATE_FRACTION * each.largest_rate(read, axis))
    if structure.graded:  # a long step does not pass the target
        cap = ca.fmin(cap, length / 2 / r)
    wanted = by_angle @ error
    natural = solve_3x3(by_rate, wanted)
    shrink = ca.fmin(1, cap / ca.sqrt(ca.dot(natural, natural) + 1e-30))
    torque = shrink * wanted + by_rate @ omega
    if structure.graded:  # what the law asks for at the end of the step
        torque = solve_3x3(ca.SX.eye(3) - r * by_rate @ p.inertia_inverse, torque)
    if max_torque is not None:
        torque = ca.if_else(
            ca.dot(lean, lean) > 0,
            _lean_torque(lean * max_torque, omega, p, rate_box(structure, read)), torque)
        torque = _clip(torque, _TORQUE_FRACTION * max_torque)
    return torque


def _lean_torque(leaning: ca.SX, omega: ca.SX, p: Parameters, max_rate: ca.SX | None) -> ca.SX:
    """Return the torque of an octant, as far as the rate limits leave room."""
    if max_rate is None:
        return leaning
    room, inertia = _RATE_FRACTION * max_rate, ca.diag(p.inertia)
    return ca.fmin(ca.fmax(leaning, inertia * (-room - omega)), inertia * (room - omega))


def _clip(torque: ca.SX, limit: ca.SX) -> ca.SX:
    """Return the torque clipped to ``|torque_i| <= limit_i``."""
    return ca.fmin(ca.fmax(torque, -limit), limit)


class _Node(NamedTuple):
    """Attitude, momentum and free step of the node that a roll-out has reached."""

    attitude: ca.SX
    momentum: ca.SX
    free: ca.SX
    sound: ca.SX


def _reached(read: Read, p: Parameters, guess: ca.SX | None = None) -> _Node:
    """Return the node of stage k: the measured one at k = 0."""
    node = ca.if_else(read(f.LATER) != 0, read(f.CHAIN), read(f.START))
    return _Node(node[0:4], node[4:7], *implicit_step(node[4:7], p, guess))


def _advanced(structure: Structure, node: _Node, u: ca.SX, p: Parameters, read: Read,
              guess: ca.SX | None = None) -> dict[Field, ca.SX]:
    """Return what a roll-out writes at a node for the torque u, and where the step leads."""
    step, sound = node.free, node.sound
    writes = {f.ATTITUDE: node.attitude, f.MOMENTUM: node.momentum, f.FREE: node.free,
              f.TORQUE: u}
    if structure.symmetric:
        r = form.periods(structure, read)
        step, also = implicit_step(r * (node.momentum + r * u / 2), p, guess)
        sound, impulse = ca.fmin(sound, also), r * u / 2
        writes[f.STEP] = step
        after = form.momenta(step, p.inertia)[1] / r + impulse
    else:
        after = form.momenta(step, p.inertia)[1] + u
    return writes | {f.SOUND_NODE: sound, f.CHAIN: ca.vertcat(
        quaternion_product(node.attitude, step), after)}


def _inside(structure: Structure, u: ca.SX, margin: ca.SX, read: Read) -> ca.SX:
    """Return a torque that keeps the margin, a fraction of the limits, from them."""
    max_torque = torque_box(structure, read)
    return u if max_torque is None else _clip(u, (1 - margin) * max_torque)


def _cold_margin(mu: ca.SX) -> ca.SX:
    """Return about how far from its bounds the central path of mu is."""
    return ca.fmin(_LARGEST_MARGIN, ca.sqrt(mu))


def slew_phase(structure: Structure) -> Phase:
    """Roll the slew law out."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        p = unpack(read(f.PARAMETER))
        node = _reached(read, p)
        omega = p.inertia_inverse @ node.momentum
        q, _ = errors(structure, read, node.attitude, node.free)
        omega = excess_rate(structure, read, node.attitude, omega)
        u = own_torque(structure, read, slew_torque(structure, q, omega, p, read))
        u = _inside(structure, u, _cold_margin(read(f.BARRIER)), read)
        return _advanced(structure, node, u, p, read)

    return phase('roll_slew', expression, order=Order.FORWARD, beyond=1)


def shift_phase(structure: Structure) -> Phase:
    """Roll the torques of the old plan out, one stage ahead of it.

    Its torques on a limit get the slack that the central path of mu gives their multipliers.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        p, u = unpack(read(f.PARAMETER)), form.one_period_on(structure.graded, read, f.TORQUE)
        node = _reached(read, p, form.one_period_on(structure.graded, read, f.FREE))
        for each in torque_inequalities(structure):
            u = each.inside(read, u, ca.fmin(
                _LARGEST_MARGIN, read(f.BARRIER) / form.one_period_on(
                    structure.graded, read, each.multiplier)))
        guess = (form.step_one_period_on(structure.graded, read, f.STEP) if structure.symmetric
                 else None)
        return _advanced(structure, node, u, p, read, guess)

    return phase('roll_shift', expression, order=Order.FORWARD, beyond=-1)


def local_phase(structure: Structure) -> Phase:
    """Roll the local law ``u = K xi`` out for the last stage."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        p = unpack(read(f.PARAMETER))
        node = _reached(read, p)
        xi = coordinates(*errors(structure, read, node.attitude, node.free),
                         structure.pointing, p)
        u = own_torque(structure, read, p.terminal_gain @ xi)
        if structure.graded:
            r = form.periods(structure, read)
            u = ((r - 1) * read(f.TORQUE) + u) / r  # one period of the local law
        u = _inside(structure, u, _cold_margin(read(f.BARRIER)), read)
        return _advanced(structure, node, u, p, read)

    return phase('roll_local', expression, order=Order.FORWARD, beyond=1, last=2)


def _node_phase(structure: Structure, name: str, *, warm: bool) -> Phase:
    """Put the barrier variables of a node's limits near the central path of mu."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        p = unpack(read(f.PARAMETER))
        writes = {f.COST_NODE: read(f.INNER) * merit.state_cost(
            *errors(structure, read, read.new(f.ATTITUDE), read.new(f.FREE)), p)}
        for each in node_inequalities(structure):
            writes |= each.begin(read, node_at(read, p, new=True), warm=warm)
        return writes | merit.node_merit(structure, read(f.LATER), writes)

    return phase(name, expression, beyond=1)


def cold_node_phase(structure: Structure) -> Phase:
    """Begin the limits of a node."""
    return _node_phase(structure, 'cold_node', warm=False)


def warm_node_phase(structure: Structure) -> Phase:
    """Begin the limits of a node with the multipliers of the plan before."""
    return _node_phase(structure, 'warm_node', warm=True)


def _stage_phase(structure: Structure, name: str, *, warm: bool) -> Phase:
    """Put the barrier variables of a stage's torque limits near the central path of mu."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        p, u = unpack(read(f.PARAMETER)), read.new(f.TORQUE)
        writes = {f.COST_STAGE: form.periods(structure, read) * merit.torque_cost(
            excess_torque(structure, read, u), p), f.SOUND_STAGE: ca.SX(1)}
        limits = torque_inequalities(structure)
        for each in limits:
            writes |= each.begin(read, u, warm=warm)
        if limits:
            writes[f.SLACKS_STAGE] = product(ca.vertcat(*(writes[each.slack] for each in limits)))
        return writes

    return phase(name, expression)


def cold_stage_phase(structure: Structure) -> Phase:
    """Begin the torque limits of a stage."""
    return _stage_phase(structure, 'cold_stage', warm=False)


def warm_stage_phase(structure: Structure) -> Phase:
    """Begin the torque limits of a stage with the multipliers of the plan before."""
    return _stage_phase(structure, 'warm_stage', warm=True)


def begin_terminal_phase(structure: Structure) -> Phase:
    """Put the barrier variables of the terminal set on the central path; start the sums."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        p = unpack(read(f.PARAMETER))
        value = form_of(*errors(structure, read, read.new(f.ATTITUDE), read.new(f.FREE)),
                        structure.pointing, p)
        limit = terminal_level(structure)
        if limit is None:
            return {f.SUMS: ca.vertcat(value / 2, 0, 1)}
        y, t, s = elastic_start(value / p.terminal_level - 1, read(f.BARRIER), limit.penalty)
        return {limit.slack: y, limit.elastic: t, limit.multiplier: s,
                f.SUMS: merit.terminal_sums(value, limit, y, t)}

    return phase('begin_terminal', expression, beyond=1, last=1)


def way_phases(structure: Structure) -> tuple[Phase, ...]:
    """Map the axes of a way's two turns to its rate and deceleration; none without cones.

    The rate is the largest about both axes a that every limit allows, the deceleration that of
    ``|J a|_i / max_torque_i``, the largest over both; of each a fraction, dimensionless.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        p, max_torque = unpack(read(f.PARAMETER)), torque_box(structure, read)
        axes = ca.vertsplit(read(WAY), 3)
        rate = join(ca.fmin, [each.rate_about(read, axis) for axis in axes
                              for each in rate_inequalities(structure)])
        effort = most(ca.vertcat(*(ca.fabs(p.inertia @ axis) / max_torque for axis in axes)))
        return {WAY_LIMITS: ca.vertcat(
            _RATE_FRACTION * rate, _BRAKING_FRACTION / ca.fmax(effort, 1e-9))}

    return (phase('way', expression, only=1),) if cone_inequalities(structure) else ()
