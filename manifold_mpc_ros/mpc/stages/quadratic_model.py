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

import casadi as ca

from manifold_mpc_ros.dynamics.symbolic import solve_3x3
from manifold_mpc_ros.lie.symbolic import rotation_from_quaternion, vee_of_skew_part
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.phase import Field, Order, Phase, Read, Structure, phase
from manifold_mpc_ros.mpc.scaling import Parameters, unpack
from manifold_mpc_ros.mpc.stages import step_derivatives as form
from manifold_mpc_ros.mpc.stages.barrier import largest, where
from manifold_mpc_ros.mpc.stages.inequalities import (
    node_inequalities,
    of_attitude,
    torque_inequalities,
    wheel_inequalities,
)
from manifold_mpc_ros.mpc.stages.inequality import (
    Curvature,
    LimitTerms,
    LocalInequality,
    Node,
    Variation,
)
from manifold_mpc_ros.mpc.stages.reference import excess_torque, weights
from manifold_mpc_ros.mpc.stages.wheel_limits import (
    CONTROL_TURN,
    MIXED_HESSIAN,
    STEP_WEIGHT,
    by_turn,
    step_terms,
    with_wheels,
)


def blend(exact: ca.SX, curved: ca.SX, gauss_newton: ca.SX) -> ca.SX:
    """Return the Hessian between Gauss-Newton (exact = 0) and the exact one (1)."""
    return gauss_newton + exact * (curved - gauss_newton)


def force_phase(structure: Structure) -> Phase:
    """Torque terms of stage k: u (3,), its limits ``v(u) + y = 0`` with multipliers s, C = dv/du.

        force = H u + C^T s          gradient of the Lagrangian by u, H = tr(R) I - R
        pull  = H u + C^T (s + W o)  gradient of the barrier model (`barrier.Bounds`)
        C^T W C                      what the limits add to H

    u is taken beside the torque of a moving reference. ``PRODUCTS`` is the largest ``y s``,
    ``FORCE_SIZE`` the largest ``|H u|``, by which stationarity is scaled. Dimensionless.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        p = unpack(read(f.PARAMETER))
        force = form.periods(structure, read) * (
            p.torque_hessian @ excess_torque(structure, read, read(f.TORQUE)))
        writes = {f.PULL: force, f.FORCE: force, f.FORCE_SIZE: largest(force)}
        limits = torque_inequalities(structure)
        if limits:
            terms = [(each, each.bounds(read)) for each in limits]
            writes[f.TORQUE_WEIGHT] = sum(each.hessian(read, b.weight) for each, b in terms)
            writes[f.PRODUCTS] = largest(*(b.slack * b.multiplier for _, b in terms))
            for each, b in terms:
                writes[f.PULL] += each.gradient(read, b.pull)
                writes[f.FORCE] += each.gradient(read, b.multiplier)
        wheels = wheel_inequalities(structure)
        return writes | (step_terms(wheels, read) if wheels else {})

    return phase('force', expression)


def node_at(read: Read, p: Parameters, *, new: bool = False) -> Node:
    """Return what the limits of node k depend on; of the new trajectory where asked for."""
    get = read.new if new else read
    return Node(get(f.ATTITUDE), p.inertia_inverse @ get(f.MOMENTUM), get)


def _limit_terms(structure: Structure, read: Read, p: Parameters) -> LimitTerms:
    """Return the terms of the limits of node k, rates turned into momenta."""
    node, to_rate = node_at(read, p), p.inertia_inverse
    zero = Variation(ca.SX.zeros(3), ca.SX.zeros(3))
    pull, force = zero, zero
    products: list[ca.SX] = []
    hessian = Curvature(ca.SX.zeros(3, 3), ca.SX.zeros(3, 3))
    for each in node_inequalities(structure):
        bounds = each.bounds(read)
        s = bounds.multiplier
        products += each.products(read, bounds)
        if not isinstance(each, LocalInequality):
            continue
        pull = _sum(pull, each.gradient(read, node, bounds.pull))
        force = _sum(force, each.gradient(read, node, s))
        hessian = Curvature(*(a + b for a, b in zip(
            hessian, each.hessian(read, node, bounds.weight, s))))
    terms = LimitTerms(
        Variation(pull.turn, to_rate @ pull.rate), Variation(force.turn, to_rate @ force.rate),
        Curvature(hessian.turn, form.congruence(to_rate, hessian.rate @ to_rate)),
        where(read(f.LATER), largest(*products)) if products else ca.SX(0))
    wheels = wheel_inequalities(structure)
    return with_wheels(terms, wheels, read) if wheels else terms


def _sum(one: Variation, other: Variation) -> Variation:
    """Return the sum of two variations."""
    return Variation(one.turn + other.turn, one.rate + other.rate)


def _turn_terms(structure: Structure, g: ca.SX, limits: LimitTerms, read: Read, p: Parameters
                ) -> dict[Field, ca.SX]:
    """Return gradient and Hessian by a spatial turn: ``tr(Qg (I - g))``, and limits of it."""
    weight, inner = weights(structure, read, p), read(f.INNER)
    s = g @ weight.attitude
    hessian = blend(read(f.EXACT), form.left_hessian(s), weight.by_turn)
    gradient, hessian = inner * vee_of_skew_part(s), inner * hessian
    if not of_attitude(structure):
        return {f.TURN_GRADIENT: gradient, f.TURN_HESSIAN: form.upper_part(hessian)}
    return {f.TURN_GRADIENT: gradient + limits.pull.turn,
            f.TURN_FORCE: gradient + limits.force.turn,
            f.TURN_HESSIAN: form.upper_part(hessian + limits.hessian.turn)}


def turn_force(structure: Structure) -> Field:
    """Return the field of the Lagrangian's gradient by a spatial turn."""
    return f.TURN_FORCE if of_attitude(structure) else f.TURN_GRADIENT


def paper_node_phase(structure: Structure) -> Phase:
    """All terms in (theta_k, alpha_k), paper's forcing: two torques depend on one step.

    With D+, D- the derivatives of m+, m- (`step_derivatives`) and g = R_DB of the node,

        d u_{k-1} = A alpha_k,  A = D+ g^T,     d u_k = -B alpha_k,  B = D- g^T,
        Hessian  = A^T (H_{k-1} + rate limits) A + B^T H_k B + g C g^T,
        C = tr(S) I - sym(S),  S = f (Qf + J_d s+^x - s-^x J_d),

    s+, s- the forces of both torques; Gauss-Newton has ``C = tr(Qf) I - Qf``. H_k includes the
    torque's limits. ``MOVE_FORCE`` is the Lagrangian's gradient by alpha_k, ``g vee(S - S^T)``.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        p, inner = unpack(read(f.PARAMETER)), read(f.INNER)
        g = rotation_from_quaternion(read(f.ATTITUDE))
        turn = rotation_from_quaternion(read(f.FREE))
        limits = _limit_terms(structure, read, p)
        into, out = p.torque_hessian + limits.hessian.rate, inner * p.torque_hessian
        if torque_inequalities(structure):
            into = into + ca.diag(read(f.TORQUE_WEIGHT, -1))
            out = out + ca.diag(where(inner, read(f.TORQUE_WEIGHT)))
        after = form.momentum_derivative(turn, p.inertia)
        before = form.derivative_before(turn, after, read(f.MOMENTUM)) @ g.T
        after = after @ g.T
        force_into, force = read(f.FORCE, -1) + limits.force.rate, where(inner, read(f.FORCE))
        weight = weights(structure, read, p)
        lagrangian = turn @ (inner * weight.rate + form.multiplier_matrix(
            force_into, force, p.inertia))
        curved = blend(read(f.EXACT), form.left_hessian(lagrangian), inner * weight.by_step)
        weighted = out @ before
        hessian = (form.congruence(after, into @ after) + form.congruence(before, weighted)
                   + form.congruence(g.T, curved @ g.T))
        move_force = g @ vee_of_skew_part(lagrangian)
        gradient = (move_force + after.T @ (read(f.PULL, -1) + limits.pull.rate - force_into)
                    - before.T @ (where(inner, read(f.PULL)) - force))
        return {**_turn_terms(structure, g, limits, read, p),
                f.MOVE_GRADIENT: gradient, f.MOVE_HESSIAN: form.upper_part(hessian),
                f.MOVE_FORCE: move_force, f.AFTER: ca.vec(after), f.BEFORE: ca.vec(before),
                f.WEIGHTED: ca.vec(weighted), f.NODE_PRODUCTS: limits.products}

    return phase('node', expression, beyond=1)


def paper_transition_phase() -> Phase:
    """The Hessian between alpha_k and alpha_{k+1}, ``-A_{k+1}^T H_k B_k``, and stationarity.

    The residual of alpha_k is ``|g vee(S - S^T) + sum_{j > k} dL/dtheta_j|``, its largest entry;
    none at k = 0, whose step is measured.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        weighted = ca.reshape(read(f.WEIGHTED), 3, 3)
        after = ca.reshape(read(f.AFTER, 1), 3, 3)
        residual = largest(read(f.MOVE_FORCE) + read(f.TURN_COSTATE))
        return {f.CROSS: ca.vec(-after.T @ weighted),
                f.STAGE_RESIDUAL: where(read(f.LATER), residual)}

    return phase('transition', expression)


def symmetric_node_phase(structure: Structure) -> Phase:
    """Terms in (theta_k, Pi_k), symmetric forcing: attitude, free step, rate limits.

    The free step f of Pi turns by ``B dPi``, ``B = D+(f)^-1``, so that ``tr(Qf (I - f))`` has

        gradient b = B^T vee(S - S^T),  S = f Qf,       Hessian B^T C B,
        C = tr(S') I - sym(S'),  S' = f (Qf - J_d b^x),   Gauss-Newton: C = tr(Qf) I - Qf.

    Rate limits follow by ``omega = J^-1 Pi``. At k = N (``inner`` 0) only the limits are left.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        p, inner = unpack(read(f.PARAMETER)), read(f.INNER)
        g = rotation_from_quaternion(read(f.ATTITUDE))
        free = rotation_from_quaternion(read(f.FREE))
        limits = _limit_terms(structure, read, p)
        by_momentum = solve_3x3(form.momentum_derivative(free, p.inertia), ca.SX.eye(3))
        weight = weights(structure, read, p)
        gradient = by_momentum.T @ vee_of_skew_part(free @ weight.rate)
        curved = form.left_hessian(free @ (
            weight.rate - form.multiplier_matrix(gradient, ca.SX.zeros(3), p.inertia)))
        hessian = form.congruence(by_momentum, blend(
            read(f.EXACT), curved, weight.by_step) @ by_momentum)
        return {**_turn_terms(structure, g, limits, read, p),
                f.MOVE_GRADIENT: inner * gradient + limits.pull.rate,
                f.MOVE_FORCE: inner * gradient + limits.force.rate,
                f.MOVE_HESSIAN: form.upper_part(inner * hessian + limits.hessian.rate),
                f.NODE_PRODUCTS: limits.products,
                **({} if limits.mixed is None else {MIXED_HESSIAN: ca.vec(limits.mixed)})}

    return phase('node', expression, beyond=1)


def symmetric_transition_phase(structure: Structure) -> Phase:
    """Terms in (Pi_k, alpha_k), symmetric forcing: the step, its torque, its stationarity.

        d u_k = 2 (A alpha_k - dPi_k),          A = D+ g^T
        dPi_{k+1} = E alpha_k - dPi_k,          E = (D+ + D-) g^T
        Hessian by alpha: (2 A)^T H (2 A) + exact g (tr(S) I - sym(S)) g^T,
        between alpha and Pi: -2 (2 A)^T H,     S = f (J_d s+^x - s-^x J_d),

    with s+ = 2 force + mu, s- = -mu and mu the costate of Pi_{k+1}. H includes the limits of the
    torque. The residual of alpha_k is ``|g vee(S - S^T) + sum_{j > k} dL/dtheta_j|``.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        p, exact = unpack(read(f.PARAMETER)), read(f.EXACT)
        g = rotation_from_quaternion(read(f.ATTITUDE))
        turn = rotation_from_quaternion(read(f.STEP))
        after = form.momentum_derivative(turn, p.inertia)
        r = form.periods(structure, read)
        pushed = r * (read(f.MOMENTUM) + r * read(f.TORQUE) / 2)
        before = form.derivative_before(turn, after, pushed) @ g.T / r
        after = after @ g.T / r
        costate, force = read(f.MOMENTUM_COSTATE), read(f.FORCE)
        lagrangian = turn @ form.multiplier_matrix(
            (2 * force / r + costate) / r, -costate / r, p.inertia)
        weight = r * p.torque_hessian
        if torque_inequalities(structure):
            weight = weight + ca.diag(read(f.TORQUE_WEIGHT))
        by_control = 2 * after / r
        weighted = weight @ by_control
        curved = form.congruence(g.T, exact * form.left_hessian(lagrangian) @ g.T)
        passed, cross = after + before, -2 * weighted.T / r
        control = form.congruence(by_control, weighted) + curved
        writes = {f.AFTER: ca.vec(after), f.PASSED: ca.vec(passed),
                  f.CONTROL_GRADIENT: by_control.T @ read(f.PULL),
                  f.STAGE_RESIDUAL: largest(
                      g @ vee_of_skew_part(lagrangian) + read(f.TURN_COSTATE))}
        if wheel_inequalities(structure):
            motors, turned = form.symmetric_from(read(STEP_WEIGHT)), by_turn(read, 1)
            by_motors = (turned - passed).T @ motors
            control += by_motors @ (turned - passed)
            cross += 2 * by_motors
            writes[CONTROL_TURN] = ca.vec(by_motors @ (turned - by_turn(read)))
        return writes | {f.CROSS: ca.vec(cross), f.CONTROL_HESSIAN: form.upper_part(control)}

    return phase('transition', expression)


def costate_phase(structure: Structure) -> Phase:
    """Costates behind stage k, from the end: what a change of theta_{k+1}, Pi_{k+1} costs.

    Of ``theta_{k+1} = theta_k + alpha_k``, and with symmetric forcing of
    ``Pi_{k+1} = m+ + m- - Pi_k``, ``u_k = 2 (m+ - Pi_k)``,

        lambda_k = dL/dtheta_{k+1} + lambda_{k+1},
        mu_k     = dL/dPi_{k+1} - 2 force_{k+1} - mu_{k+1}.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        turn = read(f.TURN_SUM)
        writes = {f.TURN_COSTATE: turn, f.TURN_SUM: turn + read(turn_force(structure))}
        if structure.symmetric:
            momentum = read(f.MOMENTUM_SUM)
            writes |= {f.MOMENTUM_COSTATE: momentum,
                       f.MOMENTUM_SUM: read(f.MOVE_FORCE) - 2 * read(f.FORCE) / form.periods(
                           structure, read) - momentum}
        return writes

    return phase('costate', expression, order=Order.BACKWARD)
