# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the report page derives from the states of a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from manifold_mpc_ros.lab.recording.bags.run import BagRun, read_run
from manifold_mpc_ros.lab.report import motion
from manifold_mpc_ros.lab.report.page import label
from manifold_mpc_ros.lab.tune.rule import bang_bang_time_s

GOLDEN = Path(__file__).parent / 'golden'


@pytest.fixture(scope='module')
def run() -> BagRun:
    return read_run(GOLDEN / 'half_turn.mcap')


def test_error_by_axis_has_the_length_of_the_error(run: BagRun) -> None:
    np.testing.assert_allclose(
        np.linalg.norm(motion.error_vectors_deg(run), axis=1), np.degrees(run.error_rad),
        atol=1e-6)


def test_quaternions_are_continuous(run: BagRun) -> None:
    q = motion.quaternions_wxyz(run)
    assert (np.sum(q[1:] * q[:-1], axis=1) > 0.0).all()


def test_momentum_and_energy_are_those_of_the_rate(run: BagRun) -> None:
    assert run.scenario is not None
    config = run.scenario.controller_config.mpc
    momentum, energy = motion.momentum_N(run, config), motion.energy_j(run, config)
    rates = np.linalg.solve(config.inertia_kg_m2, np.einsum(
        'nji,nj->in', run.states.R_NB, momentum)).T
    np.testing.assert_allclose(rates, run.states.omega_BN_B, atol=1e-12)
    np.testing.assert_allclose(
        energy, np.sum(rates @ config.inertia_kg_m2 * rates, axis=1) / 2.0, atol=1e-12)


def test_the_bang_bang_slew_is_that_of_tune(run: BagRun) -> None:
    """It begins at the first error, ends at none after the bound, and is at rest at both ends."""
    assert run.scenario is not None
    config = run.scenario.controller_config.mpc
    reference = motion.bang_bang(run, config)
    assert reference is not None
    time_s, angle_deg = reference
    vector = np.radians(motion.error_vectors_deg(run)[0])
    angle = float(np.linalg.norm(vector))
    assert time_s[-1] == pytest.approx(bang_bang_time_s(config, vector / angle, angle))
    assert angle_deg[[0, -1]] == pytest.approx([np.degrees(angle), 0.0], abs=1e-6)
    speed = -np.diff(np.radians(angle_deg)) / np.diff(time_s)
    assert speed.min() >= 0.0
    assert speed.max() <= config.max_rate_rad_s.max() * (1 + 1e-9)
    assert speed[[0, -1]].max() < 0.05 * speed.max()


def test_margins_are_beside_the_limits(run: BagRun) -> None:
    found = {each.name: each for each in motion.margins(run)}
    assert list(found) == ['peak torque', 'peak rate', 'final rate']
    assert -1e-2 < found['peak torque'].left <= 1.0
    assert found['peak torque'].limit.endswith('N m')


@pytest.mark.parametrize(('key', 'words'), [
    ('settle_time_s', 'settling time'), ('final_error_deg', 'final error'),
    ('peak_torque_n_m', 'peak torque'), ('peak_rate_rad_s', 'peak rate'),
    ('solver_time_p99_ms', 'solve time, 99 %'), ('fallback_ticks', 'fallback ticks')])
def test_keys_are_said_in_words(key: str, words: str) -> None:
    assert label(key) == words
