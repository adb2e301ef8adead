# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CasADi forms of the SO(3) formulas, for prediction inside the optimiser.

Attitudes are unit quaternions ``(w, x, y, z)`` of ``R_NB``; ``q`` and ``-q`` give the same
value, except that at exactly w = 0 the sign of the vector part is the side of the logarithm.
Divisions are made harmless before a branch is selected, so that neither value nor derivative
is ``0/0`` (``if_else`` evaluates both sides).
"""

from __future__ import annotations

import casadi as ca

from manifold_mpc_ros.lie.so3 import AXIS_SIGN_SCALE, HALF_TURN_W

# Below this squared half-angle sine the series is exact to double precision.
_SMALL = 1e-8
# A direction whose sine to the antipode of the axis is below this (squared) is at the antipode.
_ANTIPODE = (8 * 2.0 ** -52) ** 2


def hat(v: ca.SX) -> ca.SX:
    """Map v (3,) to the skew matrix with ``hat(v) @ w = v x w``."""
    return ca.skew(v)


def vee_of_skew_part(z: ca.SX) -> ca.SX:
    """Map Z (3, 3) to ``vee(Z - Z^T)``, the gradient of ``-tr(Z exp(hat d))`` at ``d = 0``."""
    return ca.vertcat(z[2, 1] - z[1, 2], z[0, 2] - z[2, 0], z[1, 0] - z[0, 1])


def trace_hessian(s: ca.SX) -> ca.SX:
    """Map a symmetric S (3, 3) to ``tr(S) I - S``."""
    return ca.trace(s) * ca.SX.eye(3) - s


def quaternion_product(p: ca.SX, q: ca.SX) -> ca.SX:
    """Return the Hamilton product ``p q`` of quaternions (w, x, y, z)."""
    pw, pv, qw, qv = p[0], p[1:4], q[0], q[1:4]
    return ca.vertcat(pw * qw - ca.dot(pv, qv), pw * qv + qw * pv + ca.cross(pv, qv))


def rotation_from_quaternion(q: ca.SX) -> ca.SX:
    """Map a unit quaternion (w, x, y, z) to its rotation matrix (3, 3)."""
    v = hat(q[1:4])
    return ca.SX.eye(3) + 2 * q[0] * v + 2 * v @ v


def quaternion_from_rotation(R: ca.SX) -> ca.SX:
    """Map R (3, 3) to its unit quaternion with w >= 0, as `so3.quaternion_from_rotation` does."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    vector = ca.vertcat(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
    block = R + R.T + (1 - trace) * ca.SX.eye(3)
    outer = ca.vertcat(ca.horzcat(1 + trace, vector.T), ca.horzcat(vector, block))
    q, most = outer[:, 0], outer[0, 0]
    for i in range(1, 4):
        q = ca.if_else(outer[i, i] > most, outer[:, i], q)
        most = ca.fmax(outer[i, i], most)
    q = q / ca.sqrt(ca.dot(q, q))
    half_turn = ca.fabs(q[0]) <= HALF_TURN_W
    decides = ca.if_else(half_turn, _first_deciding(q[1:4]), q[0])
    q = ca.if_else(decides < 0, -q, q)
    return ca.vertcat(ca.if_else(half_turn, 0, q[0]), q[1:4])


def _first_deciding(v: ca.SX) -> ca.SX:
    """Return the first component of v (3,) that is not negligible beside the largest."""
    size = ca.fabs(v)
    least = AXIS_SIGN_SCALE * ca.fmax(size[0], ca.fmax(size[1], size[2]))
    return ca.if_else(size[0] > least, v[0], ca.if_else(size[1] > least, v[1], v[2]))


def cayley_quaternion(c: ca.SX) -> ca.SX:
    """Map a Cayley parameter c (3,) to the unit quaternion of ``cay(c)``."""
    return ca.vertcat(1, c) / ca.sqrt(1 + ca.dot(c, c))


def quaternion_log(q: ca.SX) -> ca.SX:
    """Map a unit quaternion to its rotation vector, ``2 atan2(|v|, |w|) v/|v|``, length <= pi.

    At exactly 180 degrees (w = 0) the vector part decides the side, so the length stays pi.
    """
    w = ca.fabs(q[0])
    v = ca.if_else(q[0] >= 0, q[1:4], -q[1:4])
    squared = ca.dot(v, v)
    small = squared < _SMALL
    sine = ca.sqrt(ca.if_else(small, 1, squared))
    ratio = squared / ca.if_else(small, w * w, 1)
    series = 2 / ca.if_else(small, w, 1) * (1 - ratio / 3 + ratio * ratio / 5)
    return ca.if_else(small, series, 2 * ca.atan2(sine, w) / sine) * v


def direction_log(gamma: ca.SX, axis: ca.SX, across: ca.SX) -> ca.SX:
    """Map unit vectors to the shortest rotation vector x with ``gamma = exp(-hat(x)) axis``.

    ``x = angle (gamma x axis) / |gamma x axis|``: the roll-free rotation of a body whose axis
    should meet the direction gamma. At the antipode, where every axis across will do, x is
    ``pi across`` (``across`` a unit vector normal to the axis). Beside it rounding turns the
    cross product into the axis, which is taken out again: x has no roll and its full length.
    """
    crossed, cosine = ca.cross(gamma, axis), ca.dot(gamma, axis)
    normal = crossed - ca.dot(crossed, axis) * axis
    squared = ca.dot(normal, normal)
    near = ca.logic_and(squared < _SMALL, cosine > 0)
    antipode = ca.logic_and(squared <= _ANTIPODE, cosine < 0)
    sine = ca.sqrt(ca.if_else(ca.logic_or(near, antipode), 1, squared))
    series = 1 + squared * (1 / 6 + squared * (3 / 40))
    ratio = ca.if_else(near, series, ca.atan2(sine, cosine) / sine)
    return ca.if_else(antipode, ca.pi * across, ratio * normal)


def right_jacobian_inverse(phi: ca.SX) -> ca.SX:
    """Map a rotation vector (3,), |phi| <= pi, to ``d Log(exp(phi) exp(d)) / d d`` at 0.

    ``I + hat(phi)/2 + (1/a^2 - cot(a/2)/(2a)) hat(phi)^2`` with ``a = |phi|``.
    """
    squared = ca.dot(phi, phi)
    small = squared < 1e-4
    angle = ca.sqrt(ca.if_else(small, 1, squared))
    closed = (1 - angle / 2 * ca.cos(angle / 2) / ca.sin(angle / 2)) / (angle * angle)
    series = 1 / 12 + squared * (1 / 720 + squared * (1 / 30240 + squared / 1209600))
    v = hat(phi)
    return ca.SX.eye(3) + v / 2 + ca.if_else(small, series, closed) * (v @ v)
