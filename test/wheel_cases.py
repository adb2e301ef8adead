# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A 6U with four reaction wheels in a pyramid, for the tests."""

from __future__ import annotations

from typing import Any

import numpy as np

from manifold_mpc_ros.config.wheels import WheelArray

_TURN, _TILT = np.pi / 2 * np.arange(4) + np.pi / 4, np.arctan(2.0 ** -0.5)
#: Axes (4, 3) that give as much momentum about every body axis.
PYRAMID = np.stack([np.cos(_TILT) * np.cos(_TURN), np.cos(_TILT) * np.sin(_TURN),
                    np.full(4, np.sin(_TILT))], axis=1)
INERTIA = np.diag([0.05, 0.06, 0.02])


def wheels(**changes: Any) -> WheelArray:
    """Return the pyramid: 2 mN m, 20 mN m s, 2e-5 kg m^2 a wheel."""
    values: dict[str, Any] = {'axes_B': PYRAMID, 'max_torque_n_m': 2e-3,
                              'max_momentum_n_m_s': 2e-2, 'inertia_kg_m2': 2e-5}
    return WheelArray(**{**values, **changes})
