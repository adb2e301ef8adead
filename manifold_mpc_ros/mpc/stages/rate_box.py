# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rate box ``|omega_i| <= max_rate_i``, elastic."""

from __future__ import annotations

import casadi as ca

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.mpc.program.phase import Read
from manifold_mpc_ros.mpc.scaling import Array, Scaling
from manifold_mpc_ros.mpc.stages import barrier
from manifold_mpc_ros.mpc.stages.inequality import (
    Curvature,
    Node,
    RateInequality,
    Variation,
    dimensionless_limits,
)


class RateBox(RateInequality):
    """Values ``+-omega_i / max_rate_i - 1``, upper ones first; data: max_rate (3,)."""

    name = 'rate_box'

    data_size = 3

    @classmethod
    def rows_in(cls, config: AttitudeMpcConfig) -> int:
        """Return 6, or 0 without rate limits."""
        return 0 if config.max_rate_rad_s is None else 6

    def numbers(self, config: AttitudeMpcConfig, unit: Scaling) -> Array:
        """Return the dimensionless limits."""
        return dimensionless_limits(config.max_rate_rad_s, unit.rate_rad_s)

    def values(self, read: Read, node: Node) -> ca.SX:
        """Return v (6,)."""
        return barrier.box(node.rate, self.box(read))

    def change(self, read: Read, new: Node, old: Node, rate_change: ca.SX) -> ca.SX:
        """Return ``v(new) - v(old)`` (6,)."""
        ratio = rate_change / self.box(read)
        return ca.vertcat(ratio, -ratio)

    def slope(self, read: Read, node: Node, step: Variation) -> ca.SX:
        """Return ``dv/dx step`` (6,)."""
        ratio = step.rate / self.box(read)
        return ca.vertcat(ratio, -ratio)

    def gradient(self, read: Read, node: Node, pull: ca.SX) -> Variation:
        """Return ``(dv/dx)^T pull``."""
        return Variation(ca.SX.zeros(3), barrier.box_transpose(pull, self.box(read)))

    def hessian(self, read: Read, node: Node, weight: ca.SX, s: ca.SX) -> Curvature:
        """Return ``(dv/dx)^T diag(weight) dv/dx``."""
        return Curvature(ca.SX.zeros(3, 3), ca.diag(barrier.box_hessian(weight, self.box(read))))

    def largest_rate(self, read: Read, axis: ca.SX) -> ca.SX:
        """Return the rate about a unit axis at which the inscribed ellipsoid ends."""
        share = axis / self.box(read)
        return 1 / ca.sqrt(ca.dot(share, share))

    def box(self, read: Read) -> ca.SX:
        """Return max_rate (3,)."""
        return read(self.data)
