# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sides of turns on paths made by hand, and against a lift one step at a time."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from strategies import generator, unit_vectors

from manifold_mpc_ros.lab.campaign import turning
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

AXES = unit_vectors(generator('turning'), 5)


def about(axis: Array, degrees: Array | list[float]) -> Array:
    """Return rotations by angles, full turns included."""
    return so3.exp(np.radians(np.asarray(degrees, dtype=float))[..., None] * axis)


def plans_to(axis: Array, begins: list[float], ends: list[float], steps: int = 8) -> Array:
    """Return a plan for each tick: evenly from an angle to another one [deg]."""
    return np.array([about(axis, np.linspace(begin, end, steps + 1))
                     for begin, end in zip(begins, ends, strict=True)])


def sides(axis: Array, begins: list[float], ends: list[float]) -> list[float]:
    return turning.sides_of_turn(
        about(axis, begins), plans_to(axis, begins, ends)).tolist()


@pytest.mark.parametrize('axis', AXES)
@pytest.mark.parametrize(('begins', 'ends', 'expected'), [
    ([170, 120, 60], [0, 0, 0], [1, 1, 1]),                  # the short way
    ([170, 220, 300], [360, 360, 360], [-1, -1, -1]),        # the long way, through 180
    ([170, 170, 170, 170], [0, 360, 0, 360], [1, -1, 1, -1]),   # chatter at rest
    ([150, 175, 175, 100], [360, 360, 0, 0], [-1, -1, 1, 1]),   # one change of mind
    ([300, 360, 420, 500], [720, 720, 720, 720], [-1, -1, -1, -1]),  # more than one turn
    ([170, 170], [180, 180], [0, 0]),                        # ends on neither side
])
def test_sides_of_paths_made_by_hand(
    axis: Array, begins: list[float], ends: list[float], expected: list[float],
) -> None:
    assert sides(axis, begins, ends) == expected


def test_one_plan_from_exactly_180_degrees_leads_to_each_side() -> None:
    for axis in AXES:
        found = sides(axis, [180, 180], [0, 360])
        assert sorted(found) == [-1, 1]


def test_changes_are_counted_from_tick_to_tick() -> None:
    assert turning.count_changes(np.array([1.0, 1.0, 1.0])) == 0
    assert turning.count_changes(np.array([1.0, -1.0, -1.0])) == 1
    assert turning.count_changes(np.array([1.0, -1.0, 1.0, -1.0])) == 3
    assert turning.count_changes(np.array([0.0, 1.0, 1.0])) == 1
    assert turning.count_changes(np.array([1.0])) == 0


def test_random_paths_agree_with_a_lift_step_by_step() -> None:
    rng = generator('lift')
    for _ in range(20):
        path = walk(rng, np.eye(3) if rng.uniform() < 0.2 else so3.random_rotations(rng, 1)[0], 12)
        plans = np.array([walk(rng, start, 9) for start in path])
        expected, q = [], so3.quaternion_from_rotation(path[0])
        for k, plan in enumerate(plans):
            q = continued(q, path[k])
            expected.append(np.sign(functools.reduce(continued, plan[1:], q)[0]))
        assert np.array_equal(turning.sides_of_turn(path, plans), expected)
        assert set(expected) <= {1.0, -1.0}


def walk(rng: np.random.Generator, start: Array, steps: int) -> Array:
    """Return a path of random steps of 40 to 80 degrees (steps + 1, 3, 3)."""
    path = [start]
    for axis in unit_vectors(rng, steps):
        path.append(path[-1] @ so3.exp(rng.uniform(0.7, 1.4) * axis))
    return np.array(path)


def continued(q: Array, R: Array) -> Array:
    """Return the quaternion of R that is nearer to q."""
    following = so3.quaternion_from_rotation(R)
    return following if following @ q >= 0 else -following


def count_reversals(begins: list[float], ends: list[float], turned: Array | None = None) -> int:
    """Count on the sphere, b = z, for rotations about x [deg], seen from a turned inertial frame.

    Gamma is by the angle away from b.
    """
    x, z = np.eye(3)[0], np.eye(3)[2]
    rolled = np.eye(3) if turned is None else turned
    found = turning.reversals(z, rolled @ about(x, begins), rolled @ plans_to(x, begins, ends))
    assert found.shape == (len(begins),)
    return int(found.sum())


@pytest.mark.parametrize(('begins', 'ends', 'expected'), [
    ([170, 160, 140], [0, 0, 0], 0),
    ([170, 180, 190, 200], [360, 360, 360, 360], 0),      # through the antipode
    ([170, 170, 170], [0, 360, 0], 2),                    # chatter in the far half
    ([150, 175, 175, 100], [360, 360, 0, 0], 1),
    ([60, 60, 60], [0, 360, 0], 0),                       # the near half does not count
    ([170, 170, 170], [170, 170, 170], 0),                # no motion, no direction
    ([170, 170, 170], [0, 170, 360], 0),                  # nor a turn from or to none
])
def test_reversals_of_paths_made_by_hand(
    begins: list[float], ends: list[float], expected: int,
) -> None:
    assert count_reversals(begins, ends) == expected
    for roll in (0.3, 2.0, -3.0):
        assert count_reversals(begins, ends, about(np.eye(3)[2], np.degrees(roll))) == expected


def test_a_quarter_turn_of_the_direction_is_none_and_more_is_one() -> None:
    z, start = np.eye(3)[2], about(np.eye(3)[0], 170.0)
    for heading, expected in (
            (0, False), (80, False), (100, True), (180, True), (-100, True), (-80, False)):
        gamma = start.T @ z
        axis = about(gamma, heading) @ np.eye(3)[0]
        plans = np.array([start @ about(np.eye(3)[0], np.linspace(0, 60, 7)),
                          start @ about(axis, np.linspace(0, 60, 7))])
        assert turning.reversals(z, np.array([start, start]), plans).tolist() == [False, expected]


def test_a_planned_rest_before_the_motion_does_not_hide_it() -> None:
    x, z = np.eye(3)[0], np.eye(3)[2]
    resting = [170.0, 170.0, 170.0]
    plans = about(x, [[*resting, 150.0], [*resting, 190.0]])
    assert turning.reversals(z, about(x, [170.0, 170.0]), plans).tolist() == [False, True]


def test_roll_is_what_turns_about_the_axis() -> None:
    b = AXES[0]
    tilt = so3.exp([0.5, -0.2, 0.1])
    assert np.degrees(turning.roll_turned(b, tilt @ about(b, [0.0, 50.0, 120.0, 200.0]))) == (
        pytest.approx(200.0))
    assert turning.roll_turned(b, tilt @ about(b, [0.0, 50.0, 0.0])) == pytest.approx(0.0)
    across = np.cross(b, AXES[1])
    assert turning.roll_turned(b, about(across / np.linalg.norm(across), [0.0, 60.0, 110.0])) == (
        pytest.approx(0.0, abs=1e-12))
