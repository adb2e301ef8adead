# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded runs whose target moves: what was commanded, the errors against it, the verdict."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from golden import GOLDEN, with_odometry_setpoint

from manifold_mpc_ros.control.guidance.laws import Guidance
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.recording.bags.measures import commands_at_s, settling_times
from manifold_mpc_ros.lab.recording.bags.run import BagRun, read_run
from manifold_mpc_ros.lab.recording.bags.verdict import judge
from manifold_mpc_ros.lab.recording.scenarios.scenario import Scenario

BAG = GOLDEN / 'guidance.mcap'
TEXT = BAG.with_suffix('.yaml').read_text(encoding='utf-8')


@pytest.fixture(scope='module')
def run() -> BagRun:
    return read_run(BAG)


def test_the_commanded_attitude_is_what_guidance_says_at_each_state(run: BagRun) -> None:
    assert run.scenario is not None
    later = run.states.time_s >= 13.0
    for mode, rows in (('nadir', ~later), ('spin', later)):
        law = Guidance(run.scenario.guidance_config(mode))
        np.testing.assert_allclose(
            run.R_ND[rows], law.attitudes(run.states.stamp_ns[rows]), atol=1e-9)
    rate = np.linalg.norm(run.states.omega_BN_B[-1])
    assert rate == pytest.approx(0.1, abs=1e-3)
    assert run.rate_error_rad_s[-1] < 1e-2 * rate


def test_a_jump_of_the_target_is_a_command_and_a_reference_that_goes_on_is_none(
    run: BagRun,
) -> None:
    assert commands_at_s(run) == [13.0]
    assert len(settling_times(run, 0.1, 0.01)) == 2
    one = run.references.trajectories[0]
    again = dataclasses.replace(run, references=dataclasses.replace(
        run.references, stamp_ns=run.references.stamp_ns[0] + np.array([0, 10**9]),
        time_s=np.array([0.0, 1.0]), received_ns=run.references.received_ns[[0, 0]],
        trajectories=(one, one)))
    assert commands_at_s(again) == []


def test_errors_are_judged_against_the_target_that_moves(run: BagRun) -> None:
    assert judge(run).passed
    without = dataclasses.replace(run, references=dataclasses.replace(
        run.references, stamp_ns=run.references.stamp_ns[:0], time_s=np.zeros(0),
        received_ns=run.references.received_ns[:0], trajectories=()))
    assert {'settle_time_s', 'final_error_deg'} <= set(judge(without).failed)


def test_an_odometry_setpoint_is_commanded_like_the_reference_that_it_stands_for(
    run: BagRun, tmp_path: Path,
) -> None:
    other = read_run(with_odometry_setpoint(tmp_path / 'bag'))
    assert len(run.contents.of('/reference')) == 1 + len(other.contents.of('/reference')) == 2
    np.testing.assert_allclose(other.R_ND, run.R_ND, atol=1e-9)
    np.testing.assert_allclose(other.rate_error_rad_s, run.rate_error_rad_s, atol=1e-9)
    assert commands_at_s(other) == [13.0]
    assert judge(other).passed


@pytest.mark.parametrize(('old', 'new', 'key'), [
    ('reference: {timeout_s: 30.0}', 'mpc: {horizon: 20}', 'controller.reference.timeout_s'),
    ('guidance: spin}', 'guidance: spin, cone: sun}', 'setpoints[1].cone'),
    ('guidance: spin}', 'guidance: spin, attitude_xyzw: [0, 0, 0, 1]}', 'setpoints[1]'),
    ('guidance: spin}', 'guidance: moon}', 'setpoints[1].guidance'),
    ('spin_rate_rad_s: 0.1', 'mode: spin', 'guidance.mode'),
    ('spin_rate_rad_s: 0.1', 'axis_B: [1.0, 0.0, 0.0]', 'guidance.second_axis_B'),
])
def test_scenarios_that_do_not_fit_are_refused(old: str, new: str, key: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        Scenario.from_text(TEXT.replace(old, new), 'changed')
    assert refused.value.key == key
