# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plans that no limit holds back are improved from the last barrier on: fewer passes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import CERTIFIED, LIMITED, REFERENCE, cold, configuration, random_states

from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import SolveStatus

PROBLEMS: dict[str, dict[str, Any]] = {
    'free': REFERENCE, 'limited': LIMITED, 'terminal_set': CERTIFIED,
    'ellipsoid': {**LIMITED, 'max_kinetic_energy_j': 0.05}}
TICKS = 60


@pytest.fixture(scope='module', params=PROBLEMS)
def mpc(request: pytest.FixtureRequest) -> AttitudeMpc:
    return AttitudeMpc(configuration(**{'horizon': 20, **PROBLEMS[request.param]}))


@pytest.fixture(scope='module')
def other(mpc: AttitudeMpc) -> AttitudeMpc:
    return AttitudeMpc(mpc.config, terminal=mpc.terminal)


def test_warm_plans_are_as_good_as_cold_ones_and_take_one_pass_at_rest(
        mpc: AttitudeMpc, other: AttitudeMpc) -> None:
    mpc.reset()
    for R, omega in random_states('free plans', 3, 0.1):
        for _ in range(TICKS):
            plan = mpc.solve(R, omega)
            assert plan.status is SolveStatus.CONVERGED
            best = cold(other).solve(R, omega)
            assert plan.cost <= best.cost + 1e-7 * max(1.0, best.cost)
            # Costs that agree to 1e-14 have torques that agree to its root.
            if plan.cost < 1e-3:
                assert np.abs(plan.torque_B_n_m - best.torque_B_n_m).max() < 1e-6
            R, omega = plan.R_NB[1], plan.omega_BN_B[1]
        assert plan.iterations == 1
        assert np.abs(plan.torque_B_n_m).max() < 1e-6


def test_a_state_that_jumps_is_answered_with_as_good_a_plan_as_from_cold(
        mpc: AttitudeMpc, other: AttitudeMpc) -> None:
    for R, omega in random_states('kicks', 40, 0.25):
        mpc.reset()
        for _ in range(3):
            mpc.solve(np.eye(3), np.zeros(3))
        nearer = so3.exp(0.45 * so3.log(R))  # below 90 degrees
        plan, best = mpc.solve(nearer, omega), cold(other).solve(nearer, omega)
        assert plan.status is best.status
        if best.status is SolveStatus.CONVERGED:
            assert plan.violation <= 1e-6
            assert plan.cost <= best.cost * (1.0 + 1e-6)
