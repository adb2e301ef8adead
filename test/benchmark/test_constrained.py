# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The public slews with cones: data, plant, bound, profile and what is said of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from manifold_mpc_ros.config.cones import joined
from manifold_mpc_ros.lab.benchmark.constrained import bounds, fly, run, slews
from manifold_mpc_ros.lab.benchmark.constrained.plant import Bodies

SLEWS = {slew.name: slew for slew in slews.slews()}


def test_bodies_and_wheels_keep_their_momentum_together() -> None:
    slew = SLEWS['B1']
    assert slew.wheels is not None
    axes = slew.wheels.axes_B.T
    bodies = Bodies.at_rest(slew.inertia, axes, slew.start[None])
    bodies.omega[:] = 0.02, -0.01, 0.03

    def total() -> np.ndarray:
        return bodies.R_NB[0] @ (slew.inertia @ bodies.omega[0] + axes @ bodies.momenta[0])
    before = total()
    for k in range(200):
        bodies.step(np.zeros((1, 3)), 7e-4 * np.sin(0.1 * k + np.arange(4.0))[None], 0.05)
    assert np.linalg.norm(total() - before) < 1e-10 * np.linalg.norm(before)


@pytest.mark.parametrize('name', [name for name, slew in SLEWS.items() if slew.cones])
def test_start_and_target_keep_all_cones(name: str) -> None:
    slew = SLEWS[name]
    ends = [slew.start] if slew.axis_B is not None else [slew.start, slew.target]
    margins = np.array([cone.margins_rad(np.array(ends)) for cone in slew.cones])
    assert min(np.min(each) for each in joined(slew.cones, margins).values()) > 0.0


def test_the_bound_of_a_roll_is_that_of_full_torque_both_ways() -> None:
    found = bounds.time_optimal_s(SLEWS['B2, 110 deg'], lambda _: None)
    assert found == pytest.approx(2 * math.sqrt(math.radians(110) * 31046 / 1.2), rel=1e-4)


def test_a_roll_by_a_profile_begins_with_nearly_all_of_the_torque() -> None:
    slew = replace(SLEWS['B2, 90 deg, profile'], ticks=3)
    pilots, seen = fly.fly(slew, fly.frames_of(1), lambda _: None)
    (run_of_it,) = fly.judged(slew, pilots, seen)
    assert 0.9 < run_of_it['largest_torque'] < 1.0
    assert run_of_it['statuses'] == ['converged']


def test_a_flight_is_judged_by_what_was_seen() -> None:
    """A few ticks: not settled, no cone violated, one search; the table and the aims say so."""
    slew = replace(SLEWS['B4, slew 1'], ticks=3, bound='given', within=1.0)
    pilots, seen = fly.fly(slew, fly.frames_of(1), lambda _: None)
    runs = fly.judged(slew, pilots, seen)
    assert len(seen.time_s) == 3 * fly.FINER
    assert runs[0]['settled_s'] is None
    assert runs[0]['searches'] == 1
    assert 0.0 < runs[0]['largest_motor'] <= 1.0 + 1e-9
    assert min(runs[0]['least_margin_deg'].values()) > 0.0
    row = {'problem': slew.name, 'bound_s': 30.0, 'others_s': [], 'allowed_s': 30.0, 'runs': runs}
    found = run.targets([row], [])
    assert [aim['met'] for aim in found] == [False, True, True]
    console = Console(record=True, width=150)
    run.show(console, {'rows': [row], 'timing': [], 'targets': found, 'statement': ''})
    assert 'never' in console.export_text()
