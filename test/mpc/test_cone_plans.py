# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cones hold where they are given, between samples too, and would be broken without."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from cases import configuration
from reference import advance
from strategies import generator

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import SolveStatus

Make = Callable[..., AttitudeMpc]

SLOW = {'max_torque_n_m': 0.3, 'max_rate_rad_s': 0.3, 'horizon': 30, 'forcing': 'symmetric'}
CONES = (Cone('sun', (1.0, 0.0, 0.0), (0.2, 1.0, 0.3), 0.5),
         Cone('sensor', (0.0, 0.3, 1.0), (0.2, -0.1, 1.0), 1.4, 'keep_in'))
# A cone that is in nobody's way.
FAR = Cone('far', (0.0, 0.0, 1.0), (0.0, 0.0, 1.0), 3.0, 'keep_in')
SUN_ONLY = (CONES[0], FAR)


def margin(cones: tuple[Cone, ...], attitudes: Array) -> float:
    """Return the least margin [rad] of attitudes (n, 3, 3)."""
    return float(min(cone.margins_rad(attitudes).min() for cone in cones))


def crossing_starts(cones: tuple[Cone, ...], n: int) -> Array:
    """Return n random attitudes (n, 3, 3) clear of the cones whose way home crosses one."""
    found = so3.random_rotations(generator('cones'), 1000)
    ways = so3.exp(np.linspace(0.0, 1.0, 9)[:, None, None] * so3.log(found))
    margins = np.min([cone.margins_rad(ways) for cone in cones], axis=0)
    return found[(margins[-1] > 0.1) & (margins.min(axis=0) < -0.1)][:n]


def test_plans_keep_them_at_every_instant_and_would_break_them(controller: Make) -> None:
    """Between two samples: the plant under the plan's torques, integrated 10 times finer."""
    mpc, free = controller(**SLOW, cones=CONES), controller(**SLOW)
    fine = configuration(**{**SLOW, 'step_s': 0.05, 'rate_weight': np.eye(3)})
    broken = 0
    for R in crossing_starts(mpc.config.kept_cones, 6):
        mpc.reset()
        free.reset()
        plan, without = mpc.solve(R, np.zeros(3)), free.solve(R, np.zeros(3))
        assert plan.status == SolveStatus.CONVERGED
        assert margin(mpc.config.kept_cones, plan.R_NB) >= -1e-6
        omega, lowest = np.zeros(3), np.inf
        for tau in plan.torques_B_n_m:
            for _ in range(10):
                R, omega = advance(fine, R, omega, tau)
                lowest = min(lowest, margin(CONES, R[None]))
        assert lowest >= 0.0
        broken += margin(CONES, without.R_NB) < -0.05
    assert broken >= 4


def test_any_one_of_a_group_is_kept_at_every_instant(controller: Make) -> None:
    """One of two sensors sees the Sun all the way; by itself the slew leaves both in the dark."""
    sensors = tuple(Cone(name, axis, (0.3, 1.0, 0.4), 0.95, 'keep_in', 'sun') for name, axis in (
        ('y', (0.0, 1.0, 0.0)), ('x', (1.0, 0.0, 0.0))))
    mpc, free = controller(**SLOW, cones=sensors), controller(**SLOW)

    def seen(cones: tuple[Cone, ...], attitudes: Array) -> float:
        return float(np.max([cone.margins_rad(attitudes) for cone in cones], axis=0).min())

    fine = configuration(**{**SLOW, 'step_s': 0.05, 'rate_weight': np.eye(3)})
    switched, broken = 0, 0
    for R in so3.exp([[-1.62, -1.41, -0.59], [-2.8, -1.02, -0.1], [-0.44, 2.73, 0.0]]):
        mpc.reset()
        free.reset()
        plan, without = mpc.solve(R, np.zeros(3)), free.solve(R, np.zeros(3))
        assert plan.status == SolveStatus.CONVERGED
        omega, lowest = np.zeros(3), np.inf
        for tau in plan.torques_B_n_m:
            for _ in range(10):
                R, omega = advance(fine, R, omega, tau)
                lowest = min(lowest, seen(sensors, R[None]))
        assert lowest >= 0.0
        switched += sensors[0].margins_rad(plan.R_NB).min() < 0
        broken += seen(sensors, without.R_NB) < -0.05
    assert switched >= 2
    assert broken == 3


def test_a_far_cone_changes_nothing_but_rounding(controller: Make) -> None:
    also = Cone('also', (1.0, 0.0, 0.0), (1.0, 0.0, 0.0), 3.0, 'keep_in')
    wide, free = controller(**SLOW, cones=(FAR, also)), controller(**SLOW)
    for axis in np.eye(3):
        R = so3.exp(1.2 * axis)
        wide.reset()
        free.reset()
        np.testing.assert_allclose(wide.solve(R, np.zeros(3)).cost,
                                   free.solve(R, np.zeros(3)).cost, rtol=1e-7)


def test_a_start_inside_leaves_and_the_status_says_so(controller: Make) -> None:
    mpc, cone = controller(**SLOW, cones=SUN_ONLY), SUN_ONLY[0]
    to_sun = np.cross(cone.axis_B, cone.direction_N)
    R = so3.exp(to_sun / np.linalg.norm(to_sun) * (np.arcsin(np.linalg.norm(to_sun)) - 0.3))
    plan = mpc.solve(R, np.zeros(3))
    assert plan.status == SolveStatus.INFEASIBLE
    assert plan.violation > 0.1
    margins = cone.margins_rad(plan.R_NB)
    outside = np.flatnonzero(margins >= 0.0)[0]
    assert (np.diff(margins[:outside + 1]) > 0).all()  # out at once, and not in again
    assert margins[outside:].min() >= 0.0


def test_directions_move_at_run_time(controller: Make) -> None:
    """A direction that sweeps over the slew's way is kept at every node."""
    mpc = controller(**SLOW, cones=SUN_ONLY)
    kept = mpc.config.kept_cones[0]
    R = so3.exp([0.1, 0.3, 2.0])
    angles = np.linspace(0.8, 1.1, 31)
    sweep = np.stack([np.cos(angles), np.sin(angles), np.zeros(31)], axis=1)
    plan = mpc.solve(R, np.zeros(3), directions_N={'sun': sweep})
    assert plan.status == SolveStatus.CONVERGED
    moving = mpc.config.cones[0].tightened(mpc.config.between_samples, 0.01)
    assert moving.half_angle_rad > kept.half_angle_rad
    assert abs(moving.margins_rad(plan.R_NB, sweep).min()) < 1e-6
    mpc.reset()
    again = mpc.solve(R, np.zeros(3))
    assert abs(again.cost - plan.cost) > 1e-3 * plan.cost
    assert kept.margins_rad(again.R_NB).min() >= -1e-6


def test_frames_turned_together_give_the_same_torque(controller: Make) -> None:
    mpc = controller(**SLOW, cones=SUN_ONLY)
    R, Q = so3.exp([0.0, 0.3, 2.0]), so3.exp([0.4, -1.0, 0.7])
    one = mpc.solve(R, np.zeros(3)).torque_B_n_m
    mpc.reset()
    other = mpc.solve(Q @ R, np.zeros(3), Q, directions_N={'sun': Q @ CONES[0].direction_N})
    np.testing.assert_allclose(other.torque_B_n_m, one, atol=1e-6)
    assert other.status == SolveStatus.CONVERGED
