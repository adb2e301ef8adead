# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a replay asks for: bits of the build that recorded, a tolerance of every other one."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from golden import GOLDEN

from manifold_mpc_ros.cli import provenance
from manifold_mpc_ros.lab.recording.bags.compare import Comparison, compare_torques
from manifold_mpc_ros.lab.recording.bags.run import BagRun, read_run
from manifold_mpc_ros.lab.recording.bags.series import CommandSeries
from manifold_mpc_ros.lab.recording.replay_plan import ReplayPlan


def plan(recorded: BagRun, rate: float | None = None) -> ReplayPlan:
    return ReplayPlan.of(recorded, None, None, rate)


@pytest.fixture(scope='module')
def recorded() -> BagRun:
    """A golden bag as if this build had recorded it."""
    run = read_run(GOLDEN / 'noisy_imu.mcap')
    versions = provenance.versions('some_rmw')
    return dataclasses.replace(
        run, description=dataclasses.replace(run.description, versions=versions, backend='c'))


def test_the_same_build_gives_the_same_bits(recorded: BagRun) -> None:
    assert plan(recorded).default_tolerance_n_m('c') == 0.0
    assert plan(recorded).default_tolerance_n_m('another') == 1e-9
    assert plan(recorded, rate=2.0).default_tolerance_n_m('c') == 0.05
    for changed in ('revision', 'processor', 'casadi'):
        other = {**recorded.description.versions, changed: 'another'}
        description = dataclasses.replace(recorded.description, versions=other)
        run = dataclasses.replace(recorded, description=description)
        assert plan(run).default_tolerance_n_m('c') == 1e-9, changed


def test_the_controller_gets_what_it_had(recorded: BagRun) -> None:
    planned = plan(recorded)
    had = recorded.description.controller_parameters
    for name in ('mpc.horizon', 'spacecraft.inertia_kg_m2', 'state_source', 'mpc.backend'):
        assert planned.parameters[name] == had[name]
    assert planned.feed.state_source == 'imu'
    assert [each.stamp_ns for each in planned.feed.states] == recorded.commands.stamp_ns.tolist()
    assert [each.topic for each in planned.feed.setpoints] == ['/attitude_setpoint'] * 2
    bytes_recorded = {message.data for message in recorded.contents.of('/imu_link')}
    assert {state.data for state in planned.feed.states} <= bytes_recorded


def commands(*torques: tuple[float, float, float]) -> CommandSeries:
    stamps = np.arange(1, len(torques) + 1, dtype=np.int64) * 1000
    return CommandSeries(stamps, 1e-9 * stamps, stamps, np.array(torques))


def test_comparison() -> None:
    given = commands((0.1, 0.0, 0.0), (0.2, 0.0, 0.0), (0.3, 0.0, 0.0))
    same = {1000: np.array([0.1, 0.0, 0.0]), 2000: np.array([0.2, 0.0, 0.0]),
            3000: np.array([0.3, 0.0, 0.0])}
    equal = compare_torques(given, same)
    assert equal.identical
    assert equal.first_beyond(0.0) is None
    near = compare_torques(given, {**same, 2000: np.array([0.2, np.nextafter(0, 1), 0.0])})
    assert (near.identical, near.first_beyond(0.0), near.first_beyond(1e-300)) == (False, 1, None)
    signed = compare_torques(given, {**same, 3000: np.array([0.3, -0.0, 0.0])})
    assert (signed.first_beyond(0.0), signed.first_beyond(1e-12)) == (2, None)
    without_two = {stamp: torque for stamp, torque in same.items() if stamp != 2000}
    missing = compare_torques(given, without_two)
    assert missing.unanswered == 1
    assert missing.first_beyond(1.0) == missing.first_beyond(0.0) == 1
    assert missing.first_beyond(0.01, unanswered=False) is None
    assert compare_torques(given, without_two, within_s=1.1e-6).unanswered == 0
    assert compare_torques(given, {}).unanswered == 3


def test_nan_is_never_within_a_tolerance() -> None:
    broken = Comparison(
        np.array([1]), np.array([0.0]), np.zeros((1, 3)), np.full((1, 3), np.nan))
    assert broken.first_beyond(1e9) == 0
    assert broken.unanswered == 1
