# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Costs about a reference that moves over the horizon.

Attitudes of a plan stay those of R_D0B, D0 the reference at k = 0, so that dynamics and
increments are as for a fixed target. With E_k = R_D0Dk and F_k the free step of the reference's
momentum, the cost of a node is that of the errors ``E_k^T g_k`` and ``F_k^T f_k``,

    tr(Qg (I - E^T g)) + tr(Qf (I - F^T f)),

which is the fixed one with the weights ``Qg E^T`` and ``Qf F^T`` in the place of Qg and Qf.
Torques are weighed about the reference's own.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from manifold_mpc_ros.lie.symbolic import (
    quaternion_product,
    rotation_from_quaternion,
    trace_hessian,
)
from manifold_mpc_ros.mpc.program.phase import Field, Memory, Read, Structure
from manifold_mpc_ros.mpc.scaling import Parameters

#: Quaternions of E_k and F_k, dimensionless rate of the reference in its own axes, and torque.
REFERENCE = Field('reference', 14, Memory.MODEL)
_ATTITUDE, _FREE, _RATE, _TORQUE = slice(0, 4), slice(4, 8), slice(8, 11), slice(11, 14)


class Weights(NamedTuple):
    """``Qg E^T`` and ``Qf F^T``, and the Gauss-Newton Hessians by turn and by free step."""

    attitude: ca.SX
    rate: ca.SX
    by_turn: ca.SX
    by_step: ca.SX


def _behind(reference: ca.SX, q: ca.SX) -> ca.SX:
    """Return the quaternion of ``E^T g``."""
    return quaternion_product(ca.vertcat(reference[0], -reference[1:4]), q)


def errors(structure: Structure, read: Read, q: ca.SX, free: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Map the quaternions of g and f of node k to those of ``E^T g`` and ``F^T f``."""
    if not structure.moving:
        return q, free
    return _behind(read(REFERENCE)[_ATTITUDE], q), _behind(read(REFERENCE)[_FREE], free)


def excess_torque(structure: Structure, read: Read, u: ca.SX) -> ca.SX:
    """Return the torque of stage k beside the reference's own."""
    return u - read(REFERENCE)[_TORQUE] if structure.moving else u


def own_torque(structure: Structure, read: Read, u: ca.SX) -> ca.SX:
    """Return the torque of stage k with the reference's own; inverse of `excess_torque`."""
    return u + read(REFERENCE)[_TORQUE] if structure.moving else u


def excess_rate(structure: Structure, read: Read, q: ca.SX, omega: ca.SX) -> ca.SX:
    """Return the body rate of node k beside the reference's, both in body axes."""
    if not structure.moving:
        return omega
    reference = read(REFERENCE)
    g = rotation_from_quaternion(_behind(reference[_ATTITUDE], q))
    return omega - g.T @ reference[_RATE]


def axes(structure: Structure, read: Read) -> tuple[ca.SX, ca.SX]:
    """Return E and F (3, 3) of node k."""
    if not structure.moving:
        return ca.SX.eye(3), ca.SX.eye(3)
    reference = read(REFERENCE)
    return (rotation_from_quaternion(reference[_ATTITUDE]),
            rotation_from_quaternion(reference[_FREE]))


def weights(structure: Structure, read: Read, p: Parameters) -> Weights:
    """Return the weights of node k."""
    by_turn, by_step = trace_hessian(p.attitude_weight), trace_hessian(p.rate_weight)
    if not structure.moving:
        return Weights(p.attitude_weight, p.rate_weight, by_turn, by_step)
    E, F = axes(structure, read)
    return Weights(p.attitude_weight @ E.T, p.rate_weight @ F.T, E @ by_turn @ E.T,
                   F @ by_step @ F.T)
