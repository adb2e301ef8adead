# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The reaction wheels of a controller: what torques they give now, what their momentum costs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.mpc.local_solver import LocalSolver
from manifold_mpc_ros.mpc.scaling import Array, scaling_of
from manifold_mpc_ros.terminal.design import TerminalDesign


class WheelKeeper:
    """Hands the polytope of the wheels to solvers, about the torque that stored momentum takes."""

    def __init__(self, config: AttitudeMpcConfig, terminal: TerminalDesign,
                 solvers: set[LocalSolver]) -> None:
        """Begin with every wheel at rest, and working."""
        self.working = config.wheels
        self.momentum_n_m_s = np.zeros(0 if config.wheels is None else len(config.wheels))
        self._config, self._terminal, self._solvers = config, terminal, solvers
        self._unit = scaling_of(config)
        inverse = np.linalg.inv(terminal.P)
        self._spread = terminal.K @ inverse @ terminal.K.T
        self._rate = float(np.linalg.eigvalsh(inverse[-3:, -3:])[-1]) ** 0.5

    def hold(self, momentum_n_m_s: ArrayLike | None, omega_BN_B: Array, disturbance_B: Array
             ) -> float:
        """Plan with momenta (n,), NaN for wheels that are not there; return the level's share.

        Those keep their last momentum; ``working`` and ``momentum_n_m_s`` are planned with.
        The offset of the polytope is the disturbance (3,) less the gyroscopic torque
        ``omega x W h_w`` of now, so that the first torque is one that the wheels can give, and
        later ones but for how that torque changes. What is left of the terminal level is where
        the local law and the gyroscopic torque of the set's own rates keep every facet.

        Raises ConfigurationError where momenta (n,) [N m s] are not those of the configuration's
        wheels.
        """
        wheels = self._config.wheels
        if wheels is None:
            return 1.0
        self.working, momentum = wheels.reported(momentum_n_m_s)
        self.momentum_n_m_s = np.where(np.isnan(momentum), self.momentum_n_m_s, momentum)
        stored = wheels.axes_B.T @ self.momentum_n_m_s
        offset = disturbance_B - np.cross(omega_BN_B, stored)
        for solver in self._solvers:
            solver.set_torques(self.working.torques, offset, self._unit)
        return self._share(self.working, disturbance_B, float(np.linalg.norm(stored)))

    def _share(self, wheels: WheelArray, disturbance_B: Array, stored_n_m_s: float) -> float:
        """Return the part of c with ``|n K xi| + |xi_rate| |W h_w| <= bound - |n d|``."""
        normals, bounds = wheels.torques.normals, wheels.torques.bounds
        need = np.sqrt(np.einsum('fi,ij,fj->f', normals, self._spread, normals))
        room = np.maximum(bounds - np.abs(normals @ disturbance_B), 1e-3 * bounds)
        least = float(np.min(room / (need + stored_n_m_s * self._rate)))
        return min(1.0, least ** 2 / self._terminal.c)
