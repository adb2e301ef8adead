# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The general MPC: its plans are what they say, and it settles from where no continuous law can.

The comparison with the fast solver is in test/mpc/test_manifold_oracle.py.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from cases import LIMITED, REFERENCE, configuration, random_states
from manifold_oracle import point_of
from strategies import half_turns

from manifold_mpc_ros.lab.reference.manifold_mpc import ManifoldMpc, PlanStatus, run_on_manifold
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.manifold import Euclidean, Sphere
from manifold_mpc_ros.terminal.problem import ManifoldProblem
from manifold_mpc_ros.terminal.problem_of import problem_of

AXIS = np.array([0.6, 0.0, 0.8])
POINTING: dict[str, Any] = {'target': 'pointing', 'pointing_axis_B': AXIS}
ANTIPODE = half_turns(np.array([0.8, 0.0, -0.6]))


def kinematic_sphere(limit: float) -> ManifoldProblem:
    """Return a direction turned at will: ``Gamma+ = Gamma + u x Gamma`` on S^2, normalised."""
    def step(gamma: ca.SX, u: ca.SX) -> ca.SX:
        moved = gamma + ca.cross(u, gamma)
        return moved / ca.norm_2(moved)

    return ManifoldProblem(
        name='direction', states=Sphere(AXIS), controls=Euclidean(3), step=step,
        stage_cost=lambda gamma, u: 1 - ca.dot(gamma, ca.DM(AXIS)) + ca.dot(u, u) / 2,
        terminal_scale=0.5, state_units=np.ones(2), control_units=np.ones(3),
        control_limits=np.full(3, limit))


def test_a_plan_is_a_trajectory_on_the_manifold_that_costs_what_it_says() -> None:
    config = configuration(**LIMITED, **POINTING, horizon=5)
    problem = problem_of(config)
    mpc = ManifoldMpc(problem, 5, False, starts=3)
    R, omega = random_states('plan', 1, 0.3)[0]
    solution = mpc.solve(point_of(config, R, omega))
    x, u = ca.SX.sym('x', 7), ca.SX.sym('u', 3)
    stage = ca.Function('stage', [x, u], [problem.step(x, u), problem.stage_cost(x, u)])
    chart = ca.Function('chart', [x], [problem.states.coordinates(x)])
    total = 0.0
    for k, control in enumerate(solution.plan.controls):
        following, cost = stage(solution.plan.states[k], control)
        assert np.allclose(np.array(following).ravel(), solution.plan.states[k + 1], atol=1e-14)
        total += float(cost)
    xi = np.array(chart(solution.plan.states[-1])).ravel()
    assert solution.value == pytest.approx(total + xi @ mpc.terminal.P @ xi / 2, rel=1e-12)
    assert solution.promised == pytest.approx(
        solution.value - float(stage(solution.plan.states[0], solution.control)[1]), rel=1e-12)
    assert np.allclose(np.linalg.norm(solution.plan.states[:, :3], axis=1), 1, atol=1e-12)
    assert np.allclose(np.linalg.norm(solution.plan.states[:, 3:], axis=1), 1, atol=1e-12)
    assert np.abs(solution.plan.controls).max() <= 0.3


def test_starts_stay_in_the_domain_of_the_step_and_are_the_same_every_time() -> None:
    config = configuration(**REFERENCE)
    mpc = ManifoldMpc(problem_of(config), config.horizon, False, starts=14)
    point = point_of(config, half_turns(np.array([1.0, 0.0, 0.0])), np.zeros(3))
    first, again = list(mpc.starts(point)), list(mpc.starts(point))
    assert len(first) == 14
    for one, other in zip(first, again):
        assert np.array_equal(one.controls, other.controls)
        assert all(mpc.ocp.exists(x, u) for x, u in zip(one.states, one.controls))
    # The local law turns back, its mirror image the other way round.
    assert first[0].controls[0, 0] * first[0].states[0, 1] < 0
    assert first[1].controls[0, 0] * first[1].states[0, 1] > 0


@pytest.mark.parametrize('limit', [0.1, 1.0])
def test_the_antipode_of_the_sphere_is_left_and_the_origin_reached(limit: float) -> None:
    mpc = ManifoldMpc(kinematic_sphere(limit), 12, limit > 0.5, starts=6)
    log = run_on_manifold(mpc, -AXIS, 60 if limit < 0.5 else 15)
    assert set(log.statuses) == {PlanStatus.OPTIMAL}
    assert log.states[1] @ -AXIS < np.cos(0.5 * limit)
    assert log.states[-1] @ AXIS > np.cos(np.radians(0.1))
    assert np.abs(log.controls).max() <= limit * (1 + 1e-6)
    if limit > 0.5:  # with the terminal set the decrease is promised
        assert np.all(log.decrease_violations <= 1e-7 * log.values[0])


def test_no_plan_reaches_the_terminal_set_in_too_few_steps() -> None:
    solution = ManifoldMpc(kinematic_sphere(0.1), 3, starts=6).solve(-AXIS)
    assert solution.status is PlanStatus.INFEASIBLE
    assert solution.value == np.inf


@pytest.mark.parametrize(('target', 'R'), [
    ({}, half_turns(np.array([0.0, 0.0, 1.0]))), (POINTING, ANTIPODE)],
    ids=['attitude', 'pointing'])
def test_the_value_falls_by_the_stage_cost_on_the_rigid_body(
    target: dict[str, Any], R: Array,
) -> None:
    config = configuration(terminal_constraint=True, **target)
    mpc = ManifoldMpc(problem_of(config), config.horizon, starts=3)
    log = run_on_manifold(mpc, point_of(config, R, np.zeros(3)), 6)
    assert PlanStatus.INFEASIBLE not in log.statuses
    assert np.all(log.decrease_violations <= 1e-8 * log.values[0])
    assert log.values[-1] < 0.4 * log.values[0]
