# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The reaction wheels of a controller: what they give and store, what their momentum costs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.compiled import CompiledMpc
from manifold_mpc_ros.mpc.scaling import scaling_of
from manifold_mpc_ros.mpc.stages.wheel_limits import Wheels
from manifold_mpc_ros.terminal.design import TerminalDesign

# What is left of a facet that the momentum at the target is beyond, as a part of its bound.
_LEAST_ROOM = 1e-3


class WheelKeeper:
    """Hands wheels to the solver: their sets, and the momentum of body and wheels."""

    def __init__(self, config: AttitudeMpcConfig, terminal: TerminalDesign,
                 solver: CompiledMpc | None) -> None:
        """Begin with every wheel at rest, and working."""
        self.working = config.wheels
        self.momentum_n_m_s = np.zeros(0 if config.wheels is None else len(config.wheels))
        self._config, self._terminal, self._solver = config, terminal, solver
        self._unit = scaling_of(config)
        inverse = np.linalg.inv(terminal.P)
        self._torque_spread = terminal.K @ inverse @ terminal.K.T
        J, turns = config.inertia_kg_m2, inverse[:-3, :-3]
        self._momentum_spread = J @ inverse[-3:, -3:] @ J
        self._rate, self._turn, momentum = (
            float(np.linalg.eigvalsh(each)[-1]) ** 0.5
            for each in (inverse[-3:, -3:], turns, self._momentum_spread))
        self._own_n_m_s = momentum * terminal.c ** 0.5

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
        self.working, momentum = wheels.reported(momentum_n_m_s)
        self.momentum_n_m_s = np.where(np.isnan(momentum), self.momentum_n_m_s, momentum)
        stored = wheels.axes_B.T @ self.momentum_n_m_s
        now = Wheels(
            self.working,
            R_ND.T @ R_NB @ (self._config.inertia_kg_m2 @ omega_BN_B + stored),
            stored - self.working.matrix @ self.momentum_n_m_s, disturbance_B,
            disturbance_B - np.cross(omega_BN_B, stored))
        if self._solver is not None:
            self._solver.set_wheels(now, self._unit)
        return self.share(now)

    def share(self, now: Wheels) -> float:
        """Return the part of c on which the local law keeps the facets of torque and momentum.

        With theta, omega and p the largest turn, rate and J omega of the set, docs/theory.md (27),
        ``|n K xi| + omega (|H| + p) <= bound - |n d|`` and ``|n J xi_w| + theta |H| <= bound -
        |n (H - o)|``. For pointing the roll is free; the momentum of another one is not promised.
        """
        size = float(np.linalg.norm(now.total_D))
        parts = []
        for zonotope, spread, beside, taken in (
                (now.working.torques, self._torque_spread,
                 self._rate * (size + self._own_n_m_s), now.external_B),
                (now.working.momenta, self._momentum_spread, self._turn * size,
                 now.total_D - now.dead_B)):
            normals, bounds = zonotope.normals, zonotope.bounds
            need = np.sqrt(np.einsum('fi,ij,fj->f', normals, spread, normals)) + beside
            room = np.maximum(bounds - np.abs(normals @ taken), _LEAST_ROOM * bounds)
            parts.append(float(np.min(room / need)))
        return min(1.0, min(parts) ** 2 / self._terminal.c)
