# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Inequalities by a primal-dual interior point: models, steps and starts of slacks and duals.

Every inequality ``value <= t`` keeps ``value + y = t`` exactly, with slack y > 0 and multiplier
s > 0. Hard ones have t = 0; elastic ones pay ``penalty * t`` for t > 0 (exact penalty), so that a
strictly interior start always exists.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import NamedTuple

import casadi as ca

from manifold_mpc_ros.mpc.program.options import BOUNDARY

# Multipliers stay within this factor of mu / slack (as in primal-dual methods at large).
MULTIPLIER_SPREAD = 1e8
# Multipliers of elastic inequalities start at most here (dimensionless cost per relative unit).
LARGEST_START_MULTIPLIER = 10.0


class Bounds(NamedTuple):
    """The terms of inequalities in the Newton system.

    ``weight`` is W of ``ds = W (d value + offset)``: it adds ``C^T W C`` to the Hessian and
    ``C^T pull``, ``pull = s + W offset``, to the gradient.
    """

    slack: ca.SX
    multiplier: ca.SX
    weight: ca.SX
    offset: ca.SX

    @property
    def pull(self) -> ca.SX:
        """Return the multiplier estimate that enters the gradient of the barrier model."""
        return self.multiplier + self.weight * self.offset


def hard_bounds(y: ca.SX, s: ca.SX, mu: ca.SX) -> Bounds:
    """Return the terms of ``value + y = 0`` kept strictly: s y -> mu."""
    return Bounds(y, s, s / y, mu / s - y)


def elastic_bounds(y: ca.SX, t: ca.SX, s: ca.SX, mu: ca.SX, penalty: float) -> Bounds:
    """Return the terms of ``value + y = t``, t >= 0 at cost p t, p the penalty.

    Newton's steps of ``s y = mu`` and ``(p - s) t = mu`` with dy and dt eliminated:

        W = s (p - s) / (y (p - s) + t s),      offset = mu / s - y + t - mu / (p - s)
    """
    gap = penalty - s
    weight = s * gap / (y * gap + t * s)
    return Bounds(y, s, weight, mu / s - y + t - mu / gap)


def box(value: ca.SX, limit: ca.SX) -> ca.SX:
    """Return the six values of ``|value_i| / limit_i - 1 <= 0``, upper ones first."""
    ratio = value / limit
    return ca.vertcat(ratio - 1, -ratio - 1)


def box_transpose(pull: ca.SX, limit: ca.SX) -> ca.SX:
    """Return ``C^T pull`` for :func:`box`."""
    return (pull[0:3] - pull[3:6]) / limit


def box_hessian(weight: ca.SX, limit: ca.SX) -> ca.SX:
    """Return the diagonal (3,) of ``C^T diag(weight) C`` for :func:`box`."""
    return (weight[0:3] + weight[3:6]) / (limit * limit)


def where(flag: ca.SX, value: ca.SX) -> ca.SX:
    """Return the value where the flag is not zero, else exactly 0 (whatever the value is)."""
    return ca.if_else(flag != 0, value, ca.SX.zeros(*value.shape))


def largest(*values: ca.SX) -> ca.SX:
    """Return the largest absolute entry over vectors, 0 when all are empty."""
    return most(ca.fabs(ca.vertcat(*values))) if values else ca.SX(0)


def most(values: ca.SX) -> ca.SX:
    """Return the largest entry."""
    return join(ca.fmax, [values[i] for i in range(values.numel())])


def least(values: ca.SX) -> ca.SX:
    """Return the smallest entry."""
    return join(ca.fmin, [values[i] for i in range(values.numel())])


def join(pair: Callable[[ca.SX, ca.SX], ca.SX], entries: list[ca.SX]) -> ca.SX:
    """Join entries pairwise, which leaves short chains of operations."""
    while len(entries) > 1:
        pairs = [pair(a, b) for a, b in zip(entries[::2], entries[1::2])]
        entries = pairs + entries[2 * len(pairs):]
    return entries[0]


def product(values: ca.SX) -> ca.SX:
    """Return the product of the entries."""
    return join(operator.mul, [values[i] for i in range(values.numel())])


def advance_multiplier(bounds: Bounds, change: ca.SX, alpha: ca.SX, mu: ca.SX,
                       slack_new: ca.SX) -> ca.SX:
    """Return the new multipliers after values that the linear model moves by ``change``.

    ``s + W (change + alpha offset)``, no less than ``(1 - BOUNDARY) s``, and within a factor of
    MULTIPLIER_SPREAD of the central ``mu / y_new``.
    """
    s = bounds.multiplier
    s_new = s + bounds.weight * (change + alpha * bounds.offset)
    s_new = ca.fmax(s_new, (1 - BOUNDARY) * s)
    central = mu / slack_new
    return ca.fmin(ca.fmax(s_new, central / MULTIPLIER_SPREAD), central * MULTIPLIER_SPREAD)


def advance_elastic(bounds: Bounds, change: ca.SX, predicted: ca.SX, t: ca.SX, alpha: ca.SX,
                    mu: ca.SX, penalty: float) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return new (y, t, s) of elastic inequalities; y and t shrink by at most BOUNDARY.

    ``change`` is what the values did, ``predicted`` what the linear model says; multipliers follow
    the latter, which stays accurate when the step is tiny. y and t are moved by differences and
    never recomputed from the values, for the same reason.
    """
    s, gap, keep = bounds.multiplier, penalty - bounds.multiplier, 1 - BOUNDARY
    d_s = bounds.weight * (predicted + alpha * bounds.offset)
    d_t = alpha * (mu / gap - t) + t / gap * d_s
    d_t = ca.fmax(ca.fmax(d_t, (keep - 1) * t), change + (keep - 1) * bounds.slack)
    y_new = bounds.slack + d_t - change
    s_new = advance_multiplier(bounds, predicted, alpha, mu, y_new)
    return y_new, t + d_t, ca.fmin(s_new, s + BOUNDARY * gap)


def elastic_start(value: ca.SX, mu: ca.SX, penalty: float) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return (y, t, s): y = t - value and t on the central path of mu, s capped.

    On a bound the central multiplier is half the penalty, far above any real one, and the first
    steps would creep; the cap lets them move inside.
    """
    scaled = penalty * value
    t = (scaled + 2 * mu + ca.sqrt(scaled * scaled + 4 * mu * mu)) / (2 * penalty)
    y = t - value
    return y, t, ca.fmin(mu / y, LARGEST_START_MULTIPLIER)
