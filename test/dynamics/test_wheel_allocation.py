# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motor torques of a body torque: exact within the limits, the least ones, the null space."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog
from wheel_cases import INERTIA, wheels

from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.dynamics.wheel_allocation import _CROWDED as CROWDED
from manifold_mpc_ros.dynamics.wheel_allocation import WheelAllocation


def drawn(n: int, rng: np.random.Generator, null_space: str = 'least_torque') -> WheelAllocation:
    """Return an allocation of a random array, state and torque."""
    array = WheelArray(rng.normal(size=(n, 3)), rng.uniform(1, 2, n) * 1e-3, 1e-2,
                       null_space=null_space)
    return WheelAllocation(array, INERTIA, 2.0, 0.02 * rng.normal(size=3),
                           rng.uniform(-8e-3, 8e-3, n), 1.5e-3 * rng.normal(size=3))


def largest_part(allocation: WheelAllocation, array: WheelArray) -> float:
    """Return the largest s of ``W u = demand(s)``, low <= u <= high, by a linear program."""
    rest, whole = 1e3 * allocation.demand(0.0), 1e3 * allocation.demand()
    found = linprog(
        [-1.0, *np.zeros(len(array))], b_eq=rest,
        A_eq=np.column_stack([rest - whole, array.matrix]),
        bounds=[(0, 1), *zip(1e3 * allocation.low, 1e3 * allocation.high)])
    return -float(found.fun) if found.status == 0 else 0.0


def least_use(allocation: WheelAllocation, array: WheelArray, part: float) -> float:
    """Return the least s of ``s low <= u <= s high``, ``W u = demand(part)``, likewise."""
    n = len(array)
    high, low = 1e3 * allocation.high[:, None], 1e3 * allocation.low[:, None]
    found = linprog(
        [1.0, *np.zeros(n)], b_eq=1e3 * allocation.demand(part),
        A_eq=np.column_stack([np.zeros(3), array.matrix]), b_ub=np.zeros(2 * n),
        A_ub=np.block([[-high, np.eye(n)], [low, -np.eye(n)]]),
        bounds=[(0, None)] + [(None, None)] * n)
    return float(found.fun)


def assert_nearest(allocation: WheelAllocation, array: WheelArray, motor: np.ndarray) -> None:
    """Assert that no change of motor torques within the limits brings ``W u`` nearer."""
    slope = array.matrix.T @ (array.matrix @ motor - allocation.demand())
    rising = np.where(motor < allocation.high * (1 - 1e-9), slope, 0.0)
    falling = np.where(motor > allocation.low * (1 - 1e-9), slope, 0.0)
    assert (motor <= allocation.high).all()
    assert (motor >= allocation.low).all()
    assert min(rising.min(), -falling.max()) > -1e-9 * np.abs(allocation.demand()).max()


@pytest.mark.parametrize('n', [3, 4, 5, 6])
def test_exact_least_and_within_limits_against_linear_programs(n: int) -> None:
    rng = np.random.default_rng(n)
    scaled = compared = 0
    for _ in range(40):
        allocation = drawn(n, rng)
        array, part = allocation._wheels, allocation.part()
        largest = largest_part(allocation, array)
        motor = allocation.motor_torques(part)
        if largest == 0.0:  # whatever its size: the nearest is given
            scaled += part == 1.0
            assert_nearest(allocation, array, motor)
            continue
        assert part == pytest.approx(largest, abs=1e-6)
        scaled += part < 1.0
        assert (motor <= allocation.high * (1 + 1e-9)).all()
        assert (motor >= allocation.low * (1 + 1e-9)).all()
        np.testing.assert_allclose(
            allocation.realised(motor), part * allocation._torque, atol=1e-14)
        use = np.max(np.maximum(motor / allocation.high, motor / allocation.low))
        least = least_use(allocation, array, part)
        if np.abs(allocation._momentum).max() <= CROWDED * 1e-2:
            assert use == pytest.approx(least, rel=1e-5, abs=1e-8)
            compared += 1
        else:  # momentum that is near its limit is relieved beside the torque
            assert least * (1 - 1e-5) <= use <= 1 + 1e-9
    assert 0 < scaled < 40
    assert 5 < compared < 40


@pytest.mark.parametrize('null_space', ['away_from_zero', 'balanced'])
@pytest.mark.parametrize('n', [3, 4, 6])
def test_the_null_space_turns_nothing_and_breaks_no_limit(n: int, null_space: str) -> None:
    rng = np.random.default_rng(10 + n)
    moved = 0.0
    for _ in range(20):
        allocation = drawn(n, rng, null_space)
        array, part = allocation._wheels, allocation.part()
        motor = allocation.motor_torques(part)
        assert (motor <= allocation.high * (1 + 1e-9)).all()
        assert (motor >= allocation.low * (1 + 1e-9)).all()
        if largest_part(allocation, array) > 0.0:
            np.testing.assert_allclose(
                allocation.realised(motor), part * allocation._torque, atol=1e-14)
            moved += np.abs(motor - allocation._least(allocation.demand(part))).max()
    assert (moved > 1e-9) == (n > 3)


@pytest.mark.parametrize('n', [4, 5, 6])
def test_the_nearest_torque_is_given_where_wheels_are_full(n: int) -> None:
    rng = np.random.default_rng(30 + n)
    for _ in range(15):
        array = WheelArray(rng.normal(size=(n, 3)), rng.uniform(1, 2, n) * 1e-3, 1e-2)
        full = rng.choice([-1e-2, 1e-2], n) * np.where(rng.uniform(size=n) < 0.5, 1.0, 0.3)
        allocation = WheelAllocation(
            array, INERTIA, 2.0, 0.05 * rng.normal(size=3), full, 1.5e-3 * rng.normal(size=3))
        motor = allocation._most(1.0)
        if np.abs(array.matrix @ motor - allocation.demand()).max() > 1e-12:
            assert_nearest(allocation, array, motor)
        assert (motor <= allocation.high * (1 + 1e-9)).all()
        assert (motor >= allocation.low * (1 + 1e-9)).all()


def settled(null_space: str, momentum: np.ndarray) -> np.ndarray:
    """Return the momenta after a long time without a torque, the body at rest."""
    array = wheels(null_space=null_space)
    for _ in range(200):
        allocation = WheelAllocation(array, INERTIA, 2.0, np.zeros(3), momentum, np.zeros(3))
        momentum = momentum + 2.0 * allocation.motor_torques()
    return momentum


def test_momenta_go_where_the_null_space_leads_them() -> None:
    begin = np.array([5e-3, -3e-3, 4e-3, 1e-3])
    array = wheels()
    np.testing.assert_array_equal(settled('least_torque', begin), begin)
    apart, balanced = settled('away_from_zero', begin), settled('balanced', begin)
    for end in (apart, balanced):
        np.testing.assert_allclose(array.matrix @ end, array.matrix @ begin, atol=1e-16)
    assert np.abs(settled('away_from_zero', np.zeros(4))).min() > 0.29 * 2e-2
    assert np.abs(balanced).max() < np.abs(begin).max()
    least = np.abs(begin + np.multiply.outer(
        np.linspace(-0.02, 0.02, 4001), array.null_basis[:, 0])).max(axis=1).min()
    assert np.abs(balanced).max() == pytest.approx(least, rel=1e-3)
