# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Deterministic global search: the best of a fixed list of starts, ties broken by rule.

Starts: the short way, the long way, and (with a torque limit) all eight octants of first
torque. A planar slew is a stationary point that is up to 37 % worse than the best known plan
(test_global.py), and no descent method leaves it; the octants do.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.local_solver import LocalSolver, Plan, Progress, StateReport
from manifold_mpc_ros.terminal.manifold import tangent_basis

# Barrier parameter of a cold start (dimensionless, against a cost of order 10).
COLD_BARRIER = 1.0
# Passes of a start at most. Every start but the first ends after HOPELESS_PASSES when its cost is
# still above HOPELESS times the best: winners are near it by then (benchmarks/bodies.py).
MOST_PASSES = 200
HOPELESS_PASSES = 25
HOPELESS = 2.0
# A leaning start holds its octant for this part of the bang-bang slew, and no fewer steps.
LEAN_PART = 0.25
LEAN_STEPS = 5
# The long way round can win when the angle left to turn and to stop is above this [rad].
LONG_WAY_RAD = np.radians(130.0)
# A pointing turn leans above this.
POINTING_RAD = np.radians(100.0)
# Any other leans above this when its slew is all but one torque component, or takes many steps.
LEAN_RAD = np.radians(80.0)
ALONE = 0.1
MANY_STEPS = 25.0
# Plans whose costs agree to this are equal; the rule then decides.
TIE = 1e-7


class Start(NamedTuple):
    """One start of the search; ``aims`` (N + 1, 4) lead the slew round cones (:mod:`.ways`)."""

    lean: tuple[float, float, float]
    long_way: bool
    aims: Array | None = None

    @property
    def leans(self) -> bool:
        """Whether the start leaves the plane of the slew."""
        return any(self.lean)


_SIGNS = (1.0, -1.0)
_OCTANTS = tuple(Start((x, y, z), False)
                 for x, y, z in itertools.product(_SIGNS, _SIGNS, _SIGNS))
_SIDES = (Start((0.0, 0.0, 0.0), False), Start((0.0, 0.0, 0.0), True))


def starts(config: AttitudeMpcConfig) -> tuple[Start, ...]:
    """Return the starts in their fixed order.

    Pointing has no long way round; without torque limits it leans to either side along a basis of
    the plane across the axis.
    """
    limited = config.max_torque_n_m is not None
    if config.target == 'attitude':
        return _SIDES + _OCTANTS if limited else _SIDES
    if limited:
        return _SIDES[:1] + _OCTANTS
    first, second = tangent_basis(config.pointing_axis_B).T
    return _SIDES[:1] + tuple(Start((float(x), float(y), float(z)), False)
                              for x, y, z in (first, -first, second, -second))


def slew_steps(config: AttitudeMpcConfig, state: StateReport) -> float:
    """Return how many steps a bang-bang slew takes, by torque limits alone: ``2 sqrt(angle / a)``.

    ``a`` is the acceleration about the axis of the turn; 0 without torque limits.
    """
    if config.max_torque_n_m is None:
        return 0.0
    quickest = float(np.max(config.max_torque_n_m / np.diag(config.inertia_kg_m2)))
    turn = state.angle_rad + state.braking_rad
    return 2 * math.sqrt(turn * state.weakness / quickest) / config.step_s


def is_due(start: Start, state: StateReport, steps: float, pointing: bool) -> bool:
    """Return whether a start can lead to the best plan from a state.

    The short way always can; the long way only when enough is left to turn. Out of the plane it
    is better where the slew's own torque is nearly a single component, so that the other two can
    help, the more so the weaker that component is against what they can do; anywhere beside the
    half turn for a body that is much quicker about another axis; and in any long turn whose slew
    is all but one component, or takes so many ``steps`` that the plan can shape it. Found by
    comparison with all starts on random and half turns (docs/solver.md), not proved.
    """
    turn = state.angle_rad + state.braking_rad
    if not start.leans:
        return not start.long_way or turn > LONG_WAY_RAD
    if pointing:
        return turn > POINTING_RAD
    beside = np.pi - turn
    alone = state.second_torque < 0.25 and beside < 0.05 + 0.17 * (state.weakness - 1.0)
    helped = turn > LEAN_RAD and (
        state.second_torque < ALONE or steps > MANY_STEPS)
    return alone or helped or (beside < 0.035 and state.weakness > 2.0)


def lean_steps(horizon: int, steps: float) -> int:
    """Return for how many steps a leaning start of a slew of ``steps`` holds its octant."""
    return max(1, min(max(LEAN_STEPS, round(LEAN_PART * steps)), horizon // 2))


def begin(solver: LocalSolver, start: Start, steps: float) -> None:
    """Begin a cold start of a slew of so many steps."""
    if start.aims is not None:
        solver.begin_way(COLD_BARRIER, start.aims)
        return
    if start.long_way:
        solver.flip()
    solver.begin_slew(COLD_BARRIER, np.array(start.lean), lean_steps(solver.horizon, steps))
    if start.long_way:
        solver.flip()


def global_search(solver: LocalSolver, field: Sequence[Start], steps: float,
                  pool: Sequence[Plan], deadline_s: float = math.inf, *, patient: bool = False,
                  known: Plan | None = None
                  ) -> tuple[Plan | None, int]:
    """Return the best plan from the solver's state, and the passes it took in all.

    ``steps`` is the length of the slew; ``pool`` holds at least one plan per start as memory.
    None when no start gave a plan. After the deadline no further start begins. ``patient``: no
    start ends for its cost. A plan that is ``known`` takes part.
    """
    passes, finalists = 0, [] if known is None else [known]
    for start, slot in zip(field, pool):
        if finalists and time.monotonic() > deadline_s:
            break
        begin(solver, start, steps)
        progress = _run(solver, [] if patient else finalists, deadline_s)
        passes += progress.passes
        if progress.passes > 0 and math.isfinite(progress.cost):
            solver.keep(slot)
            finalists.append(slot)
    return (choose(finalists) if finalists else None), passes


def _run(solver: LocalSolver, finalists: list[Plan], deadline_s: float) -> Progress:
    """Run a start to its end, or until it cannot win against the plans found before."""
    if not finalists:
        solver.iterate(MOST_PASSES, deadline_s)
        return solver.progress
    solver.iterate(HOPELESS_PASSES, deadline_s)
    best = min(plan.progress.cost for plan in finalists)
    if solver.progress.cost <= HOPELESS * best:
        solver.iterate(MOST_PASSES, deadline_s)
    return solver.progress


def choose(finalists: list[Plan]) -> Plan:
    """Return the cheapest plan; among equals the one with the smallest first torque.

    Smallest in lexicographic order of the torques rounded to 1e-6: at 180 degrees both sides
    cost the same, and this picks the same one whatever the noise in the attitude's sign, the
    one that turns back along the positive axis as ``so3.log`` has it.
    """
    best = min(plan.progress.cost for plan in finalists)
    equals = [plan for plan in finalists
              if plan.progress.cost <= best + TIE * max(abs(best), 1.0)]
    return equals[0] if len(equals) == 1 else min(
        equals, key=lambda plan: _rank(plan.torques[0]))


def _rank(torque: Array) -> tuple[float, ...]:
    return tuple(np.round(torque / max(float(np.abs(torque).max()), 1e-12), 6).tolist())
