# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The predictor's own model as the simulated body: what the theory of the paper speaks about."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.lgvi import lgvi_step

Array: TypeAlias = NDArray[np.float64]


class ModelPlant:
    """A body that does exactly what the controller predicts: same inertia, step and forcing.

    No limits, disturbance or noise. For reproducing the paper, and for tests of statements that
    hold for the model; `Plant` is the one to judge a controller by.
    """

    def __init__(
        self, config: AttitudeMpcConfig, R_NB: ArrayLike,
        omega_BN_B: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Start from an attitude (3, 3) and a body rate (3,) [rad/s]."""
        self.config = config
        self.R_NB = np.array(R_NB, dtype=np.float64)
        self.omega_BN_B = np.array(omega_BN_B, dtype=np.float64)

    @property
    def step_s(self) -> float:
        """The time that one call of `step` takes, the controller's step [s]."""
        return self.config.step_s

    def step(self, tau_B: ArrayLike) -> None:
        """Advance by one step of the model under a torque (3,) [N m].

        Raises StepExistenceError beyond the guard: the model has no substeps.
        """
        self.R_NB, self.omega_BN_B = lgvi_step(
            self.R_NB, self.omega_BN_B, tau_B, inertia_kg_m2=self.config.inertia_kg_m2,
            step_s=self.config.step_s,
            forcing='paper' if self.config.forcing == 'paper' else 'symmetric')

    def measure(self) -> tuple[Array, Array]:
        """Return the exact attitude (3, 3) and body rate (3,) [rad/s]."""
        return self.R_NB, self.omega_BN_B
