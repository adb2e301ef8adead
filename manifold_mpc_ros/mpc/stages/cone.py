# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Keep-out and keep-in cones of body axes, elastic.

With r = R_DB b the axis and s the cone's direction, both in the target's axes, a cone is
``+-(s . r - cos theta) <= 0``. A spatial turn x moves r by ``x x r``, so that

    d(s . r) = x . (r x s),    d2(s . r) = x . (sym(r s^T) - (r . s) I) x
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.symbolic import rotation_from_quaternion
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.field import Field, Memory
from manifold_mpc_ros.mpc.program.phase import Phase, Read, phase
from manifold_mpc_ros.mpc.scaling import Array, Scaling
from manifold_mpc_ros.mpc.stages.inequality import Curvature, Node, NodeInequality, Variation


class ConeInequality(NodeInequality):
    """Values ``s . R_DB b - beta``, one a cone; data: b (3) and beta of each.

    b is the axis, with its sign turned for keep-in, over sin theta, so that a value near 0 is the
    angle by which the cone is violated [rad]. Each node has directions of its own.
    """

    name = 'cone'
    penalty = 1e3
    of_attitude = True

    def __init__(self, rows: int) -> None:
        """Make the fields; the directions are there in the caller's axes and in the target's."""
        super().__init__(rows)
        self.direction_N = Field('cone_direction_N', 3 * rows, Memory.MODEL)
        self.direction = Field('cone_direction', 3 * rows, Memory.MODEL)
        #: What the slew law of a start aims at, stage by stage: quaternion in the target's axes.
        self.aim = Field('aim', 4, Memory.MODEL)

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields that it adds to the solver's memory."""
        return (*super().fields, self.direction_N, self.direction, self.aim)

    @property
    def data_size(self) -> int:
        """Four numbers a cone."""
        return 4 * self.rows

    @classmethod
    def rows_in(cls, config: AttitudeMpcConfig) -> int:
        """Return the number of cones."""
        return len(config.cones)

    def numbers(self, config: AttitudeMpcConfig, unit: Scaling) -> Array:
        """Return b and beta of the cones that hold between samples too, directions fixed."""
        return cone_numbers(config.kept_cones)

    def turned(self, read: Read, R_DN: ca.SX) -> dict[Field, ca.SX]:
        """Return the directions in the target's axes."""
        return {self.direction: ca.vertcat(
            *(R_DN @ s for s in ca.vertsplit(read(self.direction_N), 3)))}

    def _pairs(self, read: Read, attitude: ca.SX) -> list[tuple[ca.SX, ca.SX, ca.SX]]:
        """Return (s, r, beta) of each cone."""
        g = rotation_from_quaternion(attitude)
        return [(s, g @ data[0:3], data[3]) for s, data in zip(
            ca.vertsplit(read(self.direction), 3), ca.vertsplit(read(self.data), 4))]

    def values(self, read: Read, node: Node) -> ca.SX:
        """Return v (rows,)."""
        return ca.vertcat(*(ca.dot(s, r) - beta for s, r, beta in self._pairs(
            read, node.attitude)))

    def change(self, read: Read, new: Node, old: Node, rate_change: ca.SX) -> ca.SX:
        """Return ``s . (r+ - r)`` (rows,)."""
        pairs = zip(self._pairs(read, new.attitude), self._pairs(read, old.attitude))
        return ca.vertcat(*(ca.dot(s, after - before) for (s, after, _), (_, before, _) in pairs))

    def slope(self, read: Read, node: Node, step: Variation) -> ca.SX:
        """Return ``dv/dx step`` (rows,)."""
        return ca.vertcat(*(ca.dot(step.turn, ca.cross(r, s)) for s, r, _ in self._pairs(
            read, node.attitude)))

    def gradient(self, read: Read, node: Node, pull: ca.SX) -> Variation:
        """Return ``sum_i pull_i (r_i x s_i)``."""
        total = ca.SX.zeros(3)
        for i, (s, r, _) in enumerate(self._pairs(read, node.attitude)):
            total += pull[i] * ca.cross(r, s)
        return Variation(total, ca.SX.zeros(3))

    def hessian(self, read: Read, node: Node, weight: ca.SX, s: ca.SX) -> Curvature:
        """Return the barrier's part, and by ``exact`` that of the values' curvature."""
        total = ca.SX.zeros(3, 3)
        for i, (direction, r, _) in enumerate(self._pairs(read, node.attitude)):
            slope, outer = ca.cross(r, direction), r @ direction.T
            curved = (outer + outer.T) / 2 - ca.dot(r, direction) * ca.SX.eye(3)
            total += weight[i] * slope @ slope.T + read(f.EXACT) * s[i] * curved
        return Curvature(total, ca.SX.zeros(3, 3))


def cone_numbers(cones: Sequence[Cone]) -> Array:
    """Map cones to b and beta of each (4 n,)."""
    return np.concatenate([
        each.sign / np.sin(each.half_angle_rad) * np.append(
            each.axis_B, np.cos(each.half_angle_rad)) for each in cones])


def direction_phases(cones: ConeInequality | None) -> tuple[Phase, ...]:
    """Turn the directions of every node into the axes of the measured target; none without."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        assert cones is not None
        R_ND = ca.reshape(read(f.MEASURED)[9:18], 3, 3).T
        return cones.turned(read, R_ND.T)

    return () if cones is None else (phase('directions', expression, beyond=1),)
