# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What an inequality of the optimal control problem is: formulas from which the phases derive.

An inequality has ``rows`` values v <= 0, dimensionless and relative to the limit (-1 far inside,
0 on it). Each value is kept by a slack y and a multiplier s: ``v + y = 0`` hard, or ``v + y = t``
elastic, with t >= 0 at cost ``penalty * t`` (exact penalty). A kind says how its values and their
derivatives follow from the torque, or from the node; the initial guess, the quadratic model, the
line search, merit and report of a pass derive what they need (:mod:`.inequalities` has the
table). Formulas take ``read`` for the numbers of the limit (``read(self.data)``).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, NamedTuple

import casadi as ca
import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.phase import Field, Memory, Read
from manifold_mpc_ros.mpc.scaling import Scaling
from manifold_mpc_ros.mpc.stages import barrier
from manifold_mpc_ros.mpc.stages import step_derivatives as form
from manifold_mpc_ros.mpc.stages.barrier import Bounds

# A limit of "none" on one axis when the other axes have one: far outside anything reachable.
_UNLIMITED = 1e6
# Multipliers of a shifted plan stay above the central ones divided by this.
_WARM_SPREAD = 10.0


class Inequality(ABC):
    """An inequality of a problem, with the fields that its values need in the solver's memory."""

    name: ClassVar[str]
    #: Cost of one unit of violation, in units of tr(Qg)/3; None: never violated.
    penalty: ClassVar[float | None] = None

    def __init__(self, rows: int, graded: bool = False) -> None:
        """Make the fields for so many values."""
        self.rows, self._graded = rows, graded
        self.slack = Field(f'{self.name}_slack', rows, Memory.TRAJECTORY)
        self.multiplier = Field(f'{self.name}_multiplier', rows, Memory.TRAJECTORY)
        self.elastic = Field(f'{self.name}_elastic', rows, Memory.TRAJECTORY)
        self.data = Field(f'{self.name}_data', self.data_size, Memory.GLOBAL)
        #: Sum of the elastic parts, and largest positive value, over the nodes of a plan.
        self.excess = Field(f'{self.name}_excess', 2, Memory.GLOBAL)

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields that it adds to the solver's memory."""
        hard = (self.slack, self.multiplier, self.data)
        return hard if self.penalty is None else (*hard, self.elastic, self.excess)

    @property
    @abstractmethod
    def data_size(self) -> int:
        """How many numbers the limit consists of."""

    @classmethod
    @abstractmethod
    def rows_in(cls, config: AttitudeMpcConfig) -> int:
        """Return how many values a configuration has, 0 where it has no such limit."""

    @abstractmethod
    def numbers(self, config: AttitudeMpcConfig, unit: Scaling) -> Array:
        """Return the dimensionless numbers of the limit, in the order of ``data``."""


class TorqueInequality(Inequality):
    """A hard limit on the torque u (3,) of a stage."""

    @abstractmethod
    def values(self, read: Read, u: ca.SX) -> ca.SX:
        """Return v (rows,)."""

    @abstractmethod
    def slope(self, read: Read, du: ca.SX) -> ca.SX:
        """Return ``dv/du du`` (rows,)."""

    @abstractmethod
    def gradient(self, read: Read, pull: ca.SX) -> ca.SX:
        """Return ``(dv/du)^T pull`` (3,)."""

    @abstractmethod
    def hessian(self, read: Read, weight: ca.SX) -> ca.SX:
        """Return the diagonal (3,) of ``(dv/du)^T diag(weight) dv/du``."""

    @abstractmethod
    def box(self, read: Read) -> ca.SX:
        """Return the half widths (3,) of a box of torques that it allows."""

    @abstractmethod
    def inside(self, read: Read, u: ca.SX, margin: ca.SX) -> ca.SX:
        """Return the torque moved inside by relative margins (rows,)."""

    def bounds(self, read: Read) -> Bounds:
        """Return its terms in the Newton system of a stage."""
        return barrier.hard_bounds(read(self.slack), read(self.multiplier), read(f.BARRIER))

    def begin(self, read: Read, u: ca.SX, *, warm: bool) -> dict[Field, ca.SX]:
        """Return slack and multiplier of a torque strictly inside; warm: not far below the old."""
        mu, y = read(f.BARRIER), -self.values(read, u)
        s = mu / y
        if warm:
            kept = ca.fmax(form.one_period_on(self._graded, read, self.multiplier),
                           mu / y / _WARM_SPREAD)
            s = ca.if_else(read(f.INNER, 1) != 0, kept, s)
        return {self.slack: y, self.multiplier: s}

    def advance(self, read: Read, u: ca.SX) -> dict[Field, ca.SX]:
        """Return slack and multiplier after a trial step to the torque u."""
        alpha, y = read(f.LENGTH), -self.values(read, u)
        predicted = self.slope(read, alpha * read(f.TORQUE_CHANGE))
        return {self.slack: y, self.multiplier: barrier.advance_multiplier(
            self.bounds(read), predicted, alpha, read(f.BARRIER), y)}


class Node(NamedTuple):
    """What a node's limits depend on: quaternion of R_DB, body rate (3,), fields of neighbours."""

    attitude: ca.SX
    rate: ca.SX
    get: Callable[[Field, int], ca.SX]


class Variation(NamedTuple):
    """A change of a node, or the transpose of one: spatial turn (3,), body rate (3,)."""

    turn: ca.SX
    rate: ca.SX


class Curvature(NamedTuple):
    """Blocks (3, 3) of a Hessian by turn and by rate; the mixed block is zero."""

    turn: ca.SX
    rate: ca.SX


class LimitTerms(NamedTuple):
    """Terms of a node's limits, by its spatial turn and its momentum, and by both where any is."""

    pull: Variation
    force: Variation
    hessian: Curvature
    products: ca.SX
    mixed: ca.SX | None = None


class NodeInequality(Inequality):
    """An elastic limit on the state of a node k >= 1, and of the one before it."""

    penalty: ClassVar[float]
    #: Whether it depends on the attitude, which the model then carries along.
    of_attitude: ClassVar[bool] = False
    #: Whether full steps leave it by their square, so that the barrier has to fall slowly.
    curved: ClassVar[bool] = False

    @abstractmethod
    def values(self, read: Read, node: Node) -> ca.SX:
        """Return v (rows,)."""

    @abstractmethod
    def change(self, read: Read, new: Node, old: Node, rate_change: ca.SX) -> ca.SX:
        """Return ``v(new) - v(old)`` (rows,), accurate for small steps: omega has moved so far."""

    @abstractmethod
    def slope(self, read: Read, node: Node, step: Variation) -> ca.SX:
        """Return ``dv/dx step`` (rows,)."""

    def bounds(self, read: Read, shift: int = 0) -> Bounds:
        """Return its terms in the Newton system of node k + shift."""
        y, t, s = (read(each, shift) for each in (self.slack, self.elastic, self.multiplier))
        return barrier.elastic_bounds(y, t, s, read(f.BARRIER), self.penalty)

    def products(self, read: Read, bounds: Bounds) -> tuple[ca.SX, ca.SX]:
        """Return the complementarity products of a node, (rows,) each."""
        s = bounds.multiplier
        return bounds.slack * s, (self.penalty - s) * read(self.elastic)

    def begin(self, read: Read, node: Node, *, warm: bool) -> dict[Field, ca.SX]:
        """Return slack, elastic part and multiplier of a node; warm: not far below the old."""
        mu = read(f.BARRIER)
        y, t, s = barrier.elastic_start(self.values(read, node), mu, self.penalty)
        if warm:
            kept = ca.fmin(ca.fmax(form.one_period_on(self._graded, read, self.multiplier),
                                   mu / y / _WARM_SPREAD), barrier.LARGEST_START_MULTIPLIER)
            s = ca.if_else(read(f.INNER) != 0, kept, s)
        return {self.slack: y, self.elastic: t, self.multiplier: s}

    def advance(self, read: Read, new: Node, old: Node, rate_change: ca.SX, step: Variation
                ) -> dict[Field, ca.SX]:
        """Return slack, elastic part and multiplier after a trial whose linear model is a step."""
        y, t, s = barrier.advance_elastic(
            self.bounds(read), self.change(read, new, old, rate_change),
            self.slope(read, old, step), read(self.elastic), read(f.LENGTH), read(f.BARRIER),
            self.penalty)
        return {self.slack: y, self.elastic: t, self.multiplier: s}


class LocalInequality(NodeInequality):
    """One whose derivatives are by the node itself, attitude and rate apart."""

    @abstractmethod
    def gradient(self, read: Read, node: Node, pull: ca.SX) -> Variation:
        """Return ``(dv/dx)^T pull``."""

    @abstractmethod
    def hessian(self, read: Read, node: Node, weight: ca.SX, s: ca.SX) -> Curvature:
        """Return ``(dv/dx)^T diag(weight) dv/dx + sum_i s_i d2v_i/dx2``."""


class RateInequality(LocalInequality):
    """A limit on the body rate alone; the slew of an initial guess keeps it too."""

    penalty = 1e4

    @abstractmethod
    def largest_rate(self, read: Read, axis: ca.SX) -> ca.SX:
        """Return a rate about a unit axis (3,) that it allows."""

    def rate_about(self, read: Read, axis: ca.SX) -> ca.SX:
        """Return the largest rate about a unit axis (3,) that it allows."""
        return self.largest_rate(read, axis)

    @abstractmethod
    def box(self, read: Read) -> ca.SX:
        """Return the half widths (3,) of a box of rates that it allows."""


def dimensionless_limits(limits: Array | None, unit: float) -> Array:
    """Return dimensionless limits (3,), a far bound on an axis that has none."""
    assert limits is not None
    return np.minimum(np.asarray(limits) / unit, _UNLIMITED)
