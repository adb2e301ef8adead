# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Momentum and motor torque of reaction wheels, elastic: functions of nodes, docs/theory.md (28).

Body and wheels keep their inertial momentum H, so the wheels of a node store in body axes

    b_k = W h_w = R_k^T H - Pi_k,    and their motors give    W u = b_{k+1} - b_k

over a step (dimensionless, h = 1): no state is added, and gyroscopic torque is in it. A spatial
turn x of the body moves b by ``T x``, ``T = R^T H^x``; a change of its momentum moves b by minus
that. With x_{k+1} = (theta + v, E v - sigma) the linear model of a motor's torque is

    d(b_{k+1} - b_k) = (T_{k+1} - E) v + (T_{k+1} - T_k) theta + 2 sigma

and multipliers nu (momentum) and lambda (torque) enter a node's Lagrangian as ``m_k . b_k`` with
``m_k = nu_k + lambda_k - lambda_{k+1}``, like an attitude weight ``-m_k H^T``.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.lie.symbolic import hat, rotation_from_quaternion
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.phase import Field, Memory, Read
from manifold_mpc_ros.mpc.scaling import Scaling
from manifold_mpc_ros.mpc.stages.barrier import product, where
from manifold_mpc_ros.mpc.stages.inequality import (
    Curvature,
    LimitTerms,
    Node,
    NodeInequality,
    Variation,
)
from manifold_mpc_ros.mpc.stages.step_derivatives import left_hessian, symmetric_from, upper_part

#: Inertial momentum of body and wheels in the target's axes.
TOTAL = Field('total_momentum', 3, Memory.GLOBAL)
#: Blocks of a stage's Hessian that only these limits have: (theta, sigma) and (v, theta).
MIXED_HESSIAN = Field('mixed_hessian', 9, Memory.MODEL)
CONTROL_TURN = Field('control_turn', 9, Memory.MODEL)
#: Hessian, pull and force of ``b_{k+1} - b_k``.
STEP_WEIGHT = Field('step_weight', 6, Memory.MODEL)
STEP_PULL, STEP_FORCE = Field('step_pull', 3, Memory.MODEL), Field('step_force', 3, Memory.MODEL)
# Of so many values slacks and elastic parts are multiplied before the logarithm is taken.
_PART = 12


def _stored(read: Read, node: Node, shift: int) -> ca.SX:
    """Return b (3,) of node k + shift."""
    g = rotation_from_quaternion(node.get(f.ATTITUDE, shift))
    return g.T @ read(TOTAL) - node.get(f.MOMENTUM, shift)


def by_turn(read: Read, shift: int = 0) -> ca.SX:
    """Return T (3, 3) of node k + shift."""
    return rotation_from_quaternion(read(f.ATTITUDE, shift)).T @ hat(read(TOTAL))


class StoredMomentum(NodeInequality):
    """``|a_f . (b - o)| <= 1`` for each facet f of the momenta that the wheels can store.

    a_f is its normal over its bound, o what wheels store that are not available: it turns with the
    body. Values ``+-a_f . (b - o) - 1``, upper ones first; data: A (m, 3), o (3).
    """

    name = 'wheel_momentum'
    penalty = 1e4
    of_attitude = True

    def __init__(self, rows: int, graded: bool = False) -> None:
        """Make the fields; products of so many small numbers have to be in parts."""
        super().__init__(rows, graded)
        self.parts = Field(f'{self.name}_parts', -(-rows // _PART), Memory.MODEL)

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields that it adds to the solver's memory."""
        return (*super().fields, self.parts, TOTAL, MIXED_HESSIAN, CONTROL_TURN, STEP_WEIGHT,
                STEP_PULL, STEP_FORCE)

    @property
    def data_size(self) -> int:
        """Three numbers a pair of facets, and the offset."""
        return 3 * self.rows // 2 + 3

    @classmethod
    def rows_in(cls, config: AttitudeMpcConfig) -> int:
        """Return the number of facets, 0 without wheels."""
        return 0 if config.wheels is None else 2 * len(config.wheels.normals)

    def numbers(self, config: AttitudeMpcConfig, unit: Scaling) -> Array:
        """Return zeros: every state brings its own numbers (backends/wheels.c)."""
        return np.zeros(self.data_size)

    def products_of(self, slack: ca.SX, elastic: ca.SX) -> ca.SX:
        """Return the products of slacks and elastic parts, part by part."""
        both = ca.horzcat(slack, elastic)
        return ca.vertcat(*(product(ca.vec(both[i:min(i + _PART, self.rows), :]))
                            for i in range(0, self.rows, _PART)))

    def facets(self, read: Read) -> ca.SX:
        """Return A (m, 3)."""
        return ca.reshape(read(self.data)[:3 * self.rows // 2], self.rows // 2, 3)

    def _both(self, read: Read, output: ca.SX) -> ca.SX:
        """Return ``+-A output`` (rows,)."""
        ratio = self.facets(read) @ output
        return ca.vertcat(ratio, -ratio)

    def output(self, read: Read, node: Node) -> ca.SX:
        """Return what is limited (3,): ``b - o``."""
        return _stored(read, node, 0) - self._offset(read)

    def _offset(self, read: Read) -> ca.SX:
        """Return o (3,)."""
        first = 3 * self.rows // 2
        return read(self.data)[first:first + 3]

    def values(self, read: Read, node: Node) -> ca.SX:
        """Return v (rows,)."""
        return self._both(read, self.output(read, node)) - 1

    def change(self, read: Read, new: Node, old: Node, rate_change: ca.SX) -> ca.SX:
        """Return ``v(new) - v(old)`` (rows,)."""
        return self._both(read, self.output(read, new) - self.output(read, old))

    def slope(self, read: Read, node: Node, step: Variation) -> ca.SX:
        """Return ``dv/dx step`` (rows,)."""
        return self._both(read, read(f.LENGTH) * self._moved(read))

    def _moved(self, read: Read, shift: int = 0) -> ca.SX:
        """Return by how much the linear roll-out moves b of node k + shift."""
        return by_turn(read, shift) @ read(f.TURN, shift) - read(f.MOVE, shift)

    def onto(self, read: Read, pull: ca.SX) -> ca.SX:
        """Return ``(dv/db)^T pull`` (3,)."""
        half = self.rows // 2
        return self.facets(read).T @ (pull[:half] - pull[half:])

    def square(self, read: Read, weight: ca.SX) -> ca.SX:
        """Return ``(dv/db)^T diag(weight) dv/db`` (3, 3)."""
        half, facets = self.rows // 2, self.facets(read)
        return facets.T @ ca.diag(weight[:half] + weight[half:]) @ facets


class MotorTorque(StoredMomentum):
    """``|a_f . (b_k - b_{k-1} - o)| <= 1`` for each facet f of what the motors give together.

    -o is the torque that acts from outside, a_f the normal of a facet over its bound. Data: A
    (m, 3), o (3), and half widths (3) of a box of body torques inside, about zero.
    """

    name = 'motor_torque'

    @property
    def data_size(self) -> int:
        """Three numbers a pair of facets, the offset, the box."""
        return super().data_size + 3

    def box(self, read: Read) -> ca.SX:
        """Return the half widths (3,)."""
        return read(self.data)[-3:]

    def output(self, read: Read, node: Node) -> ca.SX:
        """Return what is limited (3,): ``b_k - b_{k-1} - o``."""
        return _stored(read, node, 0) - _stored(read, node, -1) - self._offset(read)

    def slope(self, read: Read, node: Node, step: Variation) -> ca.SX:
        """Return ``dv/dx step`` (rows,)."""
        return self._both(read, read(f.LENGTH) * (self._moved(read) - self._moved(read, -1)))

    def reach(self, read: Read) -> ca.SX:
        """Return how far the linear roll-out of step k goes towards its bounds (2 rows,).

        ``-dy / y`` and ``-dt / t`` of slacks and elastic parts: motors' torques jump.
        """
        after, t = self.bounds(read, 1), read(self.elastic, 1)
        moved = self._both(read, self._moved(read, 1) - self._moved(read))
        mu, gap = read(f.BARRIER), self.penalty - after.multiplier
        change = after.weight * (moved + after.offset)
        return 1 + ca.vertcat((change - mu / after.slack) / after.multiplier,
                              -mu / (gap * t) - change / gap)


def step_terms(limits: Sequence[StoredMomentum], read: Read) -> dict[Field, ca.SX]:
    """Return Hessian, pull and force of ``b_{k+1} - b_k`` for the motors' step from node k."""
    (each,) = (limit for limit in limits if isinstance(limit, MotorTorque))
    after = each.bounds(read, 1)
    return {STEP_WEIGHT: upper_part(each.square(read, after.weight)),
            STEP_PULL: each.onto(read, after.pull),
            STEP_FORCE: each.onto(read, after.multiplier)}


def with_wheels(terms: LimitTerms, limits: Sequence[StoredMomentum], read: Read) -> LimitTerms:
    """Add the terms of node k, and those of (theta, sigma) in the motors' step from it.

    Those of b_k with the gradients m_k by which it enters, once those of the steps are there.
    """
    (each,) = (limit for limit in limits if not isinstance(limit, MotorTorque))
    inner, here, turned = read(f.INNER), each.bounds(read), by_turn(read)
    pull = each.onto(read, here.pull) + read(STEP_PULL, -1) - where(inner, read(STEP_PULL))
    force = (each.onto(read, here.multiplier) + read(STEP_FORCE, -1)
             - where(inner, read(STEP_FORCE)))
    weight, step = each.square(read, here.weight), symmetric_from(where(inner, read(STEP_WEIGHT)))
    more, weighted = where(inner, by_turn(read, 1) - turned), turned.T @ weight
    curved = -rotation_from_quaternion(read(f.ATTITUDE)) @ force @ read(TOTAL).T
    return LimitTerms(
        Variation(terms.pull.turn + turned.T @ pull, terms.pull.rate - pull),
        Variation(terms.force.turn + turned.T @ force, terms.force.rate - force),
        Curvature(
            terms.hessian.turn + weighted @ turned + more.T @ step @ more
            + read(f.EXACT) * left_hessian(curved),
            terms.hessian.rate + weight + 4 * step),
        terms.products, 2 * more.T @ step - weighted)
