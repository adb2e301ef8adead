# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plans with reaction wheels: momentum and motor torque of every node."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from wheel_cases import INERTIA, wheels

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.dynamics.wheel_allocation import WheelAllocation
from manifold_mpc_ros.dynamics.wheel_step import wheel_step
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.scaling import scaling_of
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus
from manifold_mpc_ros.mpc.stages.inequalities import wheel_inequalities

ARRAY = wheels()
BOX = ARRAY.torques.box
REACH = 2.0 * BOX  # of the polytope along body axes
STORED = np.array([12e-3, -9e-3, 7e-3, 5e-3])


def make(array: WheelArray | None, max_torque_n_m: Any, **changes: Any) -> AttitudeMpc:
    """Return the controller of a 6U."""
    return AttitudeMpc(AttitudeMpcConfig(**{
        'inertia_kg_m2': INERTIA, 'step_s': 1.0, 'horizon': 40, 'attitude_weight': np.eye(3),
        'rate_weight': 2.0 * np.eye(3), 'torque_weight': 1e3 * np.eye(3),
        'max_torque_n_m': max_torque_n_m, 'max_rate_rad_s': np.radians(4.0), 'wheels': array,
        **changes}))


@pytest.fixture(scope='module')
def with_wheels() -> AttitudeMpc:
    """Return the controller with the pyramid."""
    return make(ARRAY, REACH)


def wheel_use(plan: AttitudeMpcSolution, momentum: np.ndarray, array: WheelArray = ARRAY
              ) -> tuple[float, float]:
    """Return the largest gauges of motor torque and momentum over a plan, from its states.

    Momenta of wheels that are not available turn with the body.
    """
    stored = plan.R_NB[0] @ (INERTIA @ plan.omega_BN_B[0] + array.axes_B.T @ momentum)
    b = np.einsum('kji,j->ki', plan.R_NB, stored) - plan.omega_BN_B @ INERTIA
    return (max(map(array.torques.gauge, np.diff(b, axis=0))),
            max(map(array.momenta.gauge, b - momentum @ (array.axes_B - array.matrix.T))))


def half_turns(n: int) -> list[np.ndarray]:
    """Return rotations by 180 degrees about random axes."""
    axes = np.random.default_rng(4).normal(size=(n, 3))
    return [so3.exp(np.pi * axis / np.linalg.norm(axis)) for axis in axes]


def test_plans_keep_the_polytope_and_go_beyond_the_box_in_it(with_wheels: AttitudeMpc) -> None:
    boxed, free = make(None, BOX), make(None, REACH)
    for R in half_turns(3):
        for each in (with_wheels, boxed, free):
            each.reset()
        plan, in_box, without = (each.solve(R, np.zeros(3)) for each in (
            with_wheels, boxed, free))
        assert plan.status == SolveStatus.CONVERGED
        assert wheel_use(plan, np.zeros(4))[0] <= 1.0 + 1e-7
        assert np.abs(plan.torques_B_n_m / BOX).max() > 1.2
        assert wheel_use(without, np.zeros(4))[0] > 1.2
        assert without.cost <= plan.cost * (1 + 1e-6)
        assert plan.cost < in_box.cost


def test_the_gyroscopic_torque_of_the_whole_horizon_is_planned_with(with_wheels: AttitudeMpc
                                                                   ) -> None:
    R, omega = half_turns(1)[0], np.array([0.03, -0.04, 0.02])
    with_wheels.reset()
    plan = with_wheels.solve(R, omega, wheel_momentum_n_m_s=STORED)
    assert plan.status == SolveStatus.CONVERGED
    torque, momentum = wheel_use(plan, STORED)
    assert 1.0 - 1e-4 < torque <= 1.0 + 1e-7
    assert momentum < 0.8
    with_wheels.reset()
    still = with_wheels.solve(R, omega)
    assert max(wheel_use(still, sign * STORED)[0] for sign in (1, -1)) > 1.1


def test_plans_keep_the_momentum_that_wheels_can_store() -> None:
    """As fast as the rate limits let them, turns would take more than that."""
    small = wheels(max_momentum_n_m_s=2.2e-3)
    mpc, free = (make(each, REACH, horizon=60) for each in (small, ARRAY))
    for R in half_turns(3):
        plans = [each.solve(R, np.zeros(3), wheel_momentum_n_m_s=0.1 * STORED)
                 for each in (mpc, free)]
        assert [plan.status for plan in plans] == [SolveStatus.CONVERGED] * 2
        uses = [wheel_use(plan, 0.1 * STORED, small)[1] for plan in plans]
        assert uses[0] <= 1.0 + 1e-7
        assert uses[1] > 1.05
        assert plans[1].cost < plans[0].cost


def test_a_wheel_that_is_not_reported_is_planned_without(with_wheels: AttitudeMpc) -> None:
    three = ARRAY.without(np.array([False, False, True, False]))
    for R in half_turns(2):
        with_wheels.reset()
        whole = with_wheels.solve(R, np.zeros(3))
        momentum = np.array([0.0, 0.0, np.nan, 0.0])
        plan = with_wheels.solve(R, np.zeros(3), wheel_momentum_n_m_s=momentum)
        assert wheel_use(plan, np.zeros(4), three)[0] <= 1.0 + 1e-7
        assert wheel_use(whole, np.zeros(4), three)[0] > 1.5
        assert plan.wheel_torque_n_m is not None
        assert plan.wheel_torque_n_m[2] == 0.0


def test_what_a_dead_wheel_stores_turns_with_the_body() -> None:
    """The three others have 12 mN m s left for it, and for the body that turns."""
    failed = np.array([False, False, True, False])
    mpc, three = make(wheels(max_momentum_n_m_s=1.2e-2), REACH), wheels(
        max_momentum_n_m_s=1.2e-2).without(failed)
    R, momentum = half_turns(3)[1], np.array([-3e-3, 2e-3, 11e-3, 0.0])
    mpc.solve(R, np.zeros(3), wheel_momentum_n_m_s=momentum)
    mpc.reset()
    plan = mpc.solve(R, np.zeros(3), wheel_momentum_n_m_s=np.where(failed, np.nan, momentum))
    torque, stored = wheel_use(plan, momentum, three)
    left = R @ ARRAY.axes_B.T @ momentum - ARRAY.axes_B[2] * momentum[2]
    assert plan.target_momentum == pytest.approx(three.momenta.gauge(left))
    assert torque <= 1.0 + 1e-7
    assert 0.99 < stored <= 1.0 + 1e-7


@pytest.mark.parametrize('fails_at', [None, 3, 12])
def test_half_turns_with_momentum_stored_settle_within_every_limit(
    with_wheels: AttitudeMpc, fails_at: int | None,
) -> None:
    """With a dead wheel less is stored: the others have to hold all of it at the end."""
    stored = STORED if fails_at is None else 0.3 * STORED
    R, omega, momentum = half_turns(3)[2], np.zeros(3), stored
    with_wheels.reset()
    for k in range(90):
        known = momentum.copy()
        if fails_at is not None and k >= fails_at:
            known[1] = np.nan
        plan = with_wheels.solve(R, omega, wheel_momentum_n_m_s=known)
        motor = plan.wheel_torque_n_m
        assert motor is not None
        assert (np.abs(motor) <= ARRAY.max_torque_n_m * (1 + 1e-9)).all()
        for _ in range(10):
            R, omega = wheel_step(R, omega, ARRAY.axes_B.T @ momentum, ARRAY.axes_B.T @ motor,
                                  np.zeros(3), inertia_kg_m2=INERTIA, step_s=0.1)
            momentum = momentum + 0.1 * motor
        assert (np.abs(momentum) <= ARRAY.max_momentum_n_m_s * (1 + 1e-9)).all()
    assert so3.angle(R) < 1e-5
    assert np.abs(omega).max() < 1e-6


@pytest.mark.parametrize('held', [False, True])
@pytest.mark.parametrize('fails', [None, 2])
def test_the_solver_gets_the_facets_of_what_wheels_give(
    with_wheels: AttitudeMpc, fails: int | None, held: bool,
) -> None:
    """As NumPy has them: normals over bounds of both sets, and a box inside that of torques."""
    momentum = np.where(np.arange(4) == fails, np.nan, STORED)
    array, known = ARRAY.reported(momentum)
    with_wheels.reset()
    with_wheels.solve(np.eye(3), np.zeros(3), wheel_momentum_n_m_s=STORED)
    with_wheels._wheels.held = held
    with_wheels.solve(np.eye(3), np.zeros(3), wheel_momentum_n_m_s=momentum)
    nu = STORED * array.available - array.inverse @ array.matrix @ STORED
    left = np.maximum(ARRAY.max_momentum_n_m_s - np.abs(nu),
                      np.abs(array.inverse @ array.matrix @ STORED))
    sets = (array.held(left), array.held(array.max_torque_n_m)) if held else (
        array.momenta, array.torques)
    unit = scaling_of(with_wheels.config)
    for each, zonotope, scale in zip(
            wheel_inequalities(with_wheels.solver.structure), sets,
            (unit.torque_n_m * unit.time_s, unit.torque_n_m)):
        data = with_wheels.solver._global(each.data)
        facets = data[:3 * each.rows // 2].reshape(3, -1).T[:len(zonotope.bounds)] / scale
        np.testing.assert_allclose(facets, zonotope.normals / zonotope.bounds[:, None],
                                   rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(data[-3:] * unit.torque_n_m, sets[1].box, rtol=1e-12)
    assert np.isnan(known).any() == (fails is not None)


def shortest(mpc: AttitudeMpc, R: np.ndarray, momentum: np.ndarray, whole: bool
             ) -> tuple[float, int]:
    """Return what torque lacks at the most in a slew, in parts of the reach, and held plans."""
    omega, lacking, held = np.zeros(3), 0.0, 0
    mpc.reset()
    for _ in range(35):
        plan = mpc.solve(R, omega, wheel_momentum_n_m_s=momentum)
        motor = plan.wheel_torque_n_m
        assert motor is not None
        mpc._wheels.held &= not whole
        held += mpc._wheels.held
        given = WheelAllocation(ARRAY, INERTIA, 1.0, omega, momentum, plan.torque_B_n_m)
        lacking = max(lacking, float(np.abs(
            (given.realised(motor) - plan.torque_B_n_m) / REACH).max()))
        for _ in range(4):
            R, omega = wheel_step(R, omega, ARRAY.axes_B.T @ momentum, ARRAY.axes_B.T @ motor,
                                  np.zeros(3), inertia_kg_m2=INERTIA, step_s=0.25)
            momentum = momentum + 0.25 * motor
    return lacking, held


def test_wheels_with_much_momentum_can_do_all_of_a_plan(with_wheels: AttitudeMpc) -> None:
    """In plans with all of both polytopes one wheel is full while the others have room."""
    draws = np.random.default_rng(8).normal(size=(13, 2, 3))
    for axis, direction in draws[[4, 12]] / np.linalg.norm(draws, axis=2)[[4, 12], :, None]:
        momentum = 0.78 * ARRAY.momenta.bounds.min() * ARRAY.inverse @ direction
        R = so3.exp(np.pi * axis)
        assert shortest(with_wheels, R, momentum, True)[0] > 0.1
        lacking, held = shortest(with_wheels, R, momentum, False)
        assert lacking < 3e-3
        assert held > 5
    with_wheels.solve(np.eye(3), np.zeros(3), wheel_momentum_n_m_s=momentum)
    assert not with_wheels._wheels.held  # where little torque is needed


def test_the_terminal_set_keeps_the_polytope_and_stored_momentum_costs_some_of_it() -> None:
    mpc = make(wheels(max_torque_n_m=1e-3), REACH, max_rate_rad_s=np.radians(20.0), step_s=0.5)
    design = mpc.terminal
    assert design.report.limiting == 'torque polytope'
    root = np.linalg.cholesky(np.linalg.inv(design.P))
    unit = np.random.default_rng(1).normal(size=(20_000, 6))
    xi = np.sqrt(design.c) * unit / np.linalg.norm(unit, axis=1, keepdims=True) @ root.T
    torques = mpc.config.wheels.torques  # type: ignore[union-attr]
    reached = np.abs(xi @ design.K.T @ torques.normals.T / torques.bounds).max()
    assert 0.9 < reached <= 1.0
    shares = []
    for scale in (0.0, 0.5, 1.0):
        mpc.solve(np.eye(3), np.zeros(3), wheel_momentum_n_m_s=scale * STORED)
        shares.append(mpc.terminal_share)
    assert 1.0 > shares[0] > shares[1] > shares[2] > 0.1
    stored = np.linalg.norm(ARRAY.matrix @ STORED)
    xi *= shares[2] ** 0.5
    need = np.abs(xi @ design.K.T @ torques.normals.T) + stored * np.linalg.norm(
        xi[:, 3:], axis=1)[:, None]
    assert (need / torques.bounds).max() <= 1.0


def test_motor_torques_are_those_of_the_first_torque(with_wheels: AttitudeMpc) -> None:
    R, omega = half_turns(1)[0], np.array([0.01, 0.02, -0.01])
    with_wheels.reset()
    plan = with_wheels.solve(R, omega, wheel_momentum_n_m_s=STORED)
    allocation = WheelAllocation(ARRAY, INERTIA, 1.0, omega, STORED, plan.torque_B_n_m)
    assert plan.wheel_torque_n_m is not None
    np.testing.assert_allclose(allocation.realised(plan.wheel_torque_n_m),
                               allocation.part() * plan.torque_B_n_m, atol=1e-15)
    assert with_wheels.solve(R, omega).wheel_torque_n_m is None
    for rate in (np.full(3, np.nan), np.array([1e9, 0.0, 0.0])):
        failed = with_wheels.solve(R, rate, wheel_momentum_n_m_s=STORED)
        assert failed.status == SolveStatus.FAILED
        assert failed.wheel_torque_n_m is not None
        assert not failed.wheel_torque_n_m.any()
    with pytest.raises(ConfigurationError, match='wheel_momentum_n_m_s'):
        with_wheels.solve(R, omega, wheel_momentum_n_m_s=np.zeros(3))
