# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The last node: terminal cost ``xi^T P xi / 2`` and terminal set ``xi^T P xi <= c``.

``xi = (x, Log f)``, x the rotation vector of the error (for pointing the shortest that meets the
axis) and f the step of the last momentum: the chart of the terminal design.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from manifold_mpc_ros.dynamics.symbolic import solve_3x3
from manifold_mpc_ros.lie.symbolic import (
    direction_log,
    quaternion_log,
    quaternion_product,
    right_jacobian_inverse,
    rotation_from_quaternion,
)
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.phase import Field, Phase, Read, Structure, phase
from manifold_mpc_ros.mpc.scaling import Parameters, unpack
from manifold_mpc_ros.mpc.stages import step_derivatives as form
from manifold_mpc_ros.mpc.stages.barrier import elastic_bounds, largest
from manifold_mpc_ros.mpc.stages.inequalities import (
    of_attitude,
    terminal_level,
    wheel_inequalities,
)
from manifold_mpc_ros.mpc.stages.quadratic_model import turn_force
from manifold_mpc_ros.mpc.stages.reference import axes, errors
from manifold_mpc_ros.mpc.stages.wheel_limits import MIXED_HESSIAN


def error_vector(q: ca.SX, pointing: bool, p: Parameters) -> ca.SX:
    """Return the rotation vector of the error: ``Log g``, or the shortest that meets the axis."""
    if not pointing:
        return quaternion_log(q)
    gamma = rotation_from_quaternion(q).T @ p.pointing_axis
    return direction_log(gamma, p.pointing_axis, p.pointing_across)


def coordinates(q: ca.SX, free: ca.SX, pointing: bool, p: Parameters) -> ca.SX:
    """Return ``xi = (x, Log f)`` of a node."""
    return ca.vertcat(error_vector(q, pointing, p), quaternion_log(free))


def form_of(q: ca.SX, free: ca.SX, pointing: bool, p: Parameters) -> ca.SX:
    """Return ``xi^T P xi``."""
    xi = coordinates(q, free, pointing, p)
    return ca.dot(xi, p.terminal_weight @ xi)


def turned(q: ca.SX, turn: ca.SX) -> ca.SX:
    """Return ``exp(turn) q``, right to second order."""
    return quaternion_product(ca.vertcat(1 - ca.dot(turn, turn) / 8, turn / 2), q)


class _Chart(NamedTuple):
    """First derivative (6, 6) of xi and the Hessian (6, 6) of ``weight . xi``."""

    derivative: ca.SX
    curvature: ca.SX


def _second_derivative(value: ca.SX, at: ca.SX) -> ca.SX:
    """Return the Hessian of a scalar at ``at = 0``."""
    return ca.substitute(ca.hessian(value, at)[0], at, ca.SX.zeros(3))


def _error_derivative(q: ca.SX, pointing: bool, p: Parameters) -> ca.SX:
    """Return the derivative (3, 3) of the error vector by a spatial turn."""
    if not pointing:
        return right_jacobian_inverse(-quaternion_log(q))
    turn = ca.SX.sym('turn', 3)
    derivative = ca.jacobian(error_vector(turned(q, turn), True, p), turn)
    return ca.substitute(derivative, turn, ca.SX.zeros(3))


def _chart(structure: Structure, read: Read, weight: ca.SX, p: Parameters) -> _Chart:
    """Return the derivatives of xi by the node's variation (theta, second state)."""
    q, free = read(f.ATTITUDE), read(f.FREE)
    turn, left = ca.SX.sym('turn', 3), ca.SX.sym('left', 3)
    q_off, free_off = errors(structure, read, turned(q, turn), turned(free, left))
    by_turn = _second_derivative(
        ca.dot(weight[0:3], error_vector(q_off, structure.pointing, p)), turn)
    by_left = _second_derivative(ca.dot(weight[3:6], quaternion_log(free_off)), left)
    q_off, free_off = errors(structure, read, q, free)
    log_derivative = right_jacobian_inverse(-quaternion_log(free_off))
    error_derivative = _error_derivative(q_off, structure.pointing, p)
    if structure.moving:
        E, F = axes(structure, read)
        error_derivative, log_derivative = error_derivative @ E.T, log_derivative @ F.T
    if structure.symmetric:
        step = rotation_from_quaternion(free)
        to_left = solve_3x3(form.momentum_derivative(step, p.inertia), ca.SX.eye(3))
        multiplier = to_left.T @ (log_derivative.T @ weight[3:6])
        by_left -= form.left_hessian(
            step @ form.multiplier_matrix(multiplier, ca.SX.zeros(3), p.inertia))
    else:
        to_left = rotation_from_quaternion(q).T
    return _Chart(
        ca.diagcat(error_derivative, log_derivative @ to_left),
        ca.diagcat(by_turn, to_left.T @ by_left @ to_left))


def upper_entries(matrix: ca.SX) -> ca.SX:
    """Return the upper part of a symmetric (n, n), row by row."""
    n = matrix.shape[0]
    return ca.vertcat(*(matrix[i, j] for i in range(n) for j in range(i, n)))


def terminal_phase(structure: Structure) -> Phase:
    """Start the backward recursion: value, costates and residuals at k = N.

    With D (6, 6) the derivative of xi by (theta, sigma), q = D^T P xi, and H the Hessian of
    ``xi^T P xi / 2``, ``D^T P D + exact sum_i (P xi)_i xi_i''``, V_N has without a set gradient q
    and Hessian H; with it, multiplier s and ``a = 2/c q`` the slope of ``xi^T P xi / c``,

        gradient q + a pull,      Hessian (1 + 2 s / c) H + a W a^T      (`barrier.Bounds`),

    to which the limits of the last node add theirs.
    """
    def expression(read: Read) -> dict[Field, ca.SX]:
        p = unpack(read(f.PARAMETER))
        xi = coordinates(*errors(structure, read, read(f.ATTITUDE), read(f.FREE)),
                         structure.pointing, p)
        p_xi = p.terminal_weight @ xi
        chart = _chart(structure, read, p_xi, p)
        hessian = (chart.derivative.T @ p.terminal_weight @ chart.derivative
                   + read(f.EXACT) * chart.curvature)
        gradient = chart.derivative.T @ p_xi
        force, products = gradient, read(f.NODE_PRODUCTS)
        limit = terminal_level(structure)
        if limit is not None:
            y, t, s = read(limit.slack), read(limit.elastic), read(limit.multiplier)
            bounds = elastic_bounds(y, t, s, read(f.BARRIER), limit.penalty)
            slope = 2 / p.terminal_level * gradient
            hessian = ((1 + 2 * s / p.terminal_level) * hessian
                       + bounds.weight * slope @ slope.T)
            gradient = gradient + slope * bounds.pull
            force = force + slope * s
            products = largest(products, y * s, (limit.penalty - s) * t)
        move = form.symmetric_from(read(f.MOVE_HESSIAN))
        turn, by_turn, turn_sum = ca.SX.zeros(3, 3), ca.SX.zeros(3), force[0:3]
        if of_attitude(structure):
            turn, by_turn = form.symmetric_from(read(f.TURN_HESSIAN)), read(f.TURN_GRADIENT)
            turn_sum = turn_sum + read(turn_force(structure))
        hessian += ca.diagcat(turn, move)
        if wheel_inequalities(structure):
            mixed = ca.reshape(read(MIXED_HESSIAN), 3, 3)
            hessian += ca.blockcat([[ca.SX(3, 3), mixed], [mixed.T, ca.SX(3, 3)]])
        gradient += ca.vertcat(by_turn, read(f.MOVE_GRADIENT))
        last = force[3:6] + read(f.MOVE_FORCE)
        stationarity = ca.SX(0) if structure.symmetric else largest(last)
        writes = {f.VALUE: ca.vertcat(gradient, upper_entries(hessian)),
                  f.TURN_SUM: turn_sum,
                  f.RESIDUALS: ca.vertcat(stationarity, products, 0, 1, 0),
                  f.LINEAR: ca.SX.zeros(6), f.LARGEST_REACH: ca.SX.zeros(1)}
        if limit is not None:
            writes[f.FORM_GRADIENT] = chart.derivative.T @ p_xi
        return writes | ({f.MOMENTUM_SUM: last} if structure.symmetric else {})

    return phase('terminal', expression, beyond=1, last=1)
