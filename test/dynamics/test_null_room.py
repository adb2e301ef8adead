# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The null space of four wheels along a plan: exactly the momenta that leave its rest possible."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from properties import EXAMPLES, PROPERTY
from scipy.optimize import linprog
from wheel_cases import wheels

from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.dynamics.null_room import null_room

STEP_S, STEPS = 2.0, 12


def drawn(rng: np.random.Generator, size: float) -> tuple[WheelArray, np.ndarray]:
    """Return four of five wheels and momenta in body axes that go to and fro, of this size."""
    works = np.arange(5) != rng.integers(5)
    array = WheelArray(rng.normal(size=(5, 3)), rng.uniform(1, 2, 5) * 1e-3,
                       rng.uniform(1, 2, 5) * 1e-2, works)
    ends = rng.uniform(-1.0, 1.0, size=(3, 5)) * size * array.max_momentum_n_m_s
    turns = np.abs(np.linspace(-1.0, 1.0, STEPS + 1))[:, None]
    return array, (turns * ends[0] + (1 - turns) * ends[1] + 0.1 * ends[2]) @ array.matrix.T


def by_program(array: WheelArray, stored_B: np.ndarray) -> list[float] | None:
    """Return the ends of the nu_0 of which some nu_0 ... nu_N keep every limit; None: none do."""
    used, line = array.available, array.null_basis[:, 0]
    base = 1e3 * stored_B @ array.inverse.T
    choose = np.eye(STEPS + 1)
    sides, room = [], []
    for row, offset, limit in (
            *((choose[k], base[k], array.max_momentum_n_m_s) for k in range(STEPS + 1)),
            *((choose[k + 1] - choose[k], base[k + 1] - base[k], STEP_S * array.max_torque_n_m)
              for k in range(STEPS))):
        for sign in (1.0, -1.0):
            sides.append(np.outer(sign * line[used], row))
            room.append(1e3 * limit[used] - sign * offset[used])
    found = [linprog(sign * choose[0], A_ub=np.vstack(sides), b_ub=np.concatenate(room),
                     bounds=[(None, None)] * (STEPS + 1)) for sign in (1.0, -1.0)]
    return None if found[0].status != 0 else [1e-3 * found[0].fun, -1e-3 * found[1].fun]


def test_the_room_is_that_of_a_linear_program_over_the_whole_plan() -> None:
    rng = np.random.default_rng(21)
    possible = 0
    for size in np.linspace(0.2, 1.3, 40):
        array, stored = drawn(rng, size)
        room, gap = null_room(array, stored, STEP_S)
        ends = by_program(array, stored)
        assert (ends is not None) == (gap <= 1e-12)
        if ends is not None:
            possible += 1
            np.testing.assert_allclose(room[0], ends, atol=1e-9)
    assert 10 < possible < 35


@settings(PROPERTY, max_examples=EXAMPLES // 5)
@given(seed=st.integers(0, 2 ** 32 - 1), size=st.floats(0.1, 1.1), part=st.floats(0.0, 1.0))
def test_whoever_stays_in_the_room_follows_the_plan_within_every_limit(
    seed: int, size: float, part: float,
) -> None:
    array, stored = drawn(np.random.default_rng(seed), size)
    room, gap = null_room(array, stored, STEP_S)
    assert (room[:, 0] <= room[:, 1]).all()
    if gap > 0.0:
        return
    used, base, line = array.available, stored @ array.inverse.T, array.null_basis[:, 0]
    nu = [room[0] @ [1.0 - part, part]]
    for k in range(STEPS):  # anywhere in the room that the motors reach
        limit = STEP_S * array.max_torque_n_m
        moved = np.diff(base, axis=0)[k]
        ends = np.sort((np.array([-limit, limit]) - moved)[:, used] / line[used],
                       axis=0)
        low = max(nu[-1] + ends[0].max(), room[k + 1, 0])
        high = min(nu[-1] + ends[1].min(), room[k + 1, 1])
        assert low <= high + 1e-12
        nu.append((1.0 - part) * low + part * high)
    momenta = base + np.outer(nu, line)
    np.testing.assert_allclose(momenta @ array.matrix.T, stored, atol=1e-15)
    assert (np.abs(momenta) <= array.max_momentum_n_m_s * (1 + 1e-9)).all()
    assert (np.abs(np.diff(momenta, axis=0)) <= STEP_S * array.max_torque_n_m * (1 + 1e-9)).all()


def test_wheels_whose_null_space_rests_give_and_store_the_held_sets() -> None:
    rng = np.random.default_rng(22)
    for array in (wheels(), *(drawn(rng, 0.5)[0] for _ in range(20))):
        held, whole = array.held(array.max_torque_n_m), array.torques
        assert len(held.normals) <= len(whole.normals)
        torques = rng.normal(size=(50, 3))
        torques /= np.array([held.gauge(each) for each in torques])[:, None]
        np.testing.assert_allclose(
            np.max(np.abs(torques @ array.inverse.T / array.max_torque_n_m), axis=1), 1.0)
        assert max(map(whole.gauge, torques)) <= 1.0 + 1e-12
