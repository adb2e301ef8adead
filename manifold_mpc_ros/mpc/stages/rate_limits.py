# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Limits on the body rate, elastic: the box, and ellipsoids (|omega|, kinetic energy)."""

from __future__ import annotations

import casadi as ca
import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.program.phase import Read
from manifold_mpc_ros.mpc.scaling import Scaling
from manifold_mpc_ros.mpc.stages import barrier
from manifold_mpc_ros.mpc.stages.inequality import (
    Curvature,
    Node,
    RateInequality,
    Variation,
    dimensionless_limits,
)


class RateBox(RateInequality):
    """The box ``|omega_i| <= max_rate_i``.

    Values ``+-omega_i / max_rate_i - 1``, upper ones first; data: max_rate (3,).
    """

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

    def rate_about(self, read: Read, axis: ca.SX) -> ca.SX:
        """Return the rate about a unit axis at which the first component is at its limit."""
        return 1 / barrier.most(ca.fabs(axis) / self.box(read))

    def box(self, read: Read) -> ca.SX:
        """Return max_rate (3,)."""
        return read(self.data)


class RateEllipsoid(RateInequality):
    """Ellipsoids ``omega^T E omega <= 1``; data: E_i (3, 3) column by column.

    Values ``(omega^T E_i omega - 1) / 2``, one an ellipsoid:
    half of the square, so that a value near 0 is the relative excess of |omega| as in the box.
    """

    name = 'rate_ellipsoid'
    curved = True

    @property
    def data_size(self) -> int:
        """Nine numbers an ellipsoid."""
        return 9 * self.rows

    @classmethod
    def rows_in(cls, config: AttitudeMpcConfig) -> int:
        """Return the number of ellipsoids."""
        return len(config.rate_ellipsoids_s2)

    def numbers(self, config: AttitudeMpcConfig, unit: Scaling) -> Array:
        """Return the dimensionless E of each ellipsoid."""
        return np.ravel(np.asarray(config.rate_ellipsoids_s2) * unit.rate_rad_s ** 2)

    def _matrices(self, read: Read) -> list[ca.SX]:
        """Return E of each ellipsoid (3, 3)."""
        return [ca.reshape(part, 3, 3) for part in ca.vertsplit(read(self.data), 9)]

    def values(self, read: Read, node: Node) -> ca.SX:
        """Return v (rows,)."""
        return ca.vertcat(*((ca.dot(node.rate, e @ node.rate) - 1) / 2
                            for e in self._matrices(read)))

    def change(self, read: Read, new: Node, old: Node, rate_change: ca.SX) -> ca.SX:
        """Return ``(omega+ - omega)^T E (omega+ + omega) / 2`` (rows,)."""
        return ca.vertcat(*(ca.dot(rate_change, e @ (new.rate + old.rate)) / 2
                            for e in self._matrices(read)))

    def slope(self, read: Read, node: Node, step: Variation) -> ca.SX:
        """Return ``omega^T E step`` (rows,)."""
        return ca.vertcat(*(ca.dot(e @ node.rate, step.rate) for e in self._matrices(read)))

    def gradient(self, read: Read, node: Node, pull: ca.SX) -> Variation:
        """Return ``sum_i pull_i E_i omega``."""
        total = ca.SX.zeros(3)
        for i, e in enumerate(self._matrices(read)):
            total += pull[i] * (e @ node.rate)
        return Variation(ca.SX.zeros(3), total)

    def hessian(self, read: Read, node: Node, weight: ca.SX, s: ca.SX) -> Curvature:
        """Return ``sum_i weight_i (E_i omega) (E_i omega)^T + s_i E_i``."""
        total = ca.SX.zeros(3, 3)
        for i, e in enumerate(self._matrices(read)):
            slope = e @ node.rate
            total += weight[i] * slope @ slope.T + s[i] * e
        return Curvature(ca.SX.zeros(3, 3), total)

    def largest_rate(self, read: Read, axis: ca.SX) -> ca.SX:
        """Return the rate about a unit axis at which the first ellipsoid ends."""
        rates = [1 / ca.sqrt(ca.dot(axis, e @ axis)) for e in self._matrices(read)]
        return ca.mmin(ca.vertcat(*rates))

    def box(self, read: Read) -> ca.SX:
        """Return half widths r_i = a / sqrt(E_ii), with a from ``sum_ij |E_ij| r_i r_j = 1``."""
        widths = []
        for e in self._matrices(read):
            scale = 1 / ca.sqrt(ca.diag(e))
            widths.append(scale / ca.sqrt(ca.dot(scale, ca.fabs(e) @ scale)))
        smallest = widths[0]
        for width in widths[1:]:
            smallest = ca.fmin(smallest, width)
        return smallest
