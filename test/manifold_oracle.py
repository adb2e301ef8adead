# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The general `ManifoldMpc` as the oracle of the fast solver, for attitude and for pointing.

It shares the configuration and the formulas of `problems` with nothing else: shooting nodes and
IPOPT from many starts on one side, the specialised sweep and its own search on the other.
"""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.lgvi import cayley_step
from manifold_mpc_ros.lab.reference.manifold_mpc import ManifoldMpc, ManifoldSolution, Terminal
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.problem_of import problem_of


def point_of(config: AttitudeMpcConfig, R_DB: Array, omega_BN_B: Array) -> Array:
    """Map an error ``R_ND^T R_NB`` (3, 3) and a rate (3,) to the point of the problem's manifold.

    The free step's quaternion, after the attitude's quaternion or the direction Gamma.
    """
    c = cayley_step(config.step_s * config.inertia_kg_m2 @ omega_BN_B, config.inertia_kg_m2)
    step = np.concatenate([[1.0], c]) / np.sqrt(1.0 + c @ c)
    first = (R_DB.T @ config.pointing_axis_B if config.target == 'pointing'
             else so3.quaternion_from_rotation(R_DB))
    return np.concatenate([first, step])


class ManifoldOracle:
    """The best known plan of any state of one configuration."""

    def __init__(self, config: AttitudeMpcConfig, *, starts: int = 12,
                 terminal: Terminal | None = None) -> None:
        """Write the problem of the configuration's target down."""
        self.config = config
        self.mpc = ManifoldMpc(problem_of(config), config.horizon, config.terminal_constraint,
                               terminal=terminal, starts=starts)

    def best(self, R_DB: Array, omega_BN_B: Array) -> ManifoldSolution:
        """Return the cheapest plan over all starts, from cold; ``value`` is its cost."""
        self.mpc.reset()
        return self.mpc.solve(point_of(self.config, R_DB, omega_BN_B))
