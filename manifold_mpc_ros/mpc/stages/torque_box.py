# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The torque box ``|u_i| <= max_torque_i``, hard; about a disturbance torque where one acts."""

from __future__ import annotations

import casadi as ca
import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.program.phase import Read
from manifold_mpc_ros.mpc.scaling import Scaling
from manifold_mpc_ros.mpc.stages import barrier
from manifold_mpc_ros.mpc.stages.inequality import TorqueInequality, dimensionless_limits


class TorqueBox(TorqueInequality):
    """Values ``+-u_i / max_torque_i - 1``, upper ones first; data: max_torque (3,) first."""

    name = 'torque_box'

    data_size = 3

    @classmethod
    def rows_in(cls, config: AttitudeMpcConfig) -> int:
        """Return 6, or 0 without torque limits."""
        return 0 if config.max_torque_n_m is None else 6

    def numbers(self, config: AttitudeMpcConfig, unit: Scaling) -> Array:
        """Return the dimensionless limits."""
        return dimensionless_limits(config.max_torque_n_m, unit.torque_n_m)

    def values(self, read: Read, u: ca.SX) -> ca.SX:
        """Return v (6,)."""
        return barrier.box(u, self._limit(read))

    def slope(self, read: Read, du: ca.SX) -> ca.SX:
        """Return ``dv/du du`` (6,)."""
        ratio = du / self._limit(read)
        return ca.vertcat(ratio, -ratio)

    def gradient(self, read: Read, pull: ca.SX) -> ca.SX:
        """Return ``(dv/du)^T pull`` (3,)."""
        return barrier.box_transpose(pull, self._limit(read))

    def hessian(self, read: Read, weight: ca.SX) -> ca.SX:
        """Return the diagonal (3,) of ``(dv/du)^T diag(weight) dv/du``."""
        return barrier.box_hessian(weight, self._limit(read))

    def _limit(self, read: Read) -> ca.SX:
        """Return max_torque (3,)."""
        return read(self.data)

    def box(self, read: Read) -> ca.SX:
        """Return max_torque (3,)."""
        return self._limit(read)

    def inside(self, read: Read, u: ca.SX, margin: ca.SX) -> ca.SX:
        """Return the torque clipped to ``(margin_lower - 1, 1 - margin_upper)`` of the limits."""
        limit = self._limit(read)
        ratio = ca.fmin(ca.fmax(u / limit, margin[3:6] - 1), 1 - margin[0:3])
        return ratio * limit


class ShiftedTorqueBox(TorqueBox):
    """``|u_i - d_i| <= max_torque_i``, u the net torque, d the disturbance; data: both (3,)."""

    name = 'shifted_torque_box'

    data_size = 6

    def numbers(self, config: AttitudeMpcConfig, unit: Scaling) -> Array:
        """Return the dimensionless limits, and no disturbance."""
        return np.concatenate([super().numbers(config, unit), np.zeros(3)])

    def values(self, read: Read, u: ca.SX) -> ca.SX:
        """Return v (6,)."""
        return super().values(read, u - self._disturbance(read))

    def inside(self, read: Read, u: ca.SX, margin: ca.SX) -> ca.SX:
        """Return the torque moved inside by relative margins (6,)."""
        d = self._disturbance(read)
        return d + super().inside(read, u - d, margin)

    def box(self, read: Read) -> ca.SX:
        """Return ``max_torque - |d|`` (3,)."""
        return self._limit(read) - ca.fabs(self._disturbance(read))

    def _limit(self, read: Read) -> ca.SX:
        """Return max_torque (3,)."""
        return read(self.data)[0:3]

    def _disturbance(self, read: Read) -> ca.SX:
        """Return d (3,)."""
        return read(self.data)[3:6]
