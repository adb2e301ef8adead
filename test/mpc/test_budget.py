# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a solve is given besides a good state: a time budget, or arrays of a wrong shape."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from cases import CERTIFIED, LIMITED, cold, random_states, rest_states

from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import SolveStatus

Make = Callable[..., AttitudeMpc]
STATES = [*rest_states(1), *random_states('budget', 4, 0.2)]


@pytest.mark.parametrize('kind', [LIMITED, CERTIFIED], ids=['limited', 'certified'])
def test_no_time_still_gives_a_plan_within_the_torque_limits(
        controller: Make, kind: dict[str, object]) -> None:
    mpc = controller(**kind)
    for R, omega in STATES:
        plan = cold(mpc).solve(R, omega, max_solve_time_s=0.0)
        assert plan.status in (SolveStatus.FEASIBLE, SolveStatus.INFEASIBLE)
        assert 1 <= plan.iterations <= 2  # none begins after the end of the time, but the first
        assert np.isfinite(plan.torques_B_n_m).all()
        assert np.abs(plan.torques_B_n_m).max() <= 0.3
        assert plan.kkt_residual > 1e-8


def test_a_warm_solve_without_time_is_near_the_shifted_plan(controller: Make) -> None:
    """One pass from the shifted plan: feasible, and no dearer than what the last one promised."""
    mpc = controller(**CERTIFIED)
    for R, omega in STATES:
        first = cold(mpc).solve(R, omega)
        second = mpc.solve(first.R_NB[1], first.omega_BN_B[1], max_solve_time_s=0.0)
        assert second.status == SolveStatus.FEASIBLE
        assert second.cost <= first.promised_cost * (1 + 1e-3) + 1e-6
        assert np.abs(second.torques_B_n_m).max() <= 0.3
        third = mpc.solve(second.R_NB[1], second.omega_BN_B[1])
        assert third.status == SolveStatus.CONVERGED


def test_enough_time_changes_nothing(controller: Make) -> None:
    mpc = controller(**LIMITED)
    for R, omega in STATES:
        free = cold(mpc).solve(R, omega)
        bounded = cold(mpc).solve(R, omega, max_solve_time_s=60.0)
        assert np.array_equal(free.torques_B_n_m, bounded.torques_B_n_m)
        assert bounded.status == SolveStatus.CONVERGED


@pytest.mark.parametrize(('arguments', 'key'), [
    ((np.eye(2), np.zeros(3)), 'R_NB'), ((np.eye(3), np.zeros(4)), 'omega_BN_B'),
    ((np.eye(3), np.zeros(3), np.eye(4)), 'R_ND')])
def test_a_wrong_shape_is_named(
        controller: Make, arguments: tuple[np.ndarray, ...], key: str) -> None:
    with pytest.raises(ConfigurationError, match=key):
        controller(**LIMITED).solve(*arguments)
