# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Costs, their Gauss-Newton models and the constraints of one node, as CasADi expressions.

Everything here is dimensionless (see :mod:`manifold_mpc_ros.mpc.scaling`): the step is 1, the
inertia is of order one, rates are radians per step. A node is ``(q, omega, c)``: attitude
quaternion of ``R_DB`` (body to commanded frame), body rate, and the Cayley parameter of the
step ``f(omega)``, carried along so that the implicit equation is solved once per node.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from manifold_mpc_ros.dynamics.symbolic import StepDerivative, step_derivative
from manifold_mpc_ros.lie.symbolic import (
    cayley_quaternion,
    direction_log,
    quaternion_log,
    quaternion_product,
    right_jacobian_inverse,
    rotation_from_quaternion,
    trace_hessian,
    vee_of_skew_part,
)
from manifold_mpc_ros.mpc.scaling import Parameters

NODE = 10      # q (4), omega (3), c (3)
TANGENT = 6    # (d theta_B, d omega_B)
TORQUE = 3


class Quadratic(NamedTuple):
    """Value, gradient and Gauss-Newton Hessian of a cost in tangent coordinates."""

    value: ca.SX
    gradient: ca.SX
    hessian: ca.SX


def split_node(node: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return (q, omega, c) of a node."""
    return node[0:4], node[4:7], node[7:10]


def free_step_derivative(node: ca.SX, p: Parameters) -> StepDerivative:
    """Return the derivatives of the step ``f(omega)`` by the node's momentum ``J omega``."""
    _, omega, c = split_node(node)
    return step_derivative(c, p.inertia @ omega, p.inertia)


def state_cost(node: ca.SX, free: StepDerivative, p: Parameters) -> Quadratic:
    """Return ``tr(Qg (I - g)) + tr(Qf (I - f))`` with Hessians ``tr(S) I - S``, S = g^T Qg g."""
    g = rotation_from_quaternion(node[0:4])
    f, d = free.rotation, free.angle @ p.inertia
    gradient = ca.vertcat(vee_of_skew_part(p.attitude_weight @ g),
                          d.T @ vee_of_skew_part(p.rate_weight @ f))
    hessian = ca.diagcat(trace_hessian(g.T @ p.attitude_weight @ g),
                         d.T @ trace_hessian(f.T @ p.rate_weight @ f) @ d)
    return Quadratic(state_cost_value(node, p), gradient, hessian)


def state_cost_value(node: ca.SX, p: Parameters) -> ca.SX:
    """Return ``tr(Qg (I - g)) + tr(Qf (I - f))`` without cancellation near the identity.

    For a unit quaternion (w, v) and symmetric Q, ``tr(Q (I - R)) = 2 v^T (tr(Q) I - Q) v``.
    """
    q, _, c = split_node(node)
    v = q[1:4]
    by_attitude = ca.dot(v, trace_hessian(p.attitude_weight) @ v)
    by_rate = ca.dot(c, trace_hessian(p.rate_weight) @ c) / (1 + ca.dot(c, c))
    return 2 * (by_attitude + by_rate)


def torque_cost(u: ca.SX, p: Parameters) -> ca.SX:
    """Return ``tr(hat(u)^T R hat(u)) / 2 = u^T (tr(R) I - R) u / 2``."""
    return ca.dot(u, p.torque_hessian @ u) / 2


def error_vector(q: ca.SX, pointing: bool, p: Parameters) -> ca.SX:
    """Return the rotation vector of the error: ``Log g``, or the shortest that meets the axis."""
    if not pointing:
        return quaternion_log(q)
    gamma = rotation_from_quaternion(q).T @ p.pointing_axis
    return direction_log(gamma, p.pointing_axis, p.pointing_across)


def turned_error(q: ca.SX, turn: ca.SX, pointing: bool, p: Parameters) -> ca.SX:
    """Return the error vector after a small turn (3,) in body axes, right to second order."""
    small = ca.vertcat(1 - ca.dot(turn, turn) / 8, turn / 2)
    return error_vector(quaternion_product(q, small), pointing, p)


def error_derivative(q: ca.SX, pointing: bool, p: Parameters) -> ca.SX:
    """Return the derivative (3, 3) of the error vector by a turn in body axes."""
    if not pointing:
        return right_jacobian_inverse(quaternion_log(q))
    turn = ca.SX.sym('turn', 3)
    derivative = ca.jacobian(turned_error(q, turn, pointing, p), turn)
    return ca.substitute(derivative, turn, ca.SX.zeros(3))


def terminal_coordinates(node: ca.SX, pointing: bool, p: Parameters) -> ca.SX:
    """Return ``xi = (x, Log f)`` of a node, x its error vector: the terminal design's chart."""
    q, _, c = split_node(node)
    return ca.vertcat(error_vector(q, pointing, p), quaternion_log(cayley_quaternion(c)))


def terminal_form(node: ca.SX, free: StepDerivative, pointing: bool, p: Parameters
                  ) -> Quadratic:
    """Return ``xi^T P xi / 2`` with its Gauss-Newton Hessian; the set is value <= c / 2."""
    xi = terminal_coordinates(node, pointing, p)
    chart = ca.diagcat(error_derivative(node[0:4], pointing, p),
                       right_jacobian_inverse(xi[3:6]) @ free.angle @ p.inertia)
    p_xi = p.terminal_weight @ xi
    return Quadratic(ca.dot(xi, p_xi) / 2, chart.T @ p_xi, chart.T @ p.terminal_weight @ chart)


def tangent_difference(new: ca.SX, old: ca.SX) -> ca.SX:
    """Return the tangent coordinates (6,) of node ``new`` seen from node ``old``."""
    v, w = old[1:4], old[0]
    relative_w = w * new[0] + ca.dot(v, new[1:4])
    relative_v = w * new[1:4] - new[0] * v - ca.cross(v, new[1:4])
    turn = 2 * ca.if_else(relative_w >= 0, relative_v, -relative_v)
    return ca.vertcat(turn, new[4:7] - old[4:7])


class Bounds(NamedTuple):
    """Interior-point terms of inequalities ``value <= t`` with slack, elastic and multiplier.

    ``weight`` is W of ``ds = W (C dx + offset)``; the elastic t >= 0 costs ``penalty`` each, so
    a state inequality can always be met (exact penalty). ``t`` is 0 for hard inequalities.
    """

    slack: ca.SX
    multiplier: ca.SX
    weight: ca.SX
    offset: ca.SX

    @property
    def pull(self) -> ca.SX:
        """Return the multiplier estimate that enters the gradient of the barrier model."""
        return self.multiplier + self.weight * self.offset


def hard_bounds(y: ca.SX, s: ca.SX, mu: ca.SX) -> Bounds:
    """Return the terms of ``value + y = 0`` kept strictly: slack y > 0, s y -> mu."""
    return Bounds(y, s, s / y, mu / s - y)


def elastic_bounds(y: ca.SX, t: ca.SX, s: ca.SX, mu: ca.SX, penalty: float) -> Bounds:
    """Return the terms of ``value + y = t``, t >= 0 at cost penalty * t: (penalty - s) t -> mu."""
    gap = penalty - s
    weight = s * gap / (y * gap + t * s)
    return Bounds(y, s, weight, mu / s - y + t - mu / gap)


def box(value: ca.SX, limit: ca.SX) -> ca.SX:
    """Return the six values of ``|value_i| / limit_i - 1 <= 0``, upper ones first."""
    ratio = value / limit
    return ca.vertcat(ratio - 1, -ratio - 1)


def box_transpose(pull: ca.SX, limit: ca.SX) -> ca.SX:
    """Return ``C^T pull`` for :func:`box`."""
    return (pull[0:3] - pull[3:6]) / limit


def box_hessian(weight: ca.SX, limit: ca.SX) -> ca.SX:
    """Return ``C^T diag(weight) C`` for :func:`box`."""
    return ca.diag((weight[0:3] + weight[3:6]) / (limit * limit))
