# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Statuses tell the truth: bad states, states outside D_N, and warm starts."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from cases import CERTIFIED, LIMITED, LIMITS, cold, random_states, rest_states
from oracle_starts import best
from reference import advance, chart, closed_loop
from strategies import generator, half_turns, unit_vectors

from manifold_mpc_ros.lab.benchmark.peers.oracle import Oracle
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus

Make = Callable[..., AttitudeMpc]

GOOD = so3.exp(np.array([0.3, -0.2, 0.9]))
REST = np.zeros(3)


def with_entry(array: Array, value: float) -> Array:
    """Return a copy whose last entry is the value."""
    changed = np.array(array)
    changed[(-1,) * changed.ndim] = value
    return changed


BAD: dict[str, tuple[Array, Array, Array]] = {
    'attitude_nan': (with_entry(GOOD, np.nan), REST, np.eye(3)),
    'attitude_inf': (with_entry(GOOD, np.inf), REST, np.eye(3)),
    'rate_nan': (GOOD, with_entry(REST, np.nan), np.eye(3)),
    'rate_inf': (GOOD, with_entry(REST, -np.inf), np.eye(3)),
    'setpoint_nan': (GOOD, REST, with_entry(np.eye(3), np.nan)),
    'stretched': (1.001 * GOOD, REST, np.eye(3)),
    'sheared': (GOOD + with_entry(np.zeros((3, 3)), 1e-3), REST, np.eye(3)),
    'reflected': (-GOOD, REST, np.eye(3)),
    'zero': (np.zeros((3, 3)), REST, np.eye(3)),
    'setpoint_reflected': (GOOD, REST, np.diag([1.0, 1.0, -1.0])),
    'at_the_guard': (GOOD, np.array([0.0, 0.0, 2.0]), np.eye(3)),
    'beyond_the_guard': (GOOD, np.array([0.0, 0.0, 2.1]), np.eye(3)),
    'huge_rate': (GOOD, np.array([1e200, 0.0, 0.0]), np.eye(3)),
}


@pytest.mark.parametrize('name', sorted(BAD))
def test_a_state_that_cannot_be_predicted_from_fails_with_zero_torque(
        controller: Make, name: str) -> None:
    mpc = controller(**LIMITED)
    plan = mpc.solve(*BAD[name])
    assert plan.status is SolveStatus.FAILED
    assert str(plan.status) == 'failed'
    assert plan.torque_B_n_m.tolist() == [0.0, 0.0, 0.0]
    assert not plan.torques_B_n_m.any()
    assert plan.torques_B_n_m.shape == (10, 3)
    assert plan.R_NB.shape == (11, 3, 3)
    assert np.isnan(plan.cost)


def test_a_rate_just_inside_the_guard_is_answered(controller: Make) -> None:
    """The guard is h |J omega| < 0.6, the smallest moment: 2 rad/s about z is the end.

    The rate limit of 0.6 rad/s cannot be met; the plan brakes as hard as the torque allows.
    """
    plan = controller(**LIMITED).solve(GOOD, np.array([0.0, 0.0, 1.98]))
    assert plan.status is SolveStatus.INFEASIBLE
    assert plan.violation > 1.0
    assert np.abs(plan.torques_B_n_m).max() <= 0.3
    assert plan.torque_B_n_m[2] < -0.299
    assert plan.omega_BN_B[-1, 2] < 0.7


@pytest.mark.parametrize('name', ['attitude_nan', 'reflected', 'setpoint_nan', 'huge_rate'])
def test_a_bad_state_leaves_no_trace(controller: Make, name: str) -> None:
    mpc = controller(**LIMITED)
    fresh = cold(mpc).solve(GOOD, REST)
    mpc.solve(so3.exp(np.array([2.0, 0.0, 0.0])), REST)
    mpc.solve(*BAD[name])
    after = mpc.solve(GOOD, REST)
    assert after.searched
    assert np.array_equal(after.torques_B_n_m, fresh.torques_B_n_m)


def test_a_good_state_repaired_by_projection_is_answered(controller: Make) -> None:
    mpc = controller(**LIMITED)
    rough = GOOD + 1e-4 * np.arange(9.0).reshape(3, 3)
    assert mpc.solve(rough, REST).status is SolveStatus.FAILED
    assert mpc.solve(so3.project(rough), REST).status is SolveStatus.CONVERGED


def test_outside_the_feasible_set_torque_limits_still_hold(controller: Make) -> None:
    """Four steps cannot reach the terminal set from afar; from nearby they can."""
    mpc = controller(**{**CERTIFIED, 'horizon': 4})
    for R, omega in [*rest_states(1), *random_states('outside', 3, 0.1)]:
        far = cold(mpc).solve(R, omega)
        assert far.status is SolveStatus.INFEASIBLE
        assert beyond_level(mpc, far) > 0.05
        assert np.abs(far.torques_B_n_m).max() <= LIMITS['max_torque_n_m']
        assert np.abs(far.omega_BN_B[1:]).max() <= LIMITS['max_rate_rad_s'] * (1 + 1e-6)
        near = cold(mpc).solve(so3.exp(0.05 * so3.log(R)), omega / 20)
        assert near.status is SolveStatus.CONVERGED
        assert near.violation < 1e-9
        assert beyond_level(mpc, near) <= 1e-9


def test_infeasible_means_that_no_plan_exists(controller: Make) -> None:
    """IPOPT from four starts agrees about which states are in D_N, on both sides of its edge."""
    mpc = controller(**{**CERTIFIED, 'horizon': 5})
    oracle = Oracle(mpc.config, mpc.terminal.P, mpc.terminal.c)
    rng, inside = generator('membership'), []
    for axis, angle in zip(unit_vectors(rng, 14), np.linspace(0.5, 2.2, 14)):
        R = so3.exp(angle * axis)
        feasible = cold(mpc).solve(R, REST).status is not SolveStatus.INFEASIBLE
        found = best(oracle, R, REST, rng, octants=2, randoms=0)
        assert feasible == np.isfinite(found.cost)
        inside.append(feasible)
    assert 3 < sum(inside) < 11


def beyond_level(mpc: AttitudeMpc, plan: AttitudeMpcSolution) -> float:
    """Return ``xi^T P xi / c - 1`` at the end of a plan."""
    xi = chart(mpc.config, plan.R_NB[-1], plan.omega_BN_B[-1])
    return float(xi @ mpc.terminal.P @ xi) / mpc.terminal.c - 1


def test_warm_starts_agree_with_cold_ones_along_a_loop(
        controller: Make, cache_dir: str) -> None:
    """A kept plan is as good as a new search, or keeps the last plan's promise at least."""
    other = AttitudeMpc(controller(**CERTIFIED).config, cache_dir=cache_dir)
    kept = 0
    for R, omega in [*rest_states(1)[2:], *random_states('warm', 3, 0.25)]:
        loop = closed_loop(controller(**CERTIFIED), R, omega, 25)
        assert loop[0].plan.searched
        for last, tick in itertools.pairwise(loop):
            fresh = cold(other).solve(tick.R, tick.omega)
            promised = last.plan.cost - last.stage_cost
            assert tick.plan.cost <= max(fresh.cost, promised) * (1 + 1e-6) + 1e-9
            kept += not tick.plan.searched
    assert kept > 0.9 * 24 * 5


def test_a_moved_setpoint_is_searched_and_a_still_one_is_not(controller: Make) -> None:
    mpc, D = controller(**CERTIFIED), half_turns(np.array([0.0, 1.0, 0.0]))
    first = mpc.solve(GOOD, REST)
    R, omega = advance(mpc.config, GOOD, REST, first.torque_B_n_m)
    kept, moved = mpc.solve(R, omega), mpc.solve(R, omega, D)
    assert [first.searched, kept.searched, moved.searched] == [True, False, True]
    fresh = cold(mpc).solve(R, omega, D)
    assert np.array_equal(moved.torques_B_n_m, fresh.torques_B_n_m)
    R, omega = advance(mpc.config, R, omega, moved.torque_B_n_m)
    assert not mpc.solve(R, omega, D).searched
    mpc.reset()
    assert mpc.solve(R, omega, D).searched


def after_a_push(mpc: AttitudeMpc, angle: float, push: float) -> tuple[Array, Array]:
    """Solve from an angle at rest, advance, and return the state turned back by a push."""
    axis = np.array([0.0, 0.6, 0.8])
    R = so3.exp(angle * axis)
    plan = cold(mpc).solve(R, REST)
    R, omega = advance(mpc.config, R, REST, plan.torque_B_n_m)
    return so3.exp(push * axis) @ R, omega


def test_a_push_that_breaks_the_promise_is_searched_when_far(controller: Make) -> None:
    """Beyond 90 degrees both ways are open again after a push back, below they are not."""
    mpc = controller(**CERTIFIED)
    searched = [mpc.solve(*after_a_push(mpc, angle, push)).searched
                for angle, push in ((2.0, 0.0), (2.0, 0.1), (1.0, 0.1))]
    assert searched == [False, True, False]
    state = after_a_push(mpc, 2.0, 0.1)
    pushed = mpc.solve(*state)
    assert pushed.cost == pytest.approx(cold(mpc).solve(*state).cost, rel=1e-9)


def test_figures_of_a_solution(controller: Make) -> None:
    plan = controller(**LIMITED).solve(GOOD, REST)
    assert plan.status is SolveStatus.CONVERGED
    assert 0 < plan.iterations < 3000
    assert 0.0 < plan.solve_time_s < 60.0
    assert plan.kkt_residual < 1e-6
    assert plan.violation < 1e-9
