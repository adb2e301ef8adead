# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The smallest horizon: found where it is known to be, and confirmed by IPOPT."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases import LIMITS, configuration
from oracle_starts import best
from strategies import generator, half_turns, unit_vectors

from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.lab.benchmark.peers.oracle import Oracle
from manifold_mpc_ros.lab.domain.horizon import (
    HorizonReport,
    gentler_torque_weight,
    rest_states,
    smallest_horizon,
)
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import SolveStatus
from manifold_mpc_ros.terminal.problem_of import terminal_design

# Strong torques and a soft law: three steps are enough, and few solvers have to be built.
QUICK: dict[str, Any] = {
    'forcing': 'symmetric', 'max_torque_n_m': 0.8, 'torque_weight': 20 * np.eye(3)}


@pytest.fixture(scope='module')
def found(cache_dir: Path) -> tuple[HorizonReport, list[str]]:
    """Return the report on QUICK, whose own horizon does not matter, and its progress."""
    lines: list[str] = []
    config = configuration(**QUICK, terminal_constraint=False, horizon=77)
    return smallest_horizon(config, cache_dir=cache_dir, progress=lines.append), lines


def test_half_turns_about_the_axes_are_asked() -> None:
    turns, grid = rest_states(configuration(**QUICK))
    assert np.allclose(np.linalg.norm(turns.vectors, axis=1), np.pi)
    axes = turns.vectors / np.pi
    for axis in np.eye(3):
        assert np.abs(axes - axis).max(axis=1).min() < 1e-12
    # No direction is further than 25 degrees from an axis that is asked.
    drawn = unit_vectors(generator('directions'), 2000)
    assert np.abs(drawn @ axes.T).max(axis=1).min() > np.cos(np.radians(25.0))
    assert len(grid) == 100
    assert not np.any(turns.rates)
    assert not np.any(grid.rates)


def test_the_report_says_what_was_tried(found: tuple[HorizonReport, list[str]]) -> None:
    report, lines = found
    assert report.smallest == 3
    assert report.attitudes == sum(map(len, rest_states(configuration(**QUICK)))) == 133
    assert sorted(report.tried) == [2, 3, 4]
    # A state that is inside D_2 cannot need more than those that are not: it is not asked again.
    assert report.tried[3] + report.tried[2] == report.tried[4] < report.attitudes
    assert report.tried[2] > 0
    assert report.tried[3] > 0
    assert [line.partition(':')[0] for line in lines] == ['N = 4', 'N = 2', 'N = 3']


def test_the_hardest_attitude_needs_it(found: tuple[HorizonReport, list[str]]) -> None:
    """IPOPT finds a plan from there with this many steps, and none with one less."""
    R, feasible = so3.exp(found[0].hardest), {}
    terminal = terminal_design(configuration(**QUICK))
    for horizon in (found[0].smallest - 1, found[0].smallest):
        oracle = Oracle(configuration(**QUICK, horizon=horizon), terminal.P, terminal.c)
        cost = best(oracle, R, np.zeros(3), generator('hardest'), octants=0, randoms=0).cost
        feasible[horizon] = bool(np.isfinite(cost))
    assert list(feasible.values()) == [False, True]


def test_a_horizon_that_cannot_suffice_is_a_design_error(cache_dir: Path) -> None:
    with pytest.raises(DesignError, match='horizon 2 is not enough'):
        smallest_horizon(configuration(**QUICK), largest=2, cache_dir=cache_dir)


def test_a_torque_weight_is_suggested_with_which_the_horizon_is_enough(cache_dir: Path) -> None:
    """Three steps are too few for a tenth of the weight, and the factor found restores them."""
    stiff = configuration(**{**QUICK, 'torque_weight': 2 * np.eye(3), 'horizon': 3})
    factor = gentler_torque_weight(stiff, cache_dir=cache_dir)
    assert factor is not None
    gentler = configuration(**{**QUICK, 'torque_weight': 2 * factor * np.eye(3), 'horizon': 3})
    assert smallest_horizon(gentler, cache_dir=cache_dir).smallest <= 3


def test_ten_steps_are_the_fewest_with_the_reference_limits(
        controller: Callable[..., AttitudeMpc]) -> None:
    """J = diag(1, 0.9, 0.6), h = 0.5, 0.3 N m, 0.6 rad/s: the half turn about x needs ten."""
    statuses = {}
    for horizon in (9, 10):
        mpc = controller(**LIMITS, forcing='symmetric', horizon=horizon)
        plan = mpc.solve(half_turns(np.array([1.0, 0.0, 0.0])), np.zeros(3))
        statuses[horizon] = plan.status
    assert statuses == {9: SolveStatus.INFEASIBLE, 10: SolveStatus.CONVERGED}
