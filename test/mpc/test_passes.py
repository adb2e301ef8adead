# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How many passes solves of the compared instances take: what no machine's load changes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from manifold_mpc_ros import AttitudeMpc, SolveStatus
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lab.benchmark.peers.instances import draw
from manifold_mpc_ros.lab.benchmark.peers.problem import comparison_config
from manifold_mpc_ros.mpc.program.options import MOST_STARTS
from manifold_mpc_ros.mpc.search import starts

RANDOM = [each for each in draw(200) if each.kind == 'random']


@pytest.mark.parametrize('horizon', [20, 40])
def test_a_warm_tick_along_a_rate_limit_takes_whole_steps(horizon: int, cache_dir: Path) -> None:
    """Without the watchdog the longest took 20 and 16 passes, most of them steps of a third."""
    mpc = AttitudeMpc(comparison_config(horizon), cache_dir=cache_dir)
    config, passes = mpc.config, []
    for instance in (RANDOM[2], RANDOM[4]):
        R, omega = instance.R_NB, np.array(instance.omega_BN_B)
        mpc.reset()
        plan = mpc.solve(R, omega)
        for _ in range(5):
            R, omega = lgvi_step(R, omega, plan.torques_B_n_m[0],
                                 inertia_kg_m2=config.inertia_kg_m2, step_s=config.step_s)
            plan = mpc.solve(R, omega)
            assert plan.status is SolveStatus.CONVERGED
            assert not plan.searched
            passes.append(plan.iterations)
    assert max(passes) <= 12


def test_a_search_is_no_longer_where_the_horizon_goes_on_at_rest(cache_dir: Path) -> None:
    """The same slews with four times the steps: as many starts, and about as many passes."""
    passes = []
    for horizon in (20, 80):
        mpc = AttitudeMpc(comparison_config(horizon), cache_dir=cache_dir)
        of_horizon = []
        for instance in RANDOM[:40]:
            mpc.reset()
            of_horizon.append(
                mpc.solve(instance.R_NB, np.array(instance.omega_BN_B)).iterations)
        passes.append(sum(of_horizon))
    assert passes[1] <= 1.5 * passes[0]


def test_the_search_has_room_for_every_start() -> None:
    """A nearly time-optimal turn on a long horizon has most; C keeps a cost for each."""
    config = replace(comparison_config(40), torque_weight=1e-4 * np.eye(3))
    assert len(starts(config)) == MOST_STARTS
    assert len(starts(replace(config, horizon=500))) == MOST_STARTS
