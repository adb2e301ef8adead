# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The search on other bodies and long horizons; `benchmarks/bodies.py` is the thorough form."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lab.domain.feasibility import Feasibility
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus

# Moments of inertia [kg m^2], torque [N m], rates [rad/s], step [s].
HUBBLE = ((31046.0, 77217.0, 78754.0), 1.2, np.radians((0.5, 0.2, 0.2)), 10.0)
CUBESAT = ((0.035, 0.035, 0.007), 1e-4, 0.05, 0.5)
SIX_UNITS = ((0.13, 0.10, 0.05), 1e-3, 0.1, 0.5)
# Slow beside its torque: 8 bang-bang steps, then the rate limit.
WHEELED = ((0.167174901, 0.125963211, 0.0612346508), 7e-4, 0.012, 3.64)
TABLE = ((0.9, 0.8, 1.5), 0.5, 1.0, 0.3377875959474387)
SHIPPED = ((1.0, 0.9, 0.6), 0.3, 0.6, 0.024119959186609963)
SMALL = ((0.02 / 3, 0.1256 / 3, 0.1256 / 3), 1e-3, 0.1, 0.125)


def controller(body: tuple[tuple[float, ...], float, object, float], horizon: int, *,
               accuracy_rad: float = np.radians(1.0), damping: float = 1.0) -> AttitudeMpc:
    """Return a controller nearly as quick as torque allows: full torque costs one degree."""
    inertia, torque, rate, step_s = body
    return AttitudeMpc(AttitudeMpcConfig(
        inertia_kg_m2=np.diag(inertia), step_s=step_s, horizon=horizon,
        attitude_weight=np.eye(3), max_torque_n_m=torque, max_rate_rad_s=rate,
        rate_weight=damping * accuracy_rad * np.mean(inertia) / torque * np.eye(3),
        torque_weight=(accuracy_rad / torque) ** 2 * np.eye(3)))


def turned(mpc: AttitudeMpc, axis: str, angle_deg: float) -> AttitudeMpcSolution:
    """Solve for a body at rest, cold."""
    mpc.reset()
    vector = np.radians(angle_deg) * np.eye(3)['xyz'.index(axis)]
    return mpc.solve(so3.exp(vector), np.zeros(3))


@pytest.mark.parametrize(('body', 'axis', 'horizons'), [
    (SIX_UNITS, 'z', (160, 200, 250)), (HUBBLE, 'z', (100, 120, 200)),
    (CUBESAT, 'x', (200, 300, 500)), (CUBESAT, 'z', (300, 500))])
def test_a_longer_horizon_never_costs_more_and_the_value_is_continuous(
        body: tuple[tuple[float, ...], float, object, float], axis: str,
        horizons: tuple[int, ...]) -> None:
    costs = []
    for horizon in horizons:
        mpc = controller(body, horizon)
        at, beside = turned(mpc, axis, 180.0), turned(mpc, axis, 179.7)
        assert {at.status, beside.status} == {SolveStatus.CONVERGED}
        assert beside.cost == pytest.approx(at.cost, rel=0.02)
        costs.append(at.cost)
    assert all(after <= before * (1 + 1e-6)
               for before, after in itertools.pairwise(costs))


def test_a_nearly_time_optimal_turn_leans_at_small_angles_too() -> None:
    """A slew about one axis at rest is a stationary point, 1.8 % above the best plan known."""
    mpc = controller(WHEELED, 80, accuracy_rad=np.radians(0.5), damping=3.0)
    plan = turned(mpc, 'x', 51.0)
    straight = mpc.solve_local(so3.exp(np.radians(51.0) * np.eye(3)[0]), np.zeros(3))
    assert plan.status == SolveStatus.CONVERGED
    assert plan.cost < 0.99 * straight.cost


def test_a_nearly_time_optimal_turn_of_few_steps_finds_what_ipopt_finds() -> None:
    mpc = controller(TABLE, 20, accuracy_rad=np.radians(0.5), damping=3.0)
    plan = turned(mpc, 'y', 109.13681772777943)
    assert plan.status == SolveStatus.CONVERGED
    assert plan.cost == pytest.approx(12.935235230073406, rel=1e-6)


@pytest.mark.parametrize(('body', 'horizon', 'axis', 'angle_deg', 'accuracy_deg', 'damping'), [
    ((*HUBBLE[:3], 17.64197031019691), 47, 'z', 172.04886382027587, 5.0, 3.0),
    (SHIPPED, 236, 'x', 173.7950808557616, 1.0, 0.3)])
def test_at_the_smallest_horizon_of_a_turn_the_controller_finds_a_plan_that_keeps_all_limits(
        body: tuple[tuple[float, ...], float, object, float], horizon: int, axis: str,
        angle_deg: float, accuracy_deg: float, damping: float) -> None:
    for steps, inside in ((horizon, True), (horizon - 1, False)):
        mpc = controller(body, steps, accuracy_rad=np.radians(accuracy_deg), damping=damping)
        plan = turned(mpc, axis, angle_deg)
        assert (plan.status != SolveStatus.INFEASIBLE) == inside
        found = Feasibility(mpc.config, mpc.terminal).plan(plan.R_NB[0], np.zeros(3))
        assert (found is not None) == inside
        if inside:
            limit = np.broadcast_to(body[2], 3)
            assert np.all(np.abs(plan.omega_BN_B) <= limit * (1 + 1e-6))


def test_a_plan_that_ends_in_the_set_is_not_called_infeasible() -> None:
    """The starts with the terminal set end before it; those without it end inside."""
    plan = turned(controller(SMALL, 300, damping=0.3), 'x', 180.0)
    assert plan.status == SolveStatus.CONVERGED
    assert plan.violation < 1e-6
