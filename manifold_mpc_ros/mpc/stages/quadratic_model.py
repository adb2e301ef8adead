# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The quadratic model of a pass: gradients and Hessians of every stage, in spatial increments.

A variation turns the attitude by theta and the step by alpha in inertial axes,
``q_k -> exp(theta_k) q_k`` and ``step_k -> exp(g_k^T alpha_k) step_k``, so that
``theta_{k+1} = theta_k + alpha_k`` up to second order, ``+ theta_k x alpha_k / 2``. Torques and
momenta are explicit in the steps (docs/solver.md):

- paper's forcing: ``u_k = m+(step_{k+1}) - m-(step_k)``; state (theta_k, alpha_k), control
  alpha_{k+1};
- symmetric: ``u_k = 2 (m+(step_k) - Pi_k)``, ``Pi_{k+1} = m+ + m- - Pi_k``; state
  (theta_k, d Pi_k), control alpha_k.

``exact`` blends from Gauss-Newton (0) to the exact Hessian of the Lagrangian (1).
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from manifold_mpc_ros.dynamics.symbolic import solve_3x3
from manifold_mpc_ros.lie.symbolic import (
    rotation_from_quaternion,
    trace_hessian,
    vee_of_skew_part,
)
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.phase import Field, Order, Phase, Read, phase
from manifold_mpc_ros.mpc.program.structure import RATE_PENALTY, Structure
from manifold_mpc_ros.mpc.scaling import Parameters, unpack
from manifold_mpc_ros.mpc.stages import step_derivatives as form
from manifold_mpc_ros.mpc.stages.barrier import (
    box_hessian,
    box_transpose,
    elastic_bounds,
    hard_bounds,
    largest,
)


def where(flag: ca.SX, value: ca.SX) -> ca.SX:
    """Return the value where the flag is not zero, else exactly 0 (whatever the value is)."""
    return ca.if_else(flag != 0, value, ca.SX.zeros(*value.shape))


def blend(exact: ca.SX, curved: ca.SX, gauss_newton: ca.SX) -> ca.SX:
    """Return the Hessian between Gauss-Newton (exact = 0) and the exact one (1)."""
    return gauss_newton + exact * (curved - gauss_newton)


def force_phase(structure: Structure) -> Phase:
    """Torque terms of a stage: gradients, barrier weights, largest complementarity product."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        p = unpack(read(f.PARAMETER))
        force = p.torque_hessian @ read(f.TORQUE)
        if not structure.torque_box:
            return {f.PULL: force, f.FORCE: force, f.FORCE_SIZE: largest(force)}
        s = read(f.TORQUE_DUAL)
        bounds = hard_bounds(read(f.TORQUE_SLACK), s, read(f.BARRIER))
        return {f.FORCE_SIZE: largest(force),
                f.PULL: force + box_transpose(bounds.pull, p.max_torque),
                f.FORCE: force + box_transpose(s, p.max_torque),
                f.TORQUE_WEIGHT: box_hessian(bounds.weight, p.max_torque),
                f.PRODUCTS: largest(bounds.slack * s)}

    return phase('force', expression)


class _RateTerms(NamedTuple):
    """Terms of a node's rate limits by its momentum, and the largest complementarity product."""

    pull: ca.SX
    force: ca.SX
    hessian: ca.SX
    products: ca.SX


def _rate_terms(structure: Structure, read: Read, p: Parameters) -> _RateTerms:
    """Return the terms of the rate limits of node k."""
    if not structure.rate_box:
        return _RateTerms(ca.SX.zeros(3), ca.SX.zeros(3), ca.SX.zeros(3, 3), ca.SX(0))
    s, t = read(f.RATE_DUAL), read(f.RATE_ELASTIC)
    bounds = elastic_bounds(read(f.RATE_SLACK), t, s, read(f.BARRIER), RATE_PENALTY)
    to_rate, weight = p.inertia_inverse, ca.diag(box_hessian(bounds.weight, p.max_rate))
    return _RateTerms(
        to_rate @ box_transpose(bounds.pull, p.max_rate),
        to_rate @ box_transpose(s, p.max_rate), form.congruence(to_rate, weight @ to_rate),
        where(read(f.LATER), largest(bounds.slack * s, (RATE_PENALTY - s) * t)))


def _turn_terms(g: ca.SX, read: Read, p: Parameters) -> dict[Field, ca.SX]:
    """Return gradient and Hessian of ``tr(Qg (I - g))`` by a spatial turn."""
    s, inner = g @ p.attitude_weight, read(f.INNER)
    hessian = blend(read(f.EXACT), form.left_hessian(s), trace_hessian(p.attitude_weight))
    return {f.TURN_GRADIENT: inner * vee_of_skew_part(s),
            f.TURN_HESSIAN: form.upper_part(inner * hessian)}


def paper_node_phase(structure: Structure) -> Phase:
    """All terms in (theta_k, alpha_k), paper's forcing: two torques depend on one step."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        p, inner = unpack(read(f.PARAMETER)), read(f.INNER)
        g = rotation_from_quaternion(read(f.ATTITUDE))
        turn = rotation_from_quaternion(read(f.FREE))
        rates = _rate_terms(structure, read, p)
        into, out = p.torque_hessian + rates.hessian, inner * p.torque_hessian
        if structure.torque_box:
            into = into + ca.diag(read(f.TORQUE_WEIGHT, -1))
            out = out + ca.diag(where(inner, read(f.TORQUE_WEIGHT)))
        after = form.momentum_derivative(turn, p.inertia)
        before = form.derivative_before(turn, after, read(f.MOMENTUM)) @ g.T
        after = after @ g.T
        force_into, force = read(f.FORCE, -1) + rates.force, where(inner, read(f.FORCE))
        lagrangian = turn @ (inner * p.rate_weight + form.multiplier_matrix(
            force_into, force, p.inertia))
        curved = blend(read(f.EXACT), form.left_hessian(lagrangian),
                       inner * trace_hessian(p.rate_weight))
        weighted = out @ before
        hessian = (form.congruence(after, into @ after) + form.congruence(before, weighted)
                   + form.congruence(g.T, curved @ g.T))
        move_force = g @ vee_of_skew_part(lagrangian)
        gradient = (move_force + after.T @ (read(f.PULL, -1) + rates.pull - force_into)
                    - before.T @ (where(inner, read(f.PULL)) - force))
        return {**_turn_terms(g, read, p),
                f.MOVE_GRADIENT: gradient, f.MOVE_HESSIAN: form.upper_part(hessian),
                f.MOVE_FORCE: move_force, f.AFTER: ca.vec(after), f.BEFORE: ca.vec(before),
                f.WEIGHTED: ca.vec(weighted), f.RATE_PRODUCTS: rates.products}

    return phase('node', expression, beyond=1)


def paper_transition_phase() -> Phase:
    """The Hessian between alpha_k and alpha_{k+1}, and the stationarity of alpha_k."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        weighted = ca.reshape(read(f.WEIGHTED), 3, 3)
        after = ca.reshape(read(f.AFTER, 1), 3, 3)
        residual = largest(read(f.MOVE_FORCE) + read(f.TURN_COSTATE))
        return {f.CROSS: ca.vec(-after.T @ weighted),
                f.STAGE_RESIDUAL: where(read(f.LATER), residual)}

    return phase('transition', expression)


def symmetric_node_phase(structure: Structure) -> Phase:
    """Terms in (theta_k, Pi_k), symmetric forcing: attitude, free step, rate limits."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        p, inner = unpack(read(f.PARAMETER)), read(f.INNER)
        g = rotation_from_quaternion(read(f.ATTITUDE))
        free = rotation_from_quaternion(read(f.FREE))
        rates = _rate_terms(structure, read, p)
        by_momentum = solve_3x3(form.momentum_derivative(free, p.inertia), ca.SX.eye(3))
        gradient = by_momentum.T @ vee_of_skew_part(free @ p.rate_weight)
        curved = form.left_hessian(free @ (
            p.rate_weight - form.multiplier_matrix(gradient, ca.SX.zeros(3), p.inertia)))
        hessian = form.congruence(by_momentum, blend(
            read(f.EXACT), curved, trace_hessian(p.rate_weight)) @ by_momentum)
        return {**_turn_terms(g, read, p),
                f.MOVE_GRADIENT: inner * gradient + rates.pull,
                f.MOVE_FORCE: inner * gradient + rates.force,
                f.MOVE_HESSIAN: form.upper_part(inner * hessian + rates.hessian),
                f.RATE_PRODUCTS: rates.products}

    return phase('node', expression, beyond=1)


def symmetric_transition_phase(structure: Structure) -> Phase:
    """Terms in (Pi_k, alpha_k), symmetric forcing: the step, its torque, its stationarity."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        p, exact = unpack(read(f.PARAMETER)), read(f.EXACT)
        g = rotation_from_quaternion(read(f.ATTITUDE))
        turn = rotation_from_quaternion(read(f.STEP))
        after = form.momentum_derivative(turn, p.inertia)
        before = form.derivative_before(turn, after, read(f.MOMENTUM) + read(f.TORQUE) / 2) @ g.T
        after = after @ g.T
        costate, force = read(f.MOMENTUM_COSTATE), read(f.FORCE)
        lagrangian = turn @ form.multiplier_matrix(2 * force + costate, -costate, p.inertia)
        weight = p.torque_hessian
        if structure.torque_box:
            weight = weight + ca.diag(read(f.TORQUE_WEIGHT))
        by_control = 2 * after
        weighted = weight @ by_control
        curved = form.congruence(g.T, exact * form.left_hessian(lagrangian) @ g.T)
        return {f.AFTER: ca.vec(after), f.PASSED: ca.vec(after + before),
                f.CROSS: ca.vec(-2 * weighted.T),
                f.CONTROL_GRADIENT: by_control.T @ read(f.PULL),
                f.CONTROL_HESSIAN: form.upper_part(
                    form.congruence(by_control, weighted) + curved),
                f.STAGE_RESIDUAL: largest(
                    g @ vee_of_skew_part(lagrangian) + read(f.TURN_COSTATE))}

    return phase('transition', expression)


def costate_phase(structure: Structure) -> Phase:
    """Sum attitude gradients (and momentum multipliers) from the end: the costates behind k."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        turn = read(f.TURN_SUM)
        writes = {f.TURN_COSTATE: turn, f.TURN_SUM: turn + read(f.TURN_GRADIENT)}
        if structure.symmetric:
            momentum = read(f.MOMENTUM_SUM)
            writes |= {f.MOMENTUM_COSTATE: momentum,
                       f.MOMENTUM_SUM: read(f.MOVE_FORCE) - 2 * read(f.FORCE) - momentum}
        return writes

    return phase('costate', expression, order=Order.BACKWARD)
