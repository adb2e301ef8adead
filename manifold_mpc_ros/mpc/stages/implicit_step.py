# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The implicit step of a momentum, where one is needed: starts, and free steps of the cost."""

from __future__ import annotations

import casadi as ca

from manifold_mpc_ros.dynamics.symbolic import cayley_residual, cayley_step
from manifold_mpc_ros.lie.symbolic import cayley_quaternion
from manifold_mpc_ros.mpc.scaling import Parameters
from manifold_mpc_ros.mpc.stages.step_derivatives import principal

# Newton steps from the linear guess, and from a step near the wanted one.
_STEPS, _STEPS_NEAR = 5, 3
# A Newton residual above this marks a momentum whose step was not found.
_RESIDUAL = 1e-9


def implicit_step(momentum: ca.SX, p: Parameters, near: ca.SX | None = None
                  ) -> tuple[ca.SX, ca.SX]:
    """Map a momentum m+ to the unit quaternion of its step, and a number positive when it is one.

    ``near`` is the quaternion of a step near it.
    """
    guess = None if near is None else near[1:4] / near[0]
    c = cayley_step(momentum, p.inertia, p.inertia_inverse, guess=guess,
                    steps=_STEPS if near is None else _STEPS_NEAR)
    step = cayley_quaternion(c)
    found = _RESIDUAL - cayley_residual(c, momentum, p.inertia)
    return step, ca.fmin(found, principal(step, p.inertia))
