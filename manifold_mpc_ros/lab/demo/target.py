# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the demo is to turn to: the identity, or what guidance commands in a mode."""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.cli.arguments import shipped_config
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.guidance import GUIDANCE_NAME, GUIDANCE_PARAMETERS, GuidanceConfig
from manifold_mpc_ros.config.parameter import read_values
from manifold_mpc_ros.control.guidance.laws import Guidance
from manifold_mpc_ros.lie.arrays import Array, IntArray
from manifold_mpc_ros.mpc.target import error_angle

#: The controller goes on for so long without another reference [s]; guidance publishes so often.
TIMEOUT_S, PERIOD_S = 30.0, 1.0
FILE = 'guidance.yaml'


class DemoTarget:
    """The commanded attitude over time; ``mode`` of guidance, None for the identity."""

    def __init__(self, config: AttitudeMpcConfig, mode: str | None) -> None:
        """Find what guidance commands, with its shipped parameters but the mode."""
        self._config, self.mode = config, mode
        self._law = None if mode is None else Guidance(GuidanceConfig.from_parameters({
            **read_values(shipped_config(FILE), GUIDANCE_NAME, GUIDANCE_PARAMETERS),
            'mode': mode}))

    def errors(self, stamps_ns: IntArray, R_NB: Array, omega_BN_B: Array) -> tuple[Array, Array]:
        """Map states (n, ...) at times (n,) [ns] to errors (n,) of attitude and rate [rad, rad/s].

        Of the rate it is the norm of what it is beside the target's.
        """
        R_DB, excess = R_NB, omega_BN_B
        if self._law is not None:
            R_ND, omega_DN_D, _ = self._law.points(stamps_ns)
            R_DB = np.swapaxes(R_ND, -1, -2) @ R_NB
            excess = omega_BN_B - (np.swapaxes(R_DB, -1, -2) @ omega_DN_D[..., None])[..., 0]
        return np.asarray(error_angle(self._config, R_DB)), np.linalg.norm(excess, axis=-1)
