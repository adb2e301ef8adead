# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A rigid body for closed loops at the speed of the solver: one LGVI step of the measured state.

It has an inertia and a disturbance torque of its own; with those of the controller and none it
is the controller's model.
"""

from __future__ import annotations

import casadi as ca

from manifold_mpc_ros.dynamics.symbolic import lgvi_step
from manifold_mpc_ros.lie.symbolic import quaternion_from_rotation, rotation_from_quaternion
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.phase import Field, Phase, Read, phase
from manifold_mpc_ros.mpc.stages.initial_state import row_by_row


def plant_phase(*, symmetric: bool) -> Phase:
    """Map (R_NB, omega) and the applied torque to the state a step later, by either forcing."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        measured, body = read(f.MEASURED), read(f.BODY)
        inertia = ca.reshape(body[0:9], 3, 3)
        q = quaternion_from_rotation(row_by_row(measured[0:9]))
        step = lgvi_step(q, measured[18:21], read(f.APPLIED) + body[9:12], inertia,
                         ca.inv(inertia), 1, symmetric)
        attitude = rotation_from_quaternion(
            step.quaternion / ca.sqrt(ca.dot(step.quaternion, step.quaternion)))
        return {f.MEASURED: ca.vertcat(ca.vec(attitude.T), measured[9:18], step.omega)}

    return phase(f'plant_{"symmetric" if symmetric else "paper"}', expression, only=1)
