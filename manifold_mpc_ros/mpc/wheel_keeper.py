# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The reaction wheels of a controller: their momenta into a plan, motor torques out of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.null_room import null_room
from manifold_mpc_ros.dynamics.wheel_allocation import WheelAllocation
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.compiled import CompiledMpc
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus

# A plan whose wheels lack more than this part of their momentum is not possible.
_LACKING = 1e-3
# Plans that use less of the torques that leave nu alone need not keep to them.
_UNUSED = 0.5


class WheelKeeper:
    """Tells the solver of wheels (backends/wheels.c), and finds their torques for a plan."""

    def __init__(self, config: AttitudeMpcConfig, solver: CompiledMpc) -> None:
        """Begin with every wheel working."""
        self._config, self._solver, self._working = config, solver, config.wheels
        self.held = False

    def reset(self) -> None:
        """Plan with all that wheels can give."""
        self.held = False

    def tell(self, momentum_n_m_s: ArrayLike | None) -> None:
        """Plan with momenta (n,) [N m s], NaN for wheels that are not there, None: at rest.

        Raises ConfigurationError where they are not those of the configuration's wheels.
        """
        if self._config.wheels is not None:
            self._working, momentum = self._config.wheels.reported(momentum_n_m_s)
            self._solver.set_momentum(momentum, self.held)

    def target_momentum(self, plan: AttitudeMpcSolution, R_ND: Array) -> float:
        """Return what is to be stored at rest at R_ND, in parts of what wheels that work can.

        0 for a failed plan, and for pointing, whose roll is free.
        """
        wheels, momentum = self._working, self._solver.momentum_n_m_s
        free = self._config.target != 'attitude'
        if wheels is None or free or plan.status is SolveStatus.FAILED:
            return 0.0
        stored = wheels.axes_B.T @ momentum
        total_N = plan.R_NB[0] @ (self._config.inertia_kg_m2 @ plan.omega_BN_B[0] + stored)
        return wheels.momenta.gauge(R_ND.T @ total_N - stored + wheels.matrix @ momentum)

    def motor_torques(self, plan: AttitudeMpcSolution) -> Array:
        """Return motor torques (n,) of a plan's first step [N m] that leave its rest possible.

        As much of the torque as the wheels can give in this state; none of a failed one. After a
        plan of four wheels whose rest is not possible, plans keep to what wheels give whose null
        space rests, until they use little of it: docs/theory.md, section 15.

        Raises ConfigurationError without wheels.
        """
        wheels, momentum = self._working, self._solver.momentum_n_m_s
        J, h = self._config.inertia_kg_m2, self._config.step_s
        if wheels is None:
            raise ConfigurationError('wheel_momentum_n_m_s', momentum, 'None without wheels')
        if plan.status is SolveStatus.FAILED:
            return np.zeros(len(wheels))
        allocation = WheelAllocation(
            wheels, J, h, plan.omega_BN_B[0], momentum, plan.torque_B_n_m)
        part = allocation.part()
        if wheels.null_basis.shape[1] != 1:
            return allocation.motor_torques(part)
        stored = wheels.axes_B.T @ momentum
        total_N = plan.R_NB[0] @ (J @ plan.omega_BN_B[0] + stored)
        kept = (np.einsum('kji,j->ki', plan.R_NB, total_N) - plan.omega_BN_B @ J
                - stored + wheels.matrix @ momentum)
        room, gap = null_room(wheels, kept, h)
        nu = float(wheels.null_basis[:, 0] @ momentum)
        lacking = max(gap, room[0, 0] - nu, nu - room[0, 1])
        self.held = (
            wheels.held(wheels.max_torque_n_m).gauge(np.diff(kept, axis=0).T / h) > _UNUSED
            if self.held else lacking > _LACKING * float(wheels.max_momentum_n_m_s.min()))
        return allocation.leading_into(room[1], part)
