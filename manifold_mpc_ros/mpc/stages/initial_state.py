# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From what was measured to the solver's start: the error's quaternion and the momentum."""

from __future__ import annotations

import casadi as ca

from manifold_mpc_ros.lie.symbolic import quaternion_from_rotation, rotation_from_quaternion
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.phase import Field, Phase, Read, Structure, phase
from manifold_mpc_ros.mpc.scaling import Parameters, unpack
from manifold_mpc_ros.mpc.stages.barrier import largest, least, most
from manifold_mpc_ros.mpc.stages.inequalities import torque_box


def row_by_row(entries: ca.SX) -> ca.SX:
    """Return the matrix (3, 3) of nine entries, row by row."""
    return ca.reshape(entries, 3, 3).T


def _defect(rotation: ca.SX) -> ca.SX:
    """Return how far a matrix (3, 3) is from SO(3): ``max |R^T R - I|``, 2 with det < 0."""
    orthogonality = largest(ca.vec(rotation.T @ rotation - ca.SX.eye(3)))
    return ca.fmax(orthogonality, ca.if_else(ca.det(rotation) > 0, 0, 2))


def _hardness(structure: Structure, v: ca.SX, omega: ca.SX, p: Parameters, read: Read
              ) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return braking angle, second torque and weakness (see `reports.StateReport`)."""
    max_torque = torque_box(structure, read)
    if max_torque is None:
        return ca.SX(0), ca.SX(1), ca.SX(1)
    axis = v / ca.sqrt(ca.dot(v, v) + 1e-30)
    effort = ca.fabs(p.inertia @ axis / max_torque)
    highest, lowest = most(effort), least(effort)
    second = ca.sum1(effort) - highest - lowest
    quickest = most(max_torque / ca.diag(p.inertia))
    braking = ca.norm_2(omega) * most(ca.fabs(p.inertia @ omega / max_torque)) / 2
    return braking, second / highest, quickest * highest


def set_state_phase(structure: Structure) -> Phase:
    """Map (R_NB, R_ND, omega) to the start (q, J omega) and to its state report.

    q is the unit quaternion of ``R_DB = R_ND^T R_NB`` with w >= 0, omega the dimensionless body
    rate. The report is `reports.StateReport`: ``max |R^T R - I|`` of both rotations, 2 for a
    reflection, how hard the turn is, and by how much R_ND moved otherwise than foreseen.
    """
    def angle_of(q: ca.SX, p: Parameters) -> ca.SX:
        """Return the angle left to turn."""
        v = q[1:4]
        if not structure.pointing:
            return 2 * ca.atan2(ca.sqrt(ca.dot(v, v)), q[0])
        gamma, axis = rotation_from_quaternion(q).T @ p.pointing_axis, p.pointing_axis
        across = ca.cross(gamma, axis)
        return ca.atan2(ca.sqrt(ca.dot(across, across)), ca.dot(gamma, axis))

    def expression(read: Read) -> dict[Field, ca.SX]:
        p, measured = unpack(read(f.PARAMETER)), read(f.MEASURED)
        attitude, target = row_by_row(measured[0:9]), row_by_row(measured[9:18])
        momentum = p.inertia @ measured[18:21]
        q = quaternion_from_rotation(target.T @ attitude)
        last, following = (row_by_row(each) for each in ca.vertsplit(read(f.FORESEEN), 9))
        moved = ca.fmin(*(angle_of(quaternion_from_rotation(target.T @ each), p)
                          for each in (last, following)))
        foreseen = angle_of(quaternion_from_rotation(last.T @ following), p)
        return {f.START: ca.vertcat(q, momentum),
                f.STATE_REPORT: ca.vertcat(ca.fmax(_defect(attitude), _defect(target)),
                                      ca.dot(momentum, momentum), angle_of(q, p),
                                      *_hardness(structure, q[1:4], measured[18:21], p, read),
                                      moved - foreseen)}

    return phase('set_state', expression, only=1)
