# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is known of the speeds of reaction wheels, by the reports that came. Pure logic."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.control.input_gate import StateSample
from manifold_mpc_ros.lie.arrays import Array


class WheelReports:
    """The latest report, by the names of an array of wheels.

    Arguments
    ---------
    wheels
        The array; its inertias make momenta of speeds.
    timeout_ns
        A report older than a state by more than this counts for nothing [ns].

    """

    def __init__(self, wheels: WheelArray, timeout_ns: int) -> None:
        """Know nothing yet."""
        self.wheels = wheels
        self._timeout_ns = timeout_ns
        self.forget()

    def forget(self) -> None:
        """Forget the reports."""
        self.stamp_ns: int | None = None
        self.speed_rad_s = np.full(len(self.wheels), np.nan)

    def receive(self, stamp_ns: int, names: Sequence[str], speeds: Sequence[float]) -> None:
        """Take a report: speeds of the wheels about their axes, in the body, by name [rad/s].

        What is not a number, and wheels without a name in it, are not reported.
        """
        given = dict(zip(names, speeds))
        self.stamp_ns = stamp_ns
        self.speed_rad_s = np.array([given.get(name, np.nan) for name in self.wheels.names])

    def momenta(self, sample: StateSample) -> Array:
        """Return ``h_w = J_w (speed + w . omega)`` (n,) at a state [N m s], NaN where unknown."""
        if self.stamp_ns is None or sample.stamp_ns - self.stamp_ns > self._timeout_ns:
            return np.full(len(self.wheels), np.nan)
        assert self.wheels.inertia_kg_m2 is not None
        turning = self.wheels.axes_B @ sample.omega_BN_B
        return np.asarray(self.wheels.inertia_kg_m2 * (self.speed_rad_s + turning))
