# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The stored plan: which torque it has for a time, and which plans are better."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import PROPERTY

from manifold_mpc_ros.control.held_plan import HeldPlan, Offer, is_valid
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus

STEP_NS = 500
GOAL = np.eye(3)


def plan(horizon: int = 20, cost: float = 1.0, status: SolveStatus = SolveStatus.FEASIBLE,
         promised: float = 0.9) -> AttitudeMpcSolution:
    torques = np.arange(3.0 * horizon).reshape(horizon, 3)
    return AttitudeMpcSolution(
        torques[0].copy(), torques, np.tile(np.eye(3), (horizon + 1, 1, 1)),
        np.zeros((horizon + 1, 3)), cost, 3, 1e-4, status, 0.0, 0.0, False, promised, 0.5)


@PROPERTY
@given(horizon=st.integers(1, 30), made_ns=st.integers(-10**6, 10**6),
       after_ns=st.integers(-2 * STEP_NS, 40 * STEP_NS))
def test_the_torque_is_that_of_the_step_that_the_time_is_nearest_to(
    horizon: int, made_ns: int, after_ns: int,
) -> None:
    held = HeldPlan(STEP_NS)
    held.keep(plan(horizon), made_ns, GOAL)
    torque = held.torque(made_ns + after_ns)
    near = [step for step in range(min(horizon // 2, 5) + 1)
            if abs(after_ns - step * STEP_NS) <= STEP_NS / 2]
    if not near:
        assert torque is None
    else:
        assert torque is not None
        assert int(torque[0]) // 3 in near
        np.testing.assert_array_equal(np.diff(torque), [1.0, 1.0])


def test_nothing_is_held_before_and_after() -> None:
    held = HeldPlan(STEP_NS)
    assert held.torque(0) is None
    held.keep(plan(), 0, GOAL)
    first = held.torque(0)
    assert first is not None
    first[:] = 9.0
    np.testing.assert_array_equal(held.torque(0), [0.0, 1.0, 2.0])  # a copy was given
    held.drop()
    assert held.torque(0) is None


@pytest.mark.parametrize(('solution', 'better'), [
    (plan(cost=0.95), False),
    (plan(cost=0.9), True),
    (plan(cost=0.9 * (1.0 + 1e-7)), True),
    (plan(cost=0.9 * (1.0 + 1e-5)), False),
    (plan(cost=9.0, status=SolveStatus.CONVERGED), True),
    (plan(cost=9.0, status=SolveStatus.INFEASIBLE), True),
    (plan(cost=0.1, status=SolveStatus.FAILED), False),
])
def test_what_is_better_than_the_stored_plan(
    solution: AttitudeMpcSolution, better: bool,
) -> None:
    held = HeldPlan(STEP_NS)
    held.keep(plan(), 0, GOAL)
    assert (held.offer(solution, STEP_NS, GOAL) is Offer.STORED) == better


def test_a_plan_out_of_its_life_or_for_another_goal_is_no_rival() -> None:
    worse = plan(cost=2.0)
    assert HeldPlan(STEP_NS).offer(worse, 0, GOAL) is Offer.STORED
    for rival, time_ns, R_ND, offer in (
            (worse, 5 * STEP_NS, GOAL, Offer.WORSE), (worse, 6 * STEP_NS, GOAL, Offer.STORED),
            (worse, STEP_NS, np.diag([1.0, -1.0, -1.0]), Offer.STORED)):
        held = HeldPlan(STEP_NS)
        held.keep(plan(), 0, GOAL)
        assert held.offer(rival, time_ns, R_ND) is offer
        torque = held.torque(time_ns)
        if offer is Offer.STORED:
            np.testing.assert_array_equal(torque, rival.torque_B_n_m)
        else:
            np.testing.assert_array_equal(torque, plan().torques_B_n_m[5])
    for excess, offer in ((1e-7, Offer.STORED), (1e-5, Offer.WORSE)):
        held = HeldPlan(STEP_NS)
        held.keep(plan(promised=-1.0), 0, GOAL)
        assert held.offer(plan(cost=-1.0 + excess), STEP_NS, GOAL) is offer


@pytest.mark.parametrize('field', ['torque_B_n_m', 'torques_B_n_m'])
def test_a_plan_with_a_torque_that_is_not_finite_is_none(field: str) -> None:
    torques = getattr(plan(), field).copy()
    torques.flat[-1] = math.nan
    broken = plan(status=SolveStatus.CONVERGED)._replace(**{field: torques})
    assert is_valid(plan())
    assert not is_valid(broken)
    assert HeldPlan(STEP_NS).offer(broken, 0, GOAL) is Offer.INVALID
