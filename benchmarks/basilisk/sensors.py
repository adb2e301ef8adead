# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the spacecraft in Basilisk measures: attitude and rate, with noise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from Basilisk.architecture import messaging, sysModel
from Basilisk.utilities import RigidBodyKinematics


class Sensors(sysModel.SysModel):
    """Attitude and rate as they are measured, where given with white noise."""

    def __init__(self, state: Any, noise: Mapping[str, float] | None) -> None:
        """Listen to the message of the state."""
        super().__init__()
        self.ModelTag = 'sensors'
        self._state, self._noise = state, noise or {'attitude_rad': 0.0, 'rate_rad_s': 0.0}
        self._draw = np.random.default_rng(0)
        self.measured = messaging.NavAttMsg()

    def UpdateState(self, now_ns: int) -> None:
        """Measure; the MRP of a small angle is a quarter of it."""
        state, (turned, faster) = self._state.read(), self._draw.normal(size=(2, 3))
        self.measured.write(messaging.NavAttMsgPayload(
            sigma_BN=RigidBodyKinematics.addMRP(
                np.array(state.sigma_BN), self._noise['attitude_rad'] / 4.0 * turned).tolist(),
            omega_BN_B=(np.array(state.omega_BN_B)
                        + self._noise['rate_rad_s'] * faster).tolist()), now_ns)
