# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The search goes round cones on either side; targets that cones forbid are held off."""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cases import configuration
from reference import closed_loop
from strategies import generator, unit_vectors

from manifold_mpc_ros.config.cones import Cone, directions, tightened
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import SolveStatus
from manifold_mpc_ros.terminal.cone_cut import cut_level, spread, target_margins_rad
from manifold_mpc_ros.terminal.problem_of import terminal_design

sys.path.insert(0, str(Path(__file__).parents[2] / 'benchmarks'))

from cone_problems import problem

Make = Callable[..., AttitudeMpc]

SLOW = {'max_torque_n_m': 0.3, 'max_rate_rad_s': 0.3, 'horizon': 40, 'forcing': 'symmetric'}
SUN = Cone('sun', (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.5)
FAR = Cone('far', (0.0, 0.0, 1.0), (0.0, 0.0, 1.0), 3.0, 'keep_in')


def random_problem(rng: np.random.Generator) -> tuple[AttitudeMpcConfig, Array]:
    """Return two random cones and a start whose straight way crosses one."""
    parts = np.linspace(0.0, 1.0, 9)[:, None, None]
    while True:
        cones = [Cone(name, axis, s, rng.uniform(0.2, 0.9)) for name, axis, s in zip(
            ('a', 'b'), unit_vectors(rng, 2), unit_vectors(rng, 2))]
        config = configuration(**SLOW, cones=cones)
        R = so3.random_rotations(rng, 1)[0]
        margins = np.min([cone.margins_rad(so3.exp(parts[:, 0] * so3.log(R)))
                          for cone in config.kept_cones], axis=0)
        if margins[[0, -1]].min() > 0.1 and margins.min() < -0.1:
            return config, R


def best_of_many_starts(mpc: AttitudeMpc) -> float:
    """Return the least cost of starts by way of 24 attitudes, dimensionless.

    The state of the last solve is set.
    """
    solver, best = mpc.solver, math.inf
    solver.use_set(True)
    for via in so3.random_rotations(generator('vias'), 24):
        solver.begin_way(so3.quaternion_from_rotation(via))
        solver.iterate(200)
        if solver.progress.converged:
            best = min(best, solver.progress.cost)
    return best


def test_no_way_by_another_attitude_is_better(controller: Make) -> None:
    rng, terminal = generator('cone ways'), controller(**SLOW, cones=[SUN, FAR]).terminal
    held = 0
    for _ in range(8):
        config, R = random_problem(rng)
        mpc = AttitudeMpc(config, terminal=terminal)
        plan = mpc.solve(R, np.zeros(3))
        assert plan.status == SolveStatus.CONVERGED
        found = plan.cost / mpc._unit.cost
        assert found <= best_of_many_starts(mpc) * (1 + 1e-6)
        held += min(cone.margins_rad(plan.R_NB).min() for cone in config.kept_cones) < 1e-4
    assert held >= 3


@pytest.mark.parametrize('index', [198, 247, 352, 366])
def test_ways_that_were_missed_once_are_found(index: int, controller: Make) -> None:
    """A plan past a cone that touches none, and half turns with a cone near one side."""
    given = problem(index)
    mpc = AttitudeMpc(given.config, terminal=controller(**SLOW, cones=[SUN, FAR]).terminal)
    plan = mpc.solve(given.R_NB, given.omega_BN_B, given.R_ND)
    assert plan.status == SolveStatus.CONVERGED
    best = best_of_many_starts(mpc)
    assert plan.cost / mpc._unit.cost <= best * (1 + 1e-6)


def test_straight_at_the_middle_of_a_cone_is_gone_round(controller: Make) -> None:
    """Every planar plan stays in the plane, where the cone cannot be passed."""
    mpc = controller(**SLOW, cones=[SUN, FAR])
    plan = mpc.solve(so3.exp([0.0, 0.0, 2.6]), np.zeros(3))
    assert plan.status == SolveStatus.CONVERGED
    assert plan.searched
    mpc.reset()
    assert mpc.solve_local(so3.exp([0.0, 0.0, 2.6]), np.zeros(3)).violation > 0.1


def test_a_cone_that_moves_starts_a_search_only_when_it_breaks_the_plan(controller: Make) -> None:
    mpc, R = controller(**SLOW, cones=[SUN, FAR]), so3.exp([0.0, 0.2, 1.7])
    plan = mpc.solve(R, np.zeros(3), directions_N={'sun': (-1.0, 0.0, 0.2)})
    searched = []
    for sun in ((-1.0, 0.1, 0.2), (-1.0, 0.2, 0.2), (0.6, 0.5, 0.0), (0.6, 0.5, 0.0)):
        R, omega = plan.R_NB[1], plan.omega_BN_B[1]
        plan = mpc.solve(R, omega, directions_N={'sun': sun})
        assert plan.status == SolveStatus.CONVERGED
        searched.append(plan.searched)
    assert searched == [False, False, True, False]


def test_closed_loops_keep_cones_and_the_value_falls(controller: Make) -> None:
    """Recursive feasibility and decrease are as without cones: no status but 'converged'."""
    mpc = controller(**SLOW, cones=[SUN, FAR])
    for R in so3.exp([[0.0, 0.0, 2.6], [0.8, 0.3, 2.4]]):
        mpc.reset()
        ticks = closed_loop(mpc, R, np.zeros(3), 60)
        assert {tick.plan.status for tick in ticks} == {SolveStatus.CONVERGED}
        assert min(cone.margins_rad(tick.R) for tick in ticks
                   for cone in mpc.config.kept_cones) > -1e-6
        for before, after in itertools.pairwise(ticks):
            assert after.plan.cost <= before.plan.promised_cost + 1e-6
        assert so3.angle(ticks[-1].R) < 1e-2


def test_a_cone_cuts_the_terminal_set(controller: Make) -> None:
    """No attitude of the set violates it, and a set a little larger has one that does."""
    near = Cone('near', (1.0, 0.0, 0.0), (math.cos(0.8), math.sin(0.8), 0.0), 0.6)
    mpc = controller(**SLOW, cones=[near, FAR])
    design, kept = terminal_design(mpc.config), mpc.config.kept_cones[0]
    assert design.report.limiting == 'cone near'
    assert design.c < mpc.terminal.c
    root = np.linalg.cholesky(np.linalg.inv(design.P))
    unit = unit_vectors(generator('cut'), 20_000)
    errors = unit @ np.linalg.cholesky((root @ root.T)[:3, :3]).T
    least = [kept.margins_rad(so3.exp(math.sqrt(level) * errors)).min()
             for level in (design.c, 1.2 * design.c)]
    assert 0.0 < least[0] < 0.02
    assert least[1] < 0.0
    with pytest.raises(DesignError, match=r"cone 'near' forbids: \d.* degrees are missing"):
        terminal_design(configuration(**SLOW, cones=[
            Cone('near', (1.0, 0.0, 0.0), (1.0, 0.3, 0.0), 0.6)]))


def test_a_target_that_a_cone_forbids_is_held_off(controller: Make) -> None:
    mpc = controller(**SLOW, cones=[SUN, FAR])
    kept = mpc.config.kept_cones[0]
    target = so3.exp([0.0, 0.0, 1.3])
    plan = mpc.solve(so3.exp([0.2, 0.1, -0.5]), np.zeros(3), target)
    assert plan.status == SolveStatus.INFEASIBLE
    assert kept.margins_rad(target) < 0.0
    assert kept.margins_rad(plan.R_NB).min() > -1e-6
    assert kept.margins_rad(plan.R_NB[-1]) < 1e-3
    again = mpc.solve(so3.exp([0.2, 0.1, -0.5]), np.zeros(3))
    assert again.status == SolveStatus.CONVERGED


def test_the_solver_cuts_the_terminal_set_of_every_target(cache_dir: str) -> None:
    """As NumPy does, with a group and with directions that move."""
    group = [Cone(name, axis, axis, 2.3, 'keep_in', 'any')
             for name, axis in (('one', (0.0, 0.0, 1.0)), ('other', (0.0, 1.0, 0.0)))]
    config = configuration(**SLOW | {'horizon': 10}, cones=[SUN, *group])
    mpc, rng = AttitudeMpc(config, cache_dir=cache_dir, disturbed=True), generator('cut level')
    for i in range(30):
        R = so3.exp(rng.normal(size=3) * (0.3 if i % 3 else 2.0))
        turns = so3.exp(np.arange(11)[:, None] * rng.normal(size=3) * 0.05)
        given = {cone.name: turns @ cone.direction_N for cone in config.cones[:2]} if i % 2 else {}
        seen = directions(config.cones, given, 10)
        moved = np.linalg.norm(np.diff(seen, axis=0), axis=-1).max(axis=0)
        margins = target_margins_rad(config, tightened(
            config.cones, config.between_samples, moved.tolist()), R, seen)
        level = cut_level(mpc.terminal.c, margins, spread(config, mpc.terminal.P))
        mpc.solve(R, np.zeros(3), R, directions_N=given)
        found = mpc.solver._controller
        assert found.cone_level * found.allowed == pytest.approx(level, rel=1e-12)
