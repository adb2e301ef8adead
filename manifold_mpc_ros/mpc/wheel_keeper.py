# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The reaction wheels of a controller: what they give and store, what their momentum costs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.wheels import WheelArray, Zonotope
from manifold_mpc_ros.dynamics.null_room import null_room
from manifold_mpc_ros.dynamics.wheel_allocation import WheelAllocation
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.compiled import CompiledMpc
from manifold_mpc_ros.mpc.scaling import scaling_of
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus
from manifold_mpc_ros.mpc.stages.wheel_limits import Wheels
from manifold_mpc_ros.terminal.design import TerminalDesign

# What is left of a facet that the momentum at the target is beyond, as a part of its bound.
_LEAST_ROOM = 1e-3
# A plan whose wheels lack more than this part of their momentum is not possible.
_LACKING = 1e-3
# Plans that use less of the torques that leave nu alone need not keep to them.
_UNUSED = 0.5


class WheelKeeper:
    """Hands wheels to the solver: their sets, and the momentum of body and wheels."""

    def __init__(self, config: AttitudeMpcConfig, terminal: TerminalDesign,
                 solver: CompiledMpc | None) -> None:
        """Begin with every wheel at rest, and working."""
        self.working = config.wheels
        self.momentum_n_m_s = np.zeros(0 if config.wheels is None else len(config.wheels))
        self._config, self._terminal, self._solver = config, terminal, solver
        self._held = False
        self._unit = scaling_of(config)
        inverse = np.linalg.inv(terminal.P)
        self._torque_spread = terminal.K @ inverse @ terminal.K.T
        J, turns = config.inertia_kg_m2, inverse[:-3, :-3]
        self._momentum_spread = J @ inverse[-3:, -3:] @ J
        self._rate, self._turn, momentum = (
            float(np.linalg.eigvalsh(each)[-1]) ** 0.5
            for each in (inverse[-3:, -3:], turns, self._momentum_spread))
        self._own_n_m_s = momentum * terminal.c ** 0.5

    def reset(self) -> None:
        """Plan with all that wheels can give."""
        self._held = False

    def hold(self, momentum_n_m_s: ArrayLike | None, R_NB: Array, omega_BN_B: Array, R_ND: Array,
             disturbance_B: Array) -> float:
        """Plan with momenta (n,), NaN for wheels that are not there; return the level's share.

        Those keep their last momentum; ``working`` and ``momentum_n_m_s`` are planned with. The
        momentum of body and wheels is ``R (J omega + W h_w)``.

        Raises ConfigurationError where momenta (n,) [N m s] are not those of the configuration's
        wheels.
        """
        wheels = self._config.wheels
        if wheels is None:
            return 1.0
        working, momentum = wheels.reported(momentum_n_m_s)
        self.working = working
        self.momentum_n_m_s = np.where(np.isnan(momentum), self.momentum_n_m_s, momentum)
        stored = wheels.axes_B.T @ self.momentum_n_m_s
        total_D = R_ND.T @ R_NB @ (self._config.inertia_kg_m2 @ omega_BN_B + stored)
        dead = stored - working.matrix @ self.momentum_n_m_s
        now = Wheels(
            *self._sets(working, stored - dead, total_D - dead), total_D, dead, disturbance_B,
            disturbance_B - np.cross(omega_BN_B, stored))
        if self._solver is not None:
            self._solver.set_wheels(now, self._unit)
        return self.share(now)

    def _sets(self, wheels: WheelArray, *stored_B: Array) -> tuple[Zonotope, Zonotope]:
        """Return the torques and momenta that plans keep to; these (3,) are among the momenta."""
        if not self._held:
            return wheels.torques, wheels.momenta
        nu = wheels.null_basis @ (wheels.null_basis.T @ self.momentum_n_m_s)
        left = np.max([wheels.max_momentum_n_m_s - np.abs(nu),
                       *(np.abs(wheels.inverse @ each) for each in stored_B)], axis=0)
        return wheels.held(wheels.max_torque_n_m), wheels.held(left)

    def motor_torques(self, plan: AttitudeMpcSolution) -> Array:
        """Return motor torques (n,) of a plan's first step [N m] that leave its rest possible.

        As much of the torque as the wheels can give in this state; none of a failed one. After a
        plan of four wheels whose rest is not possible, plans keep to what wheels give whose null
        space rests, until they use little of it: docs/theory.md, section 15.

        Raises ConfigurationError without wheels.
        """
        wheels, momentum = self.working, self.momentum_n_m_s
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
        self._held = (
            wheels.held(wheels.max_torque_n_m).gauge(np.diff(kept, axis=0).T / h) > _UNUSED
            if self._held else lacking > _LACKING * float(wheels.max_momentum_n_m_s.min()))
        return allocation.leading_into(room[1], part)

    def share(self, now: Wheels) -> float:
        """Return the part of c on which the local law keeps the facets of torque and momentum.

        With theta, omega and p the largest turn, rate and J omega of the set, docs/theory.md (27),
        ``|n K xi| + omega (|H| + p) <= bound - |n d|`` and ``|n J xi_w| + theta |H| <= bound -
        |n (H - o)|``. For pointing the roll is free; the momentum of another one is not promised.
        """
        size = float(np.linalg.norm(now.total_D))
        parts = []
        for zonotope, spread, beside, taken in (
                (now.torques, self._torque_spread,
                 self._rate * (size + self._own_n_m_s), now.external_B),
                (now.momenta, self._momentum_spread, self._turn * size,
                 now.total_D - now.dead_B)):
            normals, bounds = zonotope.normals, zonotope.bounds
            need = np.sqrt(np.einsum('fi,ij,fj->f', normals, spread, normals)) + beside
            room = np.maximum(bounds - np.abs(normals @ taken), _LEAST_ROOM * bounds)
            parts.append(float(np.min(room / need)))
        return min(1.0, min(parts) ** 2 / self._terminal.c)
