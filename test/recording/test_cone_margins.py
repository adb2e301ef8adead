# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cones of recorded runs: directions from topics, margins between samples, the verdict."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from golden import GOLDEN

from manifold_mpc_ros.config.cones import Cone, between_samples, joined
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.recording.bags.cones import (
    cone_histories,
    least_margins_rad,
    violated_s,
)
from manifold_mpc_ros.lab.recording.bags.run import BagRun, read_run
from manifold_mpc_ros.lab.recording.bags.verdict import judge
from manifold_mpc_ros.lab.recording.scenarios.scenario import Scenario
from manifold_mpc_ros.lab.reference import cone_history
from manifold_mpc_ros.lab.reference.cone_history import ConeHistory
from manifold_mpc_ros.lie import so3

BAG = GOLDEN / 'cone.mcap'
TEXT = BAG.with_suffix('.yaml').read_text(encoding='utf-8')


@pytest.fixture(scope='module')
def run() -> BagRun:
    return read_run(BAG)


def test_directions_come_from_the_topic_at_their_times(run: BagRun) -> None:
    history, = cone_histories(run)
    later = run.states.time_s >= 2.0
    np.testing.assert_allclose(history.direction_N[~later], np.broadcast_to(
        np.array([0.5, 0.8660254, 0.05]) / np.linalg.norm([0.5, 0.8660254, 0.05]), (4, 3)))
    assert (history.direction_N[later] == history.direction_N[-1]).all()
    assert history.direction_N[-1, 0] > history.direction_N[0, 0]
    np.testing.assert_allclose(history.axis_N, run.states.R_NB[:, :, 0])


def test_the_verdict_says_for_how_long_a_cone_is_not_kept_and_by_how_much(run: BagRun) -> None:
    kept = next(each for each in judge(run).judgements if each.name == 'cone_violation_s')
    assert kept.passed
    assert kept.measured.startswith('0 s (least margin 0.')
    wider = dataclasses.replace(run, scenario=Scenario.from_text(
        TEXT.replace('half_angle_deg: 20.0', 'half_angle_deg: 21.0'), 'wider'))
    broken = next(each for each in judge(wider).judgements if each.name == 'cone_violation_s')
    assert not broken.passed
    found = violated_s(wider)
    assert found is not None
    assert found[0] >= 0.5
    assert found[2] == pytest.approx(violated_s(run)[2] - np.radians(1.0))  # type: ignore[index]
    without = dataclasses.replace(run, scenario=Scenario.from_text(
        'description: none\nduration_s: 14.0\nacceptance: {cone_violation_s: 0.0}', 'none'))
    assert not judge(without).passed


def test_the_bound_between_states_holds_and_is_tight(run: BagRun) -> None:
    """Of random motions within the limits, against 40 times finer steps."""
    config = run.scenario.controller_config.mpc  # type: ignore[union-attr]
    rng, directions = np.random.default_rng(3), (0.3, 0.9, 0.1)
    single = [[Cone('c', (1.0, 0.0, 0.0), directions, 1.2, kind)]
              for kind in ('keep_out', 'keep_in')]
    group = [Cone(f'c{i}', axis, directions, 1.0, 'keep_in', 'any')
             for i, axis in enumerate(np.eye(3)[:2])]
    for cones in (*single, group):
        R = so3.random_rotations(rng, 200)
        omega = rng.uniform(-0.2, 0.2, (200, 3))
        tau = 0.3 * rng.choice([-1.0, 1.0], (200, 3))
        path, rates = [R], [omega]
        for _ in range(40):
            R, omega = lgvi_step(R, omega, tau, inertia_kg_m2=config.inertia_kg_m2,
                                 step_s=config.step_s / 40)
            path.append(R)
            rates.append(omega)
        rate = max(float(np.linalg.norm(rates[end], axis=1).max()) for end in (0, -1))
        between = between_samples(
            config.inertia_kg_m2, config.largest_acceleration_rad_s2, rate, config.step_s)
        closest = np.inf
        for i in range(200):
            way = np.array([each[i] for each in path])
            true, = joined(cones, np.array([cone.margins_rad(way) for cone in cones])).values()
            bound, = cone_history.least_margins_rad([ConeHistory(
                cone, way[[0, -1]] @ cone.axis_B, np.tile(cone.direction_N, (2, 1)))
                for cone in cones], [between]).values()
            assert bound[0] <= true.min() + 1e-9
            closest = min(closest, true.min() - bound[0])
        assert closest < np.radians(2.0)


def test_every_interval_has_a_margin(run: BagRun) -> None:
    margins = least_margins_rad(run, cone_histories(run))
    assert set(margins) == {'sun'}
    assert margins['sun'].shape == (len(run.states) - 1,)


@pytest.mark.parametrize(('wrong', 'key'), [
    ('{at_s: 2.0, cone: moon, direction_N: [1.0, 0.0, 0.0]}', 'setpoints[1].cone'),
    ('{at_s: 2.0, cone: sun, attitude_xyzw: [0.0, 0.0, 0.0, 1.0]}', 'setpoints[1].cone'),
    ('{at_s: 2.0, cone: sun, direction_N: [0.0, 0.0, 0.0]}', 'setpoints[1].direction_N'),
])
def test_what_makes_no_sense_is_one_message(wrong: str, key: str) -> None:
    line = next(each for each in TEXT.splitlines() if 'at_s: 2.0' in each)
    with pytest.raises(ConfigurationError) as caught:
        Scenario.from_text(TEXT.replace(line, f'  - {wrong}'), 'wrong')
    assert caught.value.key == key
