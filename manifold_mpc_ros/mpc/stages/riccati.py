# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The Riccati recursion: the only part of a pass whose stages must wait for each other.

``V_k(theta, sigma) = min_v`` of the stage's model plus V_{k+1} behind the linear dynamics

- paper's forcing: ``theta' = theta + sigma``, ``sigma' = v``;
- symmetric: ``theta' = theta + v``, ``sigma' = E v - sigma``.

Both leave theta's block alone, which is what makes a stage cost few operations.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from manifold_mpc_ros.lie.symbolic import hat
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.phase import Field, Order, Phase, Read, Structure, phase
from manifold_mpc_ros.mpc.scaling import unpack
from manifold_mpc_ros.mpc.stages import step_derivatives as form
from manifold_mpc_ros.mpc.stages.barrier import largest, most
from manifold_mpc_ros.mpc.stages.inequalities import (
    node_inequalities,
    torque_inequalities,
    wheel_inequalities,
)
from manifold_mpc_ros.mpc.stages.wheel_limits import CONTROL_TURN, MIXED_HESSIAN, MotorTorque


class _Value(NamedTuple):
    """Gradient and Hessian blocks of V in (theta, sigma)."""

    by_turn: ca.SX
    by_move: ca.SX
    turn: ca.SX
    mixed: ca.SX
    move: ca.SX


class _Model(NamedTuple):
    """A stage with V behind it: blocks of its quadratic in (v, theta, sigma)."""

    control: ca.SX
    by_control: ca.SX
    control_turn: ca.SX
    control_move: ca.SX
    rest: _Value


def _value(packed: ca.SX) -> _Value:
    """Unpack gradient (6) and upper part of the Hessian (21)."""
    full = ca.SX(6, 6)
    entries = iter(range(6, 27))
    for i in range(6):
        for j in range(i, 6):
            full[i, j] = full[j, i] = packed[next(entries)]
    return _Value(packed[0:3], packed[3:6], full[0:3, 0:3], full[0:3, 3:6], full[3:6, 3:6])


def _paper_model(v: _Value, read: Read) -> _Model:
    """Return the model with theta' = theta + sigma, sigma' = v."""
    coupling = -read(f.EXACT) * hat(read(f.TURN_COSTATE)) / 2
    cross = ca.reshape(read(f.CROSS), 3, 3)
    rest = _Value(
        v.by_turn + read(f.TURN_GRADIENT), v.by_turn + read(f.MOVE_GRADIENT),
        v.turn + form.symmetric_from(read(f.TURN_HESSIAN)), v.turn + coupling,
        v.turn + form.symmetric_from(read(f.MOVE_HESSIAN)))
    return _Model(v.move, v.by_move, v.mixed.T, v.mixed.T + cross, rest)


def _symmetric_model(v: _Value, structure: Structure, read: Read) -> _Model:
    """Return the model with theta' = theta + v, sigma' = E v - sigma."""
    r, weight = form.periods(structure, read), _torque_weight(structure, read)
    passed = ca.reshape(read(f.PASSED), 3, 3)
    cross = ca.reshape(read(f.CROSS), 3, 3)
    coupling = -read(f.EXACT) * hat(read(f.TURN_COSTATE)) / 2
    moved = v.mixed @ passed                    # theta' by sigma' through v
    carried = v.move @ passed
    control = v.turn + moved + moved.T + passed.T @ carried + form.symmetric_from(
        read(f.CONTROL_HESSIAN))
    by_control = v.by_turn + passed.T @ v.by_move + read(f.CONTROL_GRADIENT)
    rest = _Value(
        v.by_turn + read(f.TURN_GRADIENT),
        read(f.MOVE_GRADIENT) - v.by_move - 2 * read(f.PULL) / r,
        v.turn + form.symmetric_from(read(f.TURN_HESSIAN)), -v.mixed,
        v.move + form.symmetric_from(read(f.MOVE_HESSIAN)) + 4 * weight / (r * r))
    control_turn, control_move = (v.turn + moved + coupling).T, cross - v.mixed - carried.T
    if wheel_inequalities(structure):
        control_turn += ca.reshape(read(CONTROL_TURN), 3, 3)
        rest = rest._replace(mixed=rest.mixed + ca.reshape(read(MIXED_HESSIAN), 3, 3))
    return _Model(control, by_control, control_turn, control_move, rest)


class _Factor(NamedTuple):
    """``L^-1`` applied to the right-hand sides, the unit lower triangle, 1/d and the pivot."""

    reduced: ca.SX
    l10: ca.SX
    l20: ca.SX
    l21: ca.SX
    inverse: ca.SX
    pivot: ca.SX


def _factorise(a: ca.SX, b: ca.SX) -> _Factor:
    """Factorise a symmetric a (3, 3) as L D L^T and reduce b (3, n)."""
    d0 = a[0, 0]
    i0 = 1 / d0
    l10, l20 = a[1, 0] * i0, a[2, 0] * i0
    d1 = a[1, 1] - l10 * a[1, 0]
    i1 = 1 / d1
    e = a[2, 1] - l20 * a[1, 0]
    l21 = e * i1
    d2 = a[2, 2] - l20 * a[2, 0] - l21 * e
    y0 = b[0, :]
    y1 = b[1, :] - l10 * y0
    y2 = b[2, :] - l20 * y0 - l21 * y1
    pivot = ca.fmin(d0, ca.fmin(d1, d2)) / (ca.fabs(d0) + ca.fabs(d1) + ca.fabs(d2))
    return _Factor(ca.vertcat(y0, y1, y2), l10, l20, l21, ca.vertcat(i0, i1, 1 / d2), pivot)


def _substitute(factor: _Factor) -> ca.SX:
    """Return ``a^-1 b``."""
    z = ca.diag(factor.inverse) @ factor.reduced
    x2 = z[2, :]
    x1 = z[1, :] - factor.l21 * x2
    return ca.vertcat(z[0, :] - factor.l10 * x1 - factor.l20 * x2, x1, x2)


def _less(rest: ca.SX, left: ca.SX, right: ca.SX) -> ca.SX:
    """Return ``rest - left^T right``."""
    return rest - left.T @ right


def riccati_phase(structure: Structure) -> Phase:
    """Map V_{k+1} to the gains of stage k and to V_k; gather the residuals.

    With the stage's model ``[v; x]^T [H, M; M^T, R] [v; x] / 2 + b . v + r . x``, V_{k+1} added
    behind the dynamics and x = (theta, sigma) (6,), both spatial and dimensionless,

        v = -H^-1 (b + M x),    V_k = x^T (R - M^T H^-1 M) x / 2 + (r - M^T H^-1 b) . x

    H (3, 3) is factorised as L D L^T; a pivot of D that is not positive is reported relative to
    their sum (the pass then blends towards Gauss-Newton), nothing is raised. Exactness:
    test/mpc/test_kernel_model.py compares the model with differences of the merit.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        v = _value(read(f.VALUE))
        m = _symmetric_model(v, structure, read) if structure.symmetric else _paper_model(v, read)
        factor = _factorise(m.control, ca.horzcat(m.by_control, m.control_turn, m.control_move))
        gains = -_substitute(factor)
        y, scaled = factor.reduced, ca.diag(factor.inverse) @ factor.reduced
        r = m.rest
        full = ca.horzcat(ca.vertcat(r.turn, r.mixed.T), ca.vertcat(r.mixed, r.move))
        hessian = [full[i, j] - ca.dot(y[:, 1 + i], scaled[:, 1 + j])
                   for i in range(6) for j in range(i, 6)]
        gradient = _less(ca.vertcat(r.by_turn, r.by_move), y[:, 1:], scaled[:, 0])
        residuals = read(f.RESIDUALS)
        products = [read(f.PRODUCTS)] if torque_inequalities(structure) else []
        products += [read(f.NODE_PRODUCTS)] if node_inequalities(structure) else []
        return {f.GAIN: ca.vec(gains),
                f.VALUE: ca.vertcat(gradient, *hessian),
                f.RESIDUALS: ca.vertcat(
                    ca.fmax(residuals[0], read(f.STAGE_RESIDUAL)),
                    ca.fmax(residuals[1], largest(*products)) if products else residuals[1],
                    residuals[2] + ca.dot(y[:, 0], scaled[:, 0]),
                    ca.fmin(residuals[3], factor.pivot),
                    ca.fmax(residuals[4], read(f.FORCE_SIZE)))}

    return phase('riccati', expression, order=Order.BACKWARD)


def _torque_weight(structure: Structure, read: Read) -> ca.SX:
    """Return the Hessian (3, 3) of a stage's torque, barrier included."""
    weight = form.periods(structure, read) * unpack(read(f.PARAMETER)).torque_hessian
    limited = torque_inequalities(structure)
    return weight + ca.diag(read(f.TORQUE_WEIGHT)) if limited else weight


def linear_phase(structure: Structure) -> Phase:
    """Roll the gains out through the linear dynamics, from (theta, sigma)_0 = 0 on.

    ``v = k + K (theta, sigma)`` (3,) of `riccati_phase`, then the dynamics at the head of this
    module. ``CONTROL``, ``TURN``, ``MOVE`` are v, theta and sigma of stage k.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        turn, move = read(f.LINEAR)[0:3], read(f.LINEAR)[3:6]
        gain = ca.reshape(read(f.GAIN), 3, 7)
        v = gain[:, 0] + gain[:, 1:4] @ turn + gain[:, 4:7] @ move
        if structure.symmetric:
            after = ca.vertcat(turn + v, ca.reshape(read(f.PASSED), 3, 3) @ v - move)
        else:
            after = ca.vertcat(turn + move, v)
        return {f.CONTROL: v, f.TURN: turn, f.MOVE: move, f.LINEAR: after}

    return phase('linear', expression, order=Order.FORWARD, beyond=1)


def reach_phase(structure: Structure) -> Phase:
    """Map the linear roll-out to torque changes du (3,), and how far they go towards a limit.

    ``du = 2 (A v - sigma)`` symmetric, ``A_{k+1} v - B_k sigma`` with the paper's forcing.
    ``REACH`` is the largest ``(dv/du du)_i / y_i``: a full step uses this part of the slack.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        if structure.symmetric:
            after = ca.reshape(read(f.AFTER), 3, 3)
            r = form.periods(structure, read)
            change = 2 * (after @ read(f.CONTROL) - read(f.MOVE)) / r
        else:
            after, before = ca.reshape(read(f.AFTER, 1), 3, 3), ca.reshape(read(f.BEFORE), 3, 3)
            change = after @ read(f.CONTROL) - before @ read(f.MOVE)
        parts = [each.slope(read, change) / read(each.slack)
                 for each in torque_inequalities(structure)]
        parts += [each.reach(read) for each in wheel_inequalities(structure)
                  if isinstance(each, MotorTorque)]
        reach = {f.REACH: most(ca.vertcat(*parts))} if parts else {}
        return {f.TORQUE_CHANGE: change, **reach}

    return phase('reach', expression)


def largest_reach_phase() -> Phase:
    """Gather the largest part of the way to a torque limit over the stages."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        return {f.LARGEST_REACH: ca.fmax(read(f.LARGEST_REACH), read(f.REACH))}

    return phase('largest_reach', expression, order=Order.FORWARD)
