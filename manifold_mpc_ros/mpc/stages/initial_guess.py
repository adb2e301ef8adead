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
from manifold_mpc_ros.mpc.program.phase import Field, Order, Phase, Read, phase
from manifold_mpc_ros.mpc.program.structure import RATE_PENALTY, TERMINAL_PENALTY, Structure
from manifold_mpc_ros.mpc.scaling import Parameters, unpack
from manifold_mpc_ros.mpc.stages import merit
from manifold_mpc_ros.mpc.stages import step_derivatives as form
from manifold_mpc_ros.mpc.stages.barrier import (
    LARGEST_START_MULTIPLIER,
    box,
    elastic_start,
    product,
)
from manifold_mpc_ros.mpc.stages.implicit_step import implicit_step
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
# Multipliers of a shifted plan stay above the central ones divided by this.
_WARM_SPREAD = 10.0


def _continuous_log(q: ca.SX) -> ca.SX:
    """Map a unit quaternion to its rotation vector of length up to 2 pi, ``q = -1`` to zero."""
    v = q[1:4]
    sine = ca.sqrt(ca.dot(v, v) + 1e-30)
    return 2 * ca.atan2(sine, q[0]) / sine * v


def slew_torque(structure: Structure, q: ca.SX, omega: ca.SX, lean: ca.SX, p: Parameters
                ) -> ca.SX:
    """Map (q, omega, lean (3,)) to a torque: the local law with its rate capped for braking."""
    error = _continuous_log(q)
    if structure.pointing:
        error = error_vector(q, True, p)
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
        torque = ca.if_else(ca.dot(lean, lean) > 0, _lean_torque(structure, omega, lean, p),
                            torque)
        torque = _clip(torque, _TORQUE_FRACTION * p.max_torque)
    return torque


def _lean_torque(structure: Structure, omega: ca.SX, lean: ca.SX, p: Parameters) -> ca.SX:
    """Return the torque of an octant, as far as the rate limits leave room."""
    leaning = lean * p.max_torque
    if not structure.rate_box:
        return leaning
    room, inertia = _RATE_FRACTION * p.max_rate, ca.diag(p.inertia)
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


def _advanced(structure: Structure, node: _Node, u: ca.SX, p: Parameters,
              guess: ca.SX | None = None) -> dict[Field, ca.SX]:
    """Return what a roll-out writes at a node for the torque u, and where the step leads."""
    step, sound, impulse = node.free, node.sound, u
    writes = {f.ATTITUDE: node.attitude, f.MOMENTUM: node.momentum, f.FREE: node.free,
              f.TORQUE: u}
    if structure.symmetric:
        step, also = implicit_step(node.momentum + u / 2, p, guess)
        sound, impulse = ca.fmin(sound, also), u / 2
        writes[f.STEP] = step
    after = form.momenta(step, p.inertia)[1] + impulse
    return writes | {f.SOUND_NODE: sound, f.CHAIN: ca.vertcat(
        quaternion_product(node.attitude, step), after)}


def _inside(structure: Structure, u: ca.SX, margin: ca.SX, p: Parameters) -> ca.SX:
    """Return a torque that keeps the margin, a fraction of the limits, from them."""
    return _clip(u, (1 - margin) * p.max_torque) if structure.torque_box else u


def _cold_margin(mu: ca.SX) -> ca.SX:
    """Return about how far from its bounds the central path of mu is."""
    return ca.fmin(_LARGEST_MARGIN, ca.sqrt(mu))


def slew_phase(structure: Structure) -> Phase:
    """Roll the slew law out."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        p = unpack(read(f.PARAMETER))
        node = _reached(read, p)
        omega = p.inertia_inverse @ node.momentum
        u = slew_torque(structure, node.attitude, omega, read(f.LEAN), p)
        u = _inside(structure, u, _cold_margin(read(f.BARRIER)), p)
        return _advanced(structure, node, u, p)

    return phase('roll_slew', expression, order=Order.FORWARD, beyond=1)


def shift_phase(structure: Structure) -> Phase:
    """Roll the torques of the old plan out, one stage ahead of it.

    Its torques on a limit get the slack that the central path of mu gives their multipliers.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        p, u = unpack(read(f.PARAMETER)), read(f.TORQUE, 1)
        node = _reached(read, p, read(f.FREE, 1))
        if structure.torque_box:
            margin = ca.fmin(_LARGEST_MARGIN, read(f.BARRIER) / read(f.TORQUE_DUAL, 1))
            ratio = u / p.max_torque
            ratio = ca.fmin(ca.fmax(ratio, margin[3:6] - 1), 1 - margin[0:3])
            u = ratio * p.max_torque
        guess = read(f.STEP, 1) if structure.symmetric else None
        return _advanced(structure, node, u, p, guess)

    return phase('roll_shift', expression, order=Order.FORWARD, beyond=-1)


def local_phase(structure: Structure) -> Phase:
    """Roll the local law ``u = K xi`` out for the last stage."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        p = unpack(read(f.PARAMETER))
        node = _reached(read, p)
        xi = coordinates(node.attitude, node.free, structure.pointing, p)
        u = _inside(structure, p.terminal_gain @ xi, _cold_margin(read(f.BARRIER)), p)
        return _advanced(structure, node, u, p)

    return phase('roll_local', expression, order=Order.FORWARD, beyond=1, last=2)


def _node_phase(structure: Structure, name: str, *, warm: bool) -> Phase:
    """Put the barrier variables of a node's rate limits near the central path of mu."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        p, mu = unpack(read(f.PARAMETER)), read(f.BARRIER)
        cost = read(f.INNER) * merit.state_cost(read.new(f.ATTITUDE), read.new(f.FREE), p)
        if not structure.rate_box:
            return {f.COST_NODE: cost}
        omega = p.inertia_inverse @ read.new(f.MOMENTUM)
        y, t, s = elastic_start(box(omega, p.max_rate), mu, RATE_PENALTY)
        if warm:
            s = ca.if_else(read(f.INNER) != 0, _kept(read(f.RATE_DUAL, 1), mu, y), s)
        return {f.COST_NODE: cost, f.RATE_SLACK: y, f.RATE_ELASTIC: t, f.RATE_DUAL: s,
                **merit.rate_merit(read(f.LATER), y, t)}

    return phase(name, expression, beyond=1)


def _kept(s: ca.SX, mu: ca.SX, y: ca.SX) -> ca.SX:
    """Return the multiplier of the old plan, not far below the central path."""
    return ca.fmin(ca.fmax(s, mu / y / _WARM_SPREAD), LARGEST_START_MULTIPLIER)


def cold_node_phase(structure: Structure) -> Phase:
    """Begin the rate limits of a node."""
    return _node_phase(structure, 'cold_node', warm=False)


def warm_node_phase(structure: Structure) -> Phase:
    """Begin the rate limits of a node with the multipliers of the plan before."""
    return _node_phase(structure, 'warm_node', warm=True)


def _stage_phase(structure: Structure, name: str, *, warm: bool) -> Phase:
    """Put the barrier variables of a stage's torque limits near the central path of mu."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        p, u, mu = unpack(read(f.PARAMETER)), read.new(f.TORQUE), read(f.BARRIER)
        writes = {f.COST_STAGE: merit.torque_cost(u, p), f.SOUND_STAGE: ca.SX(1)}
        if structure.torque_box:
            y = -box(u, p.max_torque)
            s = mu / y
            if warm:
                kept = ca.fmax(read(f.TORQUE_DUAL, 1), mu / y / _WARM_SPREAD)
                s = ca.if_else(read(f.INNER, 1) != 0, kept, s)
            writes |= {f.TORQUE_SLACK: y, f.TORQUE_DUAL: s, f.SLACKS_STAGE: product(y)}
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
        value = form_of(read.new(f.ATTITUDE), read.new(f.FREE), structure.pointing, p)
        if not structure.terminal_set:
            return {f.SUMS: ca.vertcat(value / 2, 0, 1)}
        level = elastic_start(value / p.terminal_level - 1, read(f.BARRIER), TERMINAL_PENALTY)
        return {f.LEVEL: ca.vertcat(*level), f.SUMS: merit.terminal_sums(value, *level[:2])}

    return phase('begin_terminal', expression, beyond=1, last=1)
