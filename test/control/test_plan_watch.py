# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A horizon or a period that does not fit is named while it lasts, not for a moment's excess."""

from __future__ import annotations

from cases import CERTIFIED, configuration

from manifold_mpc_ros.control.plan_watch import LATE, RECENT, PlanWatch
from manifold_mpc_ros.mpc.solution import SolveStatus


def test_a_horizon_without_a_plan_into_the_set_is_named_until_there_is_one() -> None:
    config = configuration(**CERTIFIED)
    watch = PlanWatch(config)
    for tick in range(1, 30):
        watch.see(SolveStatus.INFEASIBLE, 0.0)
        assert ('horizon' in watch.warnings) == (tick >= config.horizon)
    assert 'raise mpc.horizon' in watch.warnings['horizon']
    watch.see('converged', 0.0)
    assert watch.warnings == {}


def test_momentum_that_wheels_cannot_store_at_the_target_is_named_instead_of_the_horizon() -> None:
    watch = PlanWatch(configuration(**CERTIFIED))
    for _ in range(30):
        watch.see(SolveStatus.INFEASIBLE, 0.0, 1.25)
        assert list(watch.warnings) == ['momentum']
    assert 'store 1.25 of what they can' in watch.warnings['momentum']
    watch.see(SolveStatus.CONVERGED, 0.0, 0.99)
    assert watch.warnings == {}


def test_solves_longer_than_the_period_are_named_while_they_are_many() -> None:
    config = configuration(**CERTIFIED)
    watch = PlanWatch(config)
    for late in range(1, LATE + 1):
        watch.see(SolveStatus.CONVERGED, 1.01 * config.step_s)
        assert ('period' in watch.warnings) == (late >= LATE)
    for _ in range(RECENT - LATE):
        watch.see(SolveStatus.CONVERGED, 0.5 * config.step_s)
        assert 'raise mpc.step_s' in watch.warnings['period']
    watch.see(SolveStatus.CONVERGED, 0.5 * config.step_s)
    assert watch.warnings == {}
