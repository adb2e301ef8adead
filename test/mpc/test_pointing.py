# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pointing one body axis: the reduced problem on S^2, with the roll about the axis free."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cases import CERTIFIED, LIMITED, REFERENCE, Array, random_states
from strategies import generator, unit_vectors

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.lgvi import lgvi_step, step_rotation
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus
from manifold_mpc_ros.mpc.target import attitude_towards, error_angle
from manifold_mpc_ros.terminal.manifold import tangent_basis

Make = Callable[..., AttitudeMpc]
POINTING: dict[str, Any] = {'target': 'pointing', 'pointing_axis_B': (0.6, 0.0, 0.8)}
PROBLEMS = {'free': {**REFERENCE, **POINTING}, 'limited': {**LIMITED, **POINTING},
            'certified': {**CERTIFIED, **POINTING}}
in_problems = pytest.mark.parametrize('name', PROBLEMS)


def antipodes(config: AttitudeMpcConfig, n: int) -> list[Array]:
    """Return n attitudes, evenly spread in roll, that point the axis exactly the wrong way."""
    basis = tangent_basis(config.pointing_axis_B)
    turns = np.linspace(0.0, np.pi, n, endpoint=False)
    return [so3.exp(np.pi * basis @ np.array([np.cos(t), np.sin(t)])) for t in turns]


def plan_cost(mpc: AttitudeMpc, s: AttitudeMpcSolution, R_ND: Array) -> float:
    """Return the cost of a plan from the reduced formulas, in numpy."""
    c, axis = mpc.config, mpc.config.pointing_axis_B
    gamma = np.einsum('kji,jl,l->ki', s.R_NB, R_ND, axis)
    steps = step_rotation(s.omega_BN_B, c.inertia_kg_m2, c.step_s)
    weight = np.trace(c.torque_weight) * np.eye(3) - c.torque_weight
    by_rate = np.trace(c.rate_weight) - np.einsum('ij,kji->k', c.rate_weight, steps)
    stages = (c.pointing_weight * (1 - gamma[:-1] @ axis) + by_rate[:-1] / c.step_s ** 2
              + np.einsum('ki,ij,kj->k', s.torques_B_n_m, weight, s.torques_B_n_m) / 2)
    across = np.cross(gamma[-1], axis)
    angle = np.arctan2(np.linalg.norm(across), gamma[-1] @ axis)
    x = tangent_basis(axis).T @ across / np.sinc(angle / np.pi)
    xi = np.concatenate([x, so3.log(steps[-1]) / c.step_s])
    return float(stages.sum() + xi @ mpc.terminal.P @ xi / 2)


def follow(mpc: AttitudeMpc, R: Array, omega: Array, steps: int) -> tuple[Array, Array, int]:
    """Run the loop on the model; return the last state and how often the decrease failed."""
    config, bound, broken = mpc.config, np.inf, 0
    for _ in range(steps):
        s = mpc.solve(R, omega)
        assert s.status == SolveStatus.CONVERGED
        broken += s.cost > bound * (1 + 1e-7) + 1e-12
        bound = s.promised_cost
        R, omega = lgvi_step(R, omega, s.torque_B_n_m, inertia_kg_m2=config.inertia_kg_m2,
                             step_s=config.step_s, forcing=config.forcing)
    return R, omega, broken


@in_problems
def test_the_reported_cost_is_the_reduced_cost(controller: Make, name: str) -> None:
    mpc = controller(**PROBLEMS[name])
    setpoint = so3.random_rotations(generator('setpoint'), 1)[0]
    for R, omega in random_states('pointing cost', 5, 0.2):
        s = mpc.solve(R, omega, setpoint)
        assert s.status == SolveStatus.CONVERGED
        assert s.cost == pytest.approx(plan_cost(mpc, s, setpoint), rel=1e-10)


@in_problems
def test_roll_about_the_commanded_direction_changes_nothing(controller: Make, name: str) -> None:
    """Turning body and setpoint frames about R_ND b leaves Gamma, so the torque, as they are."""
    mpc = controller(**PROBLEMS[name])
    axis, rng = mpc.config.pointing_axis_B, generator('roll')
    for R, omega in random_states('pointing roll', 4, 0.2):
        mpc.reset()
        first = mpc.solve(R, omega)
        mpc.reset()
        rolled = mpc.solve(so3.exp(rng.uniform(-3, 3) * axis) @ R, omega)
        assert rolled.cost == pytest.approx(first.cost, rel=1e-9)
        np.testing.assert_allclose(rolled.torque_B_n_m, first.torque_B_n_m, atol=1e-7)


def test_a_rolled_body_that_points_well_stays_where_it_is(controller: Make) -> None:
    mpc = controller(**PROBLEMS['certified'])
    for roll in (-3.0, -1.0, 0.5, np.pi):
        s = mpc.solve(so3.exp(roll * mpc.config.pointing_axis_B), np.zeros(3))
        assert s.cost < 1e-12
        assert np.abs(s.torque_B_n_m).max() < 1e-7


@in_problems
def test_every_antipode_costs_the_same_and_is_left(controller: Make, name: str) -> None:
    mpc = controller(**PROBLEMS[name])
    costs = []
    for R in antipodes(mpc.config, 4):
        assert error_angle(mpc.config, R) == pytest.approx(np.pi, abs=1e-7)
        mpc.reset()
        s = mpc.solve(R, np.zeros(3))
        assert np.linalg.norm(s.torque_B_n_m) > 0.1
        costs.append(s.cost)
    np.testing.assert_allclose(costs, costs[0], rtol=1e-9)


@in_problems
def test_the_loop_settles_with_the_decrease_kept(controller: Make, name: str) -> None:
    mpc = controller(**PROBLEMS[name])
    starts = [(antipodes(mpc.config, 3)[1], np.zeros(3)), *random_states('point', 3, 0.2)]
    for R0, omega0 in starts:
        mpc.reset()
        R, omega, broken = follow(mpc, R0, omega0, 45)
        assert error_angle(mpc.config, R) < np.radians(0.1)
        assert np.linalg.norm(omega) < 1e-3
        if name == 'certified':
            assert broken == 0


def test_the_roll_angle_is_left_where_it_is_cheapest(controller: Make) -> None:
    """At rest, turned about the axis and off it, the body keeps most of its roll."""
    mpc = controller(**PROBLEMS['certified'])
    axis = mpc.config.pointing_axis_B
    R0 = so3.exp(2.0 * axis) @ so3.exp(0.5 * tangent_basis(axis)[:, 0])
    R, _, _ = follow(mpc, R0, np.zeros(3), 45)
    assert so3.angle(R) == pytest.approx(2.0, abs=0.3)


def test_the_attitude_weight_is_not_looked_at(controller: Make) -> None:
    R, omega = random_states('pointing weight', 1, 0.2)[0]
    torques = [controller(**PROBLEMS['limited'], attitude_weight=weight).solve(R, omega)
               .torque_B_n_m for weight in ((1.0, 1.0, 1.0), (9.0, 1.0, 3.0))]
    np.testing.assert_array_equal(*torques)


def test_the_attitude_towards_a_direction_points_the_axis_there() -> None:
    config = AttitudeMpcConfig(
        inertia_kg_m2=(1.0, 0.9, 0.6), step_s=0.5, horizon=5, attitude_weight=(1, 1, 1),
        rate_weight=(1, 1, 1), torque_weight=(1, 1, 1), **POINTING)
    axis = config.pointing_axis_B
    for direction in (axis, -axis, *unit_vectors(generator('direction'), 50)):
        R_ND = attitude_towards(config, 3.0 * direction)
        np.testing.assert_allclose(R_ND @ axis, direction, atol=1e-14)
        assert so3.angle(R_ND) == pytest.approx(np.arccos(np.clip(axis @ direction, -1, 1)),
                                                abs=1e-7)
