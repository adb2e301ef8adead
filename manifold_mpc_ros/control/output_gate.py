# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The gate at the exit: every torque that leaves is finite, within the limits, and no jump."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from manifold_mpc_ros.control.fallback_law import scaled_into

Array = NDArray[np.float64]

#: On the way back to the optimiser the torque changes by at most this part of the limit a tick.
SLEW_FRACTION = 0.5


class OutputGate:
    """Passes torques (3,) [N m]: zero for what is not finite, scaled into the limits else.

    Arguments
    ---------
    max_torque_n_m
        Half widths of the box (3,), inf where there is no limit; None for no limit at all.

    """

    def __init__(self, max_torque_n_m: Array | None) -> None:
        """Start at zero torque."""
        self.set_limit(max_torque_n_m)
        self.latest_B_n_m = np.zeros(3)
        self.not_finite = 0
        self.saturated = 0
        self._returning = False

    def set_limit(self, max_torque_n_m: Array | None) -> None:
        """Keep these limits from now on."""
        self._limit = np.full(3, np.inf) if max_torque_n_m is None else max_torque_n_m

    def slew(self) -> None:
        """Come back without a jump: change gradually until what is asked for is reached."""
        self._returning = True

    def let_through(self, torque_B_n_m: Array) -> Array:
        """Return the torque that is commanded, the direction of what is asked for kept."""
        asked = np.asarray(torque_B_n_m, dtype=np.float64)
        if asked.shape != (3,) or not np.isfinite(asked).all():
            self.not_finite += 1
            asked = np.zeros(3)
        if (np.abs(asked) > self._limit).any():
            self.saturated += 1
            asked = scaled_into(asked, self._limit)
        if self._returning:
            asked = self._towards(asked)
        self.latest_B_n_m = asked
        return asked

    def zero(self) -> Array:
        """Return zero, at once."""
        self._returning = False
        self.latest_B_n_m = np.zeros(3)
        return self.latest_B_n_m

    def _towards(self, asked: Array) -> Array:
        """Return the torque on the straight line to what is asked for that may be reached now."""
        with np.errstate(over='ignore'):
            change = asked - self.latest_B_n_m
        if not np.isfinite(change).all():  # without a limit, from one end of floats to the other
            self._returning = False
            return asked
        part = scaled_into(change, SLEW_FRACTION * self._limit)
        self._returning = not np.array_equal(part, change)
        return self.latest_B_n_m + part if self._returning else asked
