# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a plan promises for the next tick, what may be missing of it, and what became of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, Protocol

from manifold_mpc_ros.mpc.solution import SolveStatus

#: Rounding of a value, relative: ten times what the solver calls no increase of the cost.
VALUE_ROUNDING = 1e-10


class ValuedPlan(Protocol):
    """What the monitor reads of one answer; `AttitudeMpcSolution` is such."""

    @property
    def cost(self) -> float:
        """The value V of the plan."""

    @property
    def promised_cost(self) -> float:
        """V - L of the plan."""

    @property
    def terminal_ratio(self) -> float:
        """``xi^T P xi / c`` of the measured state."""

    @property
    def status(self) -> SolveStatus:
        """How the solve ended."""


class Allowance(NamedTuple):
    """What a promise about a target that moves allows for, in units of the value function.

    ``excess`` is added to it; ``model_error`` is F of the model's own error in a step;
    ``why_none`` says why there is no promise, empty where there is one.
    """

    excess: float = 0.0
    model_error: float = 0.0
    why_none: str = ''


class Decrease(str, Enum):
    """What became of the promise that the last tick made."""

    NONE = 'none'
    KEPT = 'kept'
    BROKEN = 'broken'


@dataclass(frozen=True)
class Tolerance:
    """What may be missing from the decrease before a promise counts as broken.

    A value V kept its promise W = V_last - L when

        V <= (sqrt(W) + sqrt(floor))^2 + (decrease + |T - h| / h + 2 D / h) L,

    T the time since and D the delay of the torque. ``decrease`` is the part of L that may be
    missing: relaxed dynamic programming, V <= V_last - (1 - decrease) L, which still proves
    convergence. A tick that comes early by a part of the step has that part of L missing; from
    rest, a torque that is late by a part of it lacks that part of the rate and twice that of the
    angle. ``floor`` is the value of a state error e that is nobody's
    fault: near the equilibrium V is half a squared norm, so e raises sqrt(V) by sqrt(F(e)) at
    most. ``floor`` is above zero.
    """

    decrease: float
    floor: float

    def slack(self, promised: float, last_decrease: float, off: float, error: float = 0.0
              ) -> float:
        """Return how far a value may be above W; ``off`` is ``|T - h| / h + 2 D / h``.

        ``error`` is the value of a further error of the state: roots of values add.
        """
        part = self.decrease + off
        floor = (math.sqrt(self.floor) + math.sqrt(error)) ** 2 if error else self.floor
        return (2.0 * math.sqrt(max(promised, 0.0) * floor) + floor
                + VALUE_ROUNDING * abs(promised) + part * last_decrease)


@dataclass(frozen=True)
class DecreaseCounters:
    """What has happened since the activation; none of them ever falls.

    ``checked`` promises came due with nothing in between that ended them; ``largest_excess`` is
    that of the broken ones, relative to the promised decrease L.
    """

    made: int = 0
    checked: int = 0
    broken: int = 0
    outside_domain: int = 0
    largest_excess: float = 0.0


@dataclass(frozen=True)
class DecreaseRecord:
    """One tick: the value, what the last tick promised for it, and what became of that.

    ``value``, ``promised``, their difference ``excess`` and ``relative_excess = excess / L`` (the
    part of the promised decrease that is missing; 1 means that V did not fall) are NaN where
    there is no plan or no promise. ``in_domain`` is None when it is not known (no terminal set
    is asked for). ``reason`` says why there is no promise, or how it was broken; ``warning``
    repeats that for a few ticks, and ``burst`` is true at the first of them.
    """

    verdict: Decrease
    reason: str
    value: float
    promised: float
    excess: float
    relative_excess: float
    in_domain: bool | None
    in_terminal_set: bool
    counters: DecreaseCounters
    warning: str = ''
    burst: bool = False
