# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Batches give every case the answer that it would get alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases import CERTIFIED, LIMITED, configuration, random_states, rest_states
from reference import closed_loop

from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.batch.batch_mpc import BatchMpc
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

TICKS = 20


def states(n: int) -> tuple[Array, Array]:
    """Return n random states and three half turns at rest, (n + 3, 3, 3) and (n + 3, 3)."""
    R, omega = zip(*random_states('batch', n, 0.2), *rest_states(0))
    return np.array(R), np.array(omega)


@pytest.mark.parametrize('problem', [CERTIFIED, LIMITED], ids=['certified', 'limited'])
def test_plans_and_loops_are_those_of_single_solves(
        problem: dict[str, Any], cache_dir: Path) -> None:
    R, omega = states(2)
    batch = BatchMpc(configuration(**problem), threads=2, cache_dir=cache_dir)
    mpc = AttitudeMpc(configuration(**problem), cache_dir=cache_dir)
    plans = batch.solve(R, omega)
    course = batch.simulate(R, omega, TICKS)
    for case, (attitude, rate) in enumerate(zip(R, omega)):
        log = closed_loop(mpc, attitude, rate, TICKS)
        assert np.array_equal(plans[case].torques_B_n_m, log[0].plan.torques_B_n_m)
        assert np.abs(course.R_NB[case] - [tick.R for tick in log]).max() < 1e-9
        assert np.abs(course.torque_B_n_m[case] - [t.plan.torque_B_n_m for t in log]).max() < 1e-8
        assert np.allclose(course.cost[case], [t.plan.cost for t in log], rtol=1e-7, atol=1e-9)
        assert course.searches[case] >= 1
        assert course.infeasible[case] == 0
    limit = 0.3 * (1 + 1e-12)
    assert np.abs(course.torque_B_n_m).max() <= limit
    assert so3.angle(course.R_NB[:, -1]).max() < so3.angle(course.R_NB[:, 0]).max()


def test_threads_and_order_do_not_change_a_bit(cache_dir: Path) -> None:
    R, omega = states(5)
    one, two = (BatchMpc(configuration(**LIMITED), threads=threads, cache_dir=cache_dir)
                for threads in (1, 2))
    first, second = one.simulate(R, omega, TICKS), two.simulate(R[::-1], omega[::-1], TICKS)
    assert np.array_equal(first.torque_B_n_m, second.torque_B_n_m[::-1])
    assert np.array_equal(first.passes, second.passes[::-1])


def test_a_body_of_its_own(cache_dir: Path) -> None:
    """Another inertia and a disturbance: the body's steps are those of `lgvi_step`."""
    config = configuration(**CERTIFIED)
    J, push = np.diag([1.2, 0.8, 0.7]), np.array([2e-3, -1e-3, 5e-4])
    R, omega = states(2)
    course = BatchMpc(config, threads=2, cache_dir=cache_dir).simulate(
        R, omega, TICKS, inertia_kg_m2=J, disturbance_B_n_m=push)
    for case in range(len(R)):
        for k in range(TICKS - 1):
            attitude, rate = lgvi_step(
                course.R_NB[case, k], course.omega_BN_B[case, k],
                course.torque_B_n_m[case, k] + push, inertia_kg_m2=J, step_s=config.step_s,
                forcing='symmetric')
            assert np.abs(attitude - course.R_NB[case, k + 1]).max() < 1e-13
            assert np.abs(rate - course.omega_BN_B[case, k + 1]).max() < 1e-13


def test_one_configuration_per_case(cache_dir: Path) -> None:
    R, omega = states(0)
    configs = [configuration(**{**LIMITED, 'max_torque_n_m': limit}) for limit in (0.2, 0.3, 0.4)]
    plans = BatchMpc(configs, threads=2, cache_dir=cache_dir).solve(R, omega)
    for config, plan, attitude, rate in zip(configs, plans, R, omega):
        alone = AttitudeMpc(config, cache_dir=cache_dir).solve(attitude, rate)
        assert np.array_equal(plan.torques_B_n_m, alone.torques_B_n_m)
        assert np.isclose(np.abs(plan.torque_B_n_m).max(), config.max_torque_n_m[0], rtol=1e-3)


@pytest.mark.parametrize(('R', 'omega', 'key'), [
    (np.eye(3), np.zeros(3), 'R_NB'),
    (np.zeros((2, 3, 3)), np.zeros((3, 3)), 'omega_BN_B'),
])
def test_wrong_shapes_are_named(R: Array, omega: Array, key: str, cache_dir: Path) -> None:
    batch = BatchMpc(configuration(**LIMITED), threads=1, cache_dir=cache_dir)
    with pytest.raises(ConfigurationError, match=key):
        batch.solve(R, omega)
