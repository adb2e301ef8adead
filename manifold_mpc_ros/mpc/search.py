# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Deterministic global search: the best of a fixed list of starts, ties broken by rule.

Starts: the short way, the long way, and (with a torque limit) all eight octants of first
torque. A planar slew is a stationary point that is up to 37 % worse than the best known plan
(test_global.py), and no descent method leaves it; the octants do.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from manifold_mpc_ros.mpc import sqp
from manifold_mpc_ros.mpc.engine import Engine, Trajectory
from manifold_mpc_ros.mpc.scaling import Array
from manifold_mpc_ros.mpc.structure import Structure

# Barrier parameter of a cold start (dimensionless, against a cost of order 10).
COLD_BARRIER = 1.0
# Passes of each start at most. None is dropped early: after a dozen passes the winner can still
# cost three times what another start does (test_global.py).
MOST_PASSES = 200
# Plans whose costs agree to this are equal; the rule then decides.
TIE = 1e-7
# KKT residual at which a start that can make no more progress counts as converged.
ACCEPTABLE_RESIDUAL = 1e-6


class Start(NamedTuple):
    """One start of the search."""

    lean: tuple[float, float, float]
    long_way: bool


_SIGNS = (1.0, -1.0)
_OCTANTS = tuple(Start((x, y, z), False)
                 for x, y, z in itertools.product(_SIGNS, _SIGNS, _SIGNS))
_SIDES = (Start((0.0, 0.0, 0.0), False), Start((0.0, 0.0, 0.0), True))


def starts(structure: Structure, across: Array) -> tuple[Start, ...]:
    """Return the starts in their fixed order.

    Pointing has no long way round; without torque limits it leans to either side along both
    columns of ``across`` (3, 2), a basis of the plane across the axis.
    """
    if not structure.pointing:
        return _SIDES + _OCTANTS if structure.torque_box else _SIDES
    if structure.torque_box:
        return _SIDES[:1] + _OCTANTS
    first, second = across.T
    return _SIDES[:1] + tuple(Start((float(x), float(y), float(z)), False)
                              for x, y, z in (first, -first, second, -second))


def lean_steps(horizon: int) -> int:
    """Return for how many steps a leaning start holds its octant."""
    return max(1, min(3, horizon // 3))


def residual(trajectory: Trajectory) -> float:
    """Return the KKT residual (dimensionless) of a trajectory."""
    progress = trajectory.progress
    return max(progress.stationarity, progress.complementarity)


def is_converged(trajectory: Trajectory) -> bool:
    """Return whether a trajectory satisfies the optimality conditions."""
    flag = trajectory.progress.flag
    return flag == sqp.CONVERGED or (
        flag == sqp.STALLED and residual(trajectory) < ACCEPTABLE_RESIDUAL)


def global_search(engine: Engine, field: tuple[Start, ...], pool: list[Trajectory]
                  ) -> tuple[Trajectory | None, int]:
    """Return the best trajectory from the engine's state, and the passes it took in all.

    ``pool`` holds one trajectory per start as memory. None when no start gave a trajectory.
    """
    for start, slot in zip(field, pool):
        engine.begin_slew(np.array(start.lean), lean_steps(engine.structure.horizon),
                          start.long_way, COLD_BARRIER)
        slot.copy_from(engine.iterate(MOST_PASSES))
    passes = sum(int(slot.progress.passes) for slot in pool)
    finalists = [slot for slot in pool
                 if slot.progress.passes > 0 and np.isfinite(slot.progress.cost)]
    return (choose(finalists) if finalists else None), passes


def choose(finalists: list[Trajectory]) -> Trajectory:
    """Return the cheapest trajectory; among equals the one with the smallest first torque.

    Smallest in lexicographic order of the torques rounded to 1e-6: at 180 degrees both sides
    cost the same, and this picks the same one whatever the noise in the attitude's sign, the
    one that turns back along the positive axis as ``so3.log`` has it.
    """
    best = min(slot.progress.cost for slot in finalists)
    equals = [slot for slot in finalists
              if slot.progress.cost <= best + TIE * max(abs(best), 1.0)]
    return min(equals, key=lambda slot: _rank(slot.torques[0]))


def _rank(torque: Array) -> tuple[float, ...]:
    return tuple(np.round(torque / max(float(np.abs(torque).max()), 1e-12), 6).tolist())
