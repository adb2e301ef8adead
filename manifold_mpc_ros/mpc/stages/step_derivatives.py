# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The discrete mechanics of one step f, explicit in f: momenta, derivatives and Hessians.

With the nonstandard inertia J_d the momenta at both ends of a step are linear in f,

    m+ = vee(f J_d - J_d f^T),    m- = vee(J_d f - f^T J_d) = f^T m+,

so for multipliers s+, s- the Lagrangian ``tr(Q (I - f)) + s+ . m+ - s- . m-`` is ``-tr(Z f)`` plus
a constant, with ``Z = Q + J_d s+^x - s-^x J_d``, and its second derivatives come from one matrix
product. Variations are from the left, ``f -> exp(beta) f``, beta in the body axes before the step.

Graded horizons: step k lasts r_k control periods, r_0 = 1 (docs/theory.md, section 17). With a
period as the unit of time and symmetric forcing

    m+ = r (Pi_k + r u_k / 2),    u_k = 2 (m+ / r - Pi_k) / r,    Pi_{k+1} = (m+ + m-) / r - Pi_k,

and the stage cost counts r times. The free step of a node, of cost and terminal set, stays that of
one period. r_k is the field ``INNER`` of stage k; 1 at the last node, which has no step.
"""

from __future__ import annotations

import casadi as ca

from manifold_mpc_ros.lie.symbolic import hat, rotation_from_quaternion, trace_hessian
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.phase import Field, Read, Structure


def symmetric_from(entries: ca.SX) -> ca.SX:
    """Map (xx, xy, xz, yy, yz, zz) to the symmetric matrix."""
    a = entries
    return ca.vertcat(ca.horzcat(a[0], a[1], a[2]), ca.horzcat(a[1], a[3], a[4]),
                      ca.horzcat(a[2], a[4], a[5]))


def upper_part(matrix: ca.SX) -> ca.SX:
    """Map a symmetric matrix to (xx, xy, xz, yy, yz, zz)."""
    m = matrix
    return ca.vertcat(m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2], m[2, 2])


def symmetric_part(matrix: ca.SX) -> ca.SX:
    """Return ``(Z + Z^T) / 2``."""
    return (matrix + matrix.T) / 2


def nonstandard(inertia: ca.SX) -> ca.SX:
    """Return ``J_d = tr(J)/2 I - J``."""
    return ca.trace(inertia) / 2 * ca.SX.eye(3) - inertia


def momenta(f: ca.SX, inertia: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Map the unit quaternion of a step to (m+, m-), ``2 (w J v +- v x J v)``, no cancellation."""
    turned = inertia @ f[1:4]
    along, across = 2 * f[0] * turned, 2 * ca.cross(f[1:4], turned)
    return along + across, along - across


def momentum_derivative(f: ca.SX, inertia: ca.SX) -> ca.SX:
    """Map a step (3, 3) to D+ with ``d m+ = D+ beta``, ``D+ = tr(f J_d) I - f J_d``."""
    a = f @ nonstandard(inertia)
    return ca.trace(a) * ca.SX.eye(3) - a


def principal(step: ca.SX, inertia: ca.SX) -> ca.SX:
    """Map the unit quaternion of a step to det D+, positive on the branch of the identity."""
    d = momentum_derivative(rotation_from_quaternion(step), inertia)
    return ca.dot(d[:, 0], ca.cross(d[:, 1], d[:, 2]))


def derivative_before(f: ca.SX, d_after: ca.SX, after: ca.SX) -> ca.SX:
    """Map a step (3, 3), its D+ and m+ to D- with ``d m- = D- beta``, ``D- = f^T (D+ + m+^x)``."""
    return f.T @ (d_after + hat(after))


def multiplier_matrix(after: ca.SX, before: ca.SX, inertia: ca.SX) -> ca.SX:
    """Return Z of ``after . m+ - before . m- = -tr(Z f)``."""
    j_d = nonstandard(inertia)
    return j_d @ hat(after) - hat(before) @ j_d


def congruence(a: ca.SX, weighted: ca.SX) -> ca.SX:
    """Return ``a^T w`` (3, 3), known to be symmetric, from its upper part."""
    return symmetric_from(ca.vertcat(*(
        ca.dot(a[:, i], weighted[:, j]) for i in range(3) for j in range(i, 3))))


def left_hessian(s: ca.SX) -> ca.SX:
    """Map ``S = f Z`` to the Hessian of ``-tr(Z exp(beta) f)`` at 0, ``tr(S) I - sym(S)``."""
    return trace_hessian(symmetric_part(s))


def periods(structure: Structure, read: Read) -> ca.SX | float:
    """Return r of stage k, the number 1 where all steps are one period."""
    return _periods(read) if structure.graded else 1.0


def _periods(read: Read, shift: int = 0) -> ca.SX:
    return ca.fmax(read(f.INNER, shift), 1)


def one_period_on(graded: bool, read: Read, field: Field) -> ca.SX:
    """Return a field of stage k as an old plan has it one period later.

    Step k, moved on by a period, covers r - 1 periods of the old step k and one of the next:
    ``((r - 1) x_k + x_{k+1}) / r``. Convex, so torques stay within their limits.
    """
    if not graded:
        return read(field, 1)
    r = _periods(read)
    return ((r - 1) * read(field) + read(field, 1)) / r


def step_one_period_on(graded: bool, read: Read, field: Field) -> ca.SX:
    """Return about the quaternion of step k one period later: the next one, of this length."""
    q = read(field, 1)
    if not graded:
        return q
    return ca.vertcat(q[0], q[1:4] * _periods(read) / _periods(read, 1))
