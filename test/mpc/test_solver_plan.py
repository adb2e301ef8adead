# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a plan says of itself is true: its trajectory, cost, limits and optimality."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cases import CERTIFIED, LIMITED, LIMITS, REFERENCE, cold, random_states, rest_states
from oracle_starts import best
from reference import closed_loop, plan_cost, roll_out
from strategies import INERTIAS, generator, half_turns

from manifold_mpc_ros.lab.benchmark.peers.oracle import Oracle, steps_of
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus

Make = Callable[..., AttitudeMpc]

KINDS: dict[str, dict[str, Any]] = {
    'free': REFERENCE,
    'limited': LIMITED,
    'certified': CERTIFIED,
    'symmetric': {**LIMITED, 'forcing': 'symmetric'},
    'off_diagonal': {**LIMITED, 'inertia_kg_m2': INERTIAS['off_diagonal']},
}
in_kinds = pytest.mark.parametrize('kind', sorted(KINDS))
STATES = [*rest_states(2), *random_states('plan', 6, 0.25)]


def plans(mpc: AttitudeMpc) -> list[AttitudeMpcSolution]:
    """Return a cold plan from every state."""
    return [cold(mpc).solve(R, omega) for R, omega in STATES]


@in_kinds
def test_a_plan_is_a_trajectory_of_the_model(controller: Make, kind: str) -> None:
    mpc = controller(**KINDS[kind])
    for (R, omega), plan in zip(STATES, plans(mpc)):
        assert np.array_equal(plan.torque_B_n_m, plan.torques_B_n_m[0])
        attitudes, rates = roll_out(mpc.config, R, omega, plan.torques_B_n_m)
        assert plan.R_NB.shape == attitudes.shape
        assert np.abs(plan.R_NB - attitudes).max() < 1e-12
        assert np.abs(plan.omega_BN_B - rates).max() < 1e-12


@in_kinds
def test_the_cost_is_the_cost_of_the_plan(controller: Make, kind: str) -> None:
    mpc = controller(**KINDS[kind])
    D = so3.random_rotations(generator('commanded'), 1)[0]
    for R, omega in STATES:
        plan = cold(mpc).solve(D @ R, omega, D)
        cost = plan_cost(mpc.config, mpc.terminal.P, D.T @ plan.R_NB, plan.omega_BN_B,
                         plan.torques_B_n_m)
        assert plan.cost == pytest.approx(cost, rel=1e-12)


@pytest.mark.parametrize('forcing', ['paper', 'symmetric'])
def test_limits_hold_where_they_are_set_and_only_there(controller: Make, forcing: str) -> None:
    """Each limit is active with it and broken without it."""
    torque, rate = LIMITS['max_torque_n_m'], LIMITS['max_rate_rad_s']
    kinds = {'free': controller(**REFERENCE, forcing=forcing),
             'limited': controller(**LIMITED, forcing=forcing)}
    largest = {name: ([], []) for name in kinds}
    for name, mpc in kinds.items():
        for plan in plans(mpc):
            largest[name][0].append(np.abs(plan.torques_B_n_m).max())
            largest[name][1].append(np.abs(plan.omega_BN_B[1:]).max())
    assert max(largest['limited'][0]) <= torque
    assert max(largest['limited'][1]) <= rate * (1 + 1e-9)
    assert min(largest['limited'][0]) > 0.999 * torque
    assert max(largest['limited'][1]) > 0.999 * rate
    assert min(largest['free'][0]) > torque
    assert max(largest['free'][1]) > rate


def test_limits_of_single_axes(controller: Make) -> None:
    """An infinite entry frees its axis; equal to it is an entry too large to matter."""
    mpc = controller(**REFERENCE, max_torque_n_m=(0.2, np.inf, 0.3),
                     max_rate_rad_s=(np.inf, np.inf, 0.4))
    torque, rate = np.zeros(3), np.zeros(3)
    for plan in plans(mpc):
        torque = np.maximum(torque, np.abs(plan.torques_B_n_m).max(axis=0))
        rate = np.maximum(rate, np.abs(plan.omega_BN_B[1:]).max(axis=0))
    assert (torque[[0, 2]] <= [0.2, 0.3]).all()
    assert torque[1] > 0.4
    assert rate[2] <= 0.4 * (1 + 1e-9)
    assert rate[1] > 0.5


def test_an_initial_rate_beyond_its_limit_is_brought_back(controller: Make) -> None:
    """The limits hold from the second state on; the first one is what was measured."""
    mpc = controller(**LIMITED)
    plan = mpc.solve(so3.exp(np.array([0.0, 0.0, 1.0])), np.array([0.0, 0.0, 0.68]))
    assert plan.status is SolveStatus.CONVERGED
    assert plan.omega_BN_B[0, 2] == pytest.approx(0.68)
    assert np.abs(plan.omega_BN_B[1:]).max() <= 0.6 * (1 + 1e-9)


def cost_gradient(mpc: AttitudeMpc, R: Array, omega: Array, torques: Array) -> Array:
    """Return the derivative of the cost by the torques (N, 3), by central differences."""
    gradient, step = np.zeros_like(torques), 1e-4
    for index in np.ndindex(*torques.shape):
        costs = []
        for sign in (1, -1):
            moved = torques.copy()
            moved[index] += sign * step
            attitudes, rates = roll_out(mpc.config, R, omega, moved)
            costs.append(plan_cost(mpc.config, mpc.terminal.P, attitudes, rates, moved))
        gradient[index] = (costs[0] - costs[1]) / (2 * step)
    return gradient


@pytest.mark.parametrize('forcing', ['paper', 'symmetric'])
def test_the_gradient_vanishes_without_limits(controller: Make, forcing: str) -> None:
    mpc = controller(**REFERENCE, forcing=forcing)
    for R, omega in random_states('gradient', 2, 0.3):
        plan = cold(mpc).solve(R, omega)
        assert plan.kkt_residual < 1e-8
        gradient = cost_gradient(mpc, R, omega, plan.torques_B_n_m)
        assert np.abs(gradient).max() < 1e-5
        moved = cost_gradient(mpc, R, omega, 0.9 * plan.torques_B_n_m)
        assert np.abs(moved).max() > 0.1


@pytest.mark.parametrize('forcing', ['paper', 'symmetric'])
def test_the_gradient_points_out_of_the_torque_box(controller: Make, forcing: str) -> None:
    """Inside the box it vanishes; at a bound the cost falls towards the outside only."""
    mpc = controller(**REFERENCE, forcing=forcing, max_torque_n_m=0.3)
    for R, omega in [*random_states('box', 2, 0.3), *rest_states(0)[2:]]:
        plan = cold(mpc).solve(R, omega)
        assert plan.kkt_residual < 1e-6
        gradient = cost_gradient(mpc, R, omega, plan.torques_B_n_m)
        bound = np.abs(plan.torques_B_n_m) > 0.3 * (1 - 1e-6)
        assert 3 <= np.count_nonzero(bound) < bound.size
        assert np.abs(gradient[~bound]).max() < 1e-4
        assert (gradient * np.sign(plan.torques_B_n_m))[bound].max() < 1e-4


@pytest.mark.parametrize('forcing', ['paper', 'symmetric'])
@pytest.mark.parametrize('horizon', [1, 2, 3])
def test_short_horizons(controller: Make, horizon: int, forcing: str) -> None:
    mpc = controller(**LIMITED, forcing=forcing, horizon=horizon)
    oracle = Oracle(mpc.config, mpc.terminal.P, mpc.terminal.c)
    rng = generator('short')
    for R, omega in [(half_turns(np.array([0.0, 0.0, 1.0])), np.zeros(3)),
                     *random_states('short', 3, 0.3)]:
        plan = cold(mpc).solve(R, omega)
        assert plan.torques_B_n_m.shape == (horizon, 3)
        assert plan.status is SolveStatus.CONVERGED
        found = best(oracle, R, omega, rng, octants=8, randoms=2)
        assert plan.cost <= found.cost * (1 + 1e-6)
        steps = steps_of(plan.R_NB, plan.omega_BN_B, mpc.config)
        polished = oracle.solve(R, omega, steps, polish=True)
        assert plan.cost == pytest.approx(polished.cost, rel=1e-6)


@pytest.mark.parametrize('step_s', [0.02, 0.005])
def test_short_steps_converge(controller: Make, step_s: float) -> None:
    """At the rates of fast loops torques are small beside momenta, and their weights large."""
    mpc = controller(**{**LIMITED, 'horizon': 20, 'forcing': 'symmetric', 'step_s': step_s})
    log = closed_loop(cold(mpc), so3.exp(np.array([0.6, 0.5, 0.4])), np.zeros(3), 60)
    assert {tick.plan.status for tick in log} == {SolveStatus.CONVERGED}
    assert [tick.plan.searched for tick in log] == [True] + 59 * [False]
