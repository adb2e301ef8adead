# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Keep-out and keep-in cones of body axes, and groups of which any one is kept, elastic.

With r = R_DB b the axis and s the cone's direction, both in the target's axes, a cone is
``+-(s . r - cos theta) <= 0``. A spatial turn x moves r by ``x x r``, so that

    d(s . r) = x . (r x s),    d2(s . r) = x . (sym(r s^T) - (r . s) I) x
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import casadi as ca
import numpy as np

from manifold_mpc_ros.config.cones import Cone, groups
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.lie.symbolic import rotation_from_quaternion
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.phase import Field, Memory, Phase, Read, phase
from manifold_mpc_ros.mpc.scaling import Scaling
from manifold_mpc_ros.mpc.stages.inequality import Curvature, LocalInequality, Node, Variation

#: What the slew law of a start aims at, stage by stage: quaternion in the target's axes.
AIM = Field('aim', 4, Memory.MODEL)
#: Axes of the two turns of a way round cones, and its rate and deceleration.
WAY, WAY_LIMITS = Field('way', 6, Memory.GLOBAL), Field('way_limits', 2, Memory.GLOBAL)


class ConeInequality(LocalInequality):
    """Values ``s . R_DB b - beta``, one a cone; data: b (3) and beta of each.

    b is the axis, with its sign turned for keep-in, over sin theta, so that a value near 0 is the
    angle by which the cone is violated [rad]. Each node has directions of its own.
    """

    name = 'cone'
    penalty = 1e3
    of_attitude = curved = True
    #: Cones of one value.
    members: ClassVar[int] = 1

    def __init__(self, rows: int, graded: bool = False) -> None:
        """Make the fields; the directions are there in the caller's axes and in the target's."""
        self.cones = rows * self.members
        super().__init__(rows, graded)
        self.direction_N = Field(f'{self.name}_direction_N', 3 * self.cones, Memory.MODEL)
        self.direction = Field(f'{self.name}_direction', 3 * self.cones, Memory.MODEL)

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields that it adds to the solver's memory."""
        return (*super().fields, self.direction_N, self.direction, AIM, WAY,
                WAY_LIMITS)

    @property
    def data_size(self) -> int:
        """Four numbers a cone."""
        return 4 * self.cones

    @classmethod
    def places(cls, cones: Sequence[Cone]) -> list[int]:
        """Return which of the cones are of this kind, value by value."""
        return [i for i, each in enumerate(cones) if each.group is None]

    @classmethod
    def rows_in(cls, config: AttitudeMpcConfig) -> int:
        """Return the number of values."""
        return len(cls.places(config.cones)) // cls.members

    def numbers(self, config: AttitudeMpcConfig, unit: Scaling) -> Array:
        """Return b and beta of the cones that hold between samples too, directions fixed."""
        return self.numbers_of(config.kept_cones)

    def numbers_of(self, cones: Sequence[Cone]) -> Array:
        """Map all cones to b and beta of each that is of this kind."""
        chosen = [cones[i] for i in self.places(cones)]
        return np.concatenate([
            each.sign / np.sin(each.half_angle_rad) * np.append(
                each.axis_B, np.cos(each.half_angle_rad)) for each in chosen])

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

    def _derivatives(self, read: Read, node: Node) -> list[tuple[ca.SX, ca.SX]]:
        """Return gradient (3,) and Hessian (3, 3) of each value by a spatial turn."""
        return [(ca.cross(r, s), _curved(s, r)) for s, r, _ in self._pairs(read, node.attitude)]

    def slope(self, read: Read, node: Node, step: Variation) -> ca.SX:
        """Return ``dv/dx step`` (rows,)."""
        return ca.vertcat(*(ca.dot(step.turn, by) for by, _ in self._derivatives(read, node)))

    def gradient(self, read: Read, node: Node, pull: ca.SX) -> Variation:
        """Return ``sum_i pull_i dv_i/dx``."""
        total = ca.SX.zeros(3)
        for i, (by, _) in enumerate(self._derivatives(read, node)):
            total += pull[i] * by
        return Variation(total, ca.SX.zeros(3))

    def hessian(self, read: Read, node: Node, weight: ca.SX, s: ca.SX) -> Curvature:
        """Return the barrier's part, and by ``exact`` that of the values' curvature."""
        total = ca.SX.zeros(3, 3)
        for i, (by, curved) in enumerate(self._derivatives(read, node)):
            total += weight[i] * by @ by.T + read(f.EXACT) * s[i] * curved
        return Curvature(total, ca.SX.zeros(3, 3))


def _curved(s: ca.SX, r: ca.SX) -> ca.SX:
    """Return ``sym(r s^T) - (r . s) I``."""
    outer = r @ s.T
    return (outer + outer.T) / 2 - ca.dot(r, s) * ca.SX.eye(3)


class AnyOf(ConeInequality):
    """Values ``1 - M``, one a group of keep-in cones: docs/theory.md (24a).

    M is the mean of power 32 of ``e_i = (1 + s_i . R b_i) / (1 + cos theta_i)``, at most the
    largest of them: with M >= 1 some cone is kept. With ``q_i = e_i / M``, over n members,

        dM/de_i = q_i^31 / n,    d2M/de_i de_j = 31 / M (delta_ij q_i^30 / n - dM/de_i dM/de_j)
    """

    @classmethod
    def places(cls, cones: Sequence[Cone]) -> list[int]:
        """Return the cones of the groups of this size, group by group."""
        names = [name for name, each in groups(cones).items() if len(each) == cls.members]
        return [i for name in names for i, each in enumerate(cones) if each.group == name]

    def numbers_of(self, cones: Sequence[Cone]) -> Array:
        """Map all cones to b and beta of each member: ``e = s . R b - beta``."""
        chosen = [cones[i] for i in self.places(cones)]
        return np.concatenate([np.append(each.axis_B, -1.0) / (1.0 + np.cos(each.half_angle_rad))
                               for each in chosen])

    def _groups(self, read: Read, attitude: ca.SX) -> list[list[tuple[ca.SX, ca.SX, ca.SX]]]:
        """Return (s, r, beta) of the members of each group."""
        pairs, n = self._pairs(read, attitude), self.members
        return [pairs[i:i + n] for i in range(0, len(pairs), n)]

    def values(self, read: Read, node: Node) -> ca.SX:
        """Return v (rows,)."""
        return ca.vertcat(*(1 - _mean(_shares(group)) for group in self._groups(
            read, node.attitude)))

    def change(self, read: Read, new: Node, old: Node, rate_change: ca.SX) -> ca.SX:
        """Return ``v(new) - v(old)`` (rows,)."""
        return self.values(read, new) - self.values(read, old)

    def _derivatives(self, read: Read, node: Node) -> list[tuple[ca.SX, ca.SX]]:
        """Return gradient (3,) and Hessian (3, 3) of each value by a spatial turn."""
        found = []
        for group in self._groups(read, node.attitude):
            shares = _shares(group)
            mean = _mean(shares)
            gradient, hessian = ca.SX.zeros(3), ca.SX.zeros(3, 3)
            for (s, r, _), share in zip(group, shares):
                by, q = ca.cross(r, s), share / mean
                q2 = q * q
                q30 = _sixteenth(q) * _sixteenth(q) / q2
                weight = q30 * q / self.members
                gradient += weight * by
                hessian += weight * _curved(s, r) + 31 / mean * q30 / self.members * by @ by.T
            found.append((-gradient, 31 / mean * gradient @ gradient.T - hessian))
        return found


class AnyOf2(AnyOf):
    """Groups of two."""

    name, members = 'any_of_2', 2


class AnyOf3(AnyOf):
    """Groups of three."""

    name, members = 'any_of_3', 3


class AnyOf4(AnyOf):
    """Groups of four."""

    name, members = 'any_of_4', 4


def _shares(group: Sequence[tuple[ca.SX, ca.SX, ca.SX]]) -> list[ca.SX]:
    """Return e of each member, above zero."""
    return [ca.fmax(ca.dot(s, r) - beta, 1e-3) for s, r, beta in group]


def _sixteenth(x: ca.SX) -> ca.SX:
    """Return x^16."""
    for _ in range(4):
        x = x * x
    return x


def _mean(shares: Sequence[ca.SX]) -> ca.SX:
    """Return the mean of power 32."""
    total = sum((_sixteenth(x) * _sixteenth(x) for x in shares), start=ca.SX(0))
    mean = total / len(shares)
    for _ in range(5):
        mean = ca.sqrt(mean)
    return mean


def direction_phases(kinds: Sequence[ConeInequality]) -> tuple[Phase, ...]:
    """Turn the directions of every node into the axes of the measured target; none without."""
    def expression(read: Read) -> dict[Field, ca.SX]:
        R_ND = ca.reshape(read(f.MEASURED)[9:18], 3, 3).T
        return {key: value for each in kinds for key, value in each.turned(read, R_ND.T).items()}

    return (phase('directions', expression, beyond=1),) if kinds else ()
