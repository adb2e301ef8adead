# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Campaign files: what is shipped is valid, mistakes name the key, and a plan reads back."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from campaign_plans import mapping, plan, plants

from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.campaign.keys import all_keys
from manifold_mpc_ros.lab.campaign.plan import CampaignPlan

TOP = Path(__file__).parents[2]
SHIPPED = sorted((TOP / 'config/campaigns').glob('*.yaml'))


def changed_set(**changed: Any) -> dict[str, Any]:
    return {'sets': [{**mapping()['sets'][0], **changed}]}


def test_there_are_shipped_campaigns() -> None:
    assert [path.stem for path in SHIPPED] == ['cones', 'dispersed', 'pointing', 'theory']


@pytest.mark.parametrize('path', SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_campaign_reads_back_from_its_own_text(path: Path) -> None:
    read = CampaignPlan.from_yaml(path)
    again = CampaignPlan.from_text(read.as_yaml(), read.name)
    assert again == read
    assert again.digest == read.digest
    assert read.config.target == ('pointing' if path.stem == 'pointing' else 'attitude')


def test_a_plan_with_everything_reads_back() -> None:
    read = plan(plants(), {
        'name': 'fixed', 'loops': 2, 'attitude': {'kind': 'fixed', 'xyzw': [0, 0, 1, 0]},
        'rate': {'kind': 'fixed', 'rad_s': [0.1, 0, 0]},
        'setpoint': {'kind': 'fixed', 'xyzw': [0, 0, 0.6, 0.8]},
        'acceptance': {'peak_rate_rad_s': [0.7], 'final_error_deg': 1.0}},
        simulator={'plant': {'step_s': 0.1}})
    assert CampaignPlan.from_text(read.as_yaml(), read.name) == read


def test_the_digest_says_whether_cases_are_the_same() -> None:
    assert plan().with_loops(None, 7).digest == plan().digest
    assert replace(plan(), description='other words', name='other').digest == plan().digest
    for other in (plan(seed=1), plan(duration_s=25.0), plan(plants()),
                  plan(acceptance={'turn_changes': 2}), plan(controller={'mpc.horizon': 9})):
        assert other.digest != plan().digest


def test_the_body_is_the_model_unless_the_simulator_is_changed() -> None:
    heavy = [2.0, 1.8, 1.2]
    read = plan(plants(), controller={'spacecraft.inertia_kg_m2': heavy})
    assert read.body.inertia_kg_m2.diagonal().tolist() == heavy
    assert read.body.control_period_s == read.config.step_s
    other = CampaignPlan.from_text(yaml.safe_dump(mapping(
        sets=[plants()], simulator={'spacecraft': {'inertia_kg_m2': heavy}})), 'small')
    assert other.body.inertia_kg_m2.diagonal().tolist() == heavy
    assert other.config.inertia_kg_m2.diagonal().tolist() == [1.0, 0.9, 0.6]


def test_sets_change_the_acceptance_of_the_campaign() -> None:
    loose = {**mapping()['sets'][1], 'acceptance': {'turn_changes': 5}}
    first, second = plan(mapping()['sets'][0], loose).sets
    assert (first.acceptance.turn_changes, second.acceptance.turn_changes) == (1, 5)
    assert second.acceptance.promises_broken == 0


@pytest.mark.parametrize(('changed', 'words'), [
    ({'duraton_s': 3.0}, ['duraton_s', 'nearest is duration_s']),
    ({'duration_s': 20.3}, ['duration_s', '20.3', 'multiple of the control step 0.5']),
    ({'duration_s': None}, ['duration_s', 'a number']),
    ({'seed': -1}, ['seed', '-1']),
    ({'sets': []}, ['sets', 'at least one']),
    ({'sets': {'random': 3}}, ['sets', 'a list of groups']),
    ({'controller': {'mpc': {'horizn': 3}}}, ['controller.mpc.horizn', 'mpc.horizon']),
    ({'controller': {'mpc.horizon': 0}}, ['controller.mpc.horizon', '0']),
    ({'simulator': {'sensor': {'seed': 3}}}, ['simulator.sensor.seed', 'the set decides it']),
    ({'simulator': {'plant.step_s': 0.3}, 'sets': [plants()]}, ['simulator.', 'multiple', '0.3']),
    ({'acceptance': {'settle_time': 3}}, ['acceptance.settle_time', 'acceptance.settle_time_s']),
    ({'sets': [*mapping()['sets'], mapping()['sets'][0]]}, ['sets[2].name', "'random'"]),
    (changed_set(name='a-b'), ['sets[0].name', "'a-b'"]),
    (changed_set(loops=1.5), ['sets[0].loops', '1.5']),
    (changed_set(body='moon'), ['sets[0].body', "'moon'", "'plant'"]),
    (changed_set(noise={'rate_std_rad_s': 1e-3}), ['sets[0].noise', 'body: plant']),
    (changed_set(attitude={'kind': 'cone'}), ['sets[0].attitude.kind', "'cone'", "'angle'"]),
    (changed_set(attitude={}), ['sets[0].attitude.kind', 'missing']),
    (changed_set(attitude={'kind': 'angle'}), ['sets[0].attitude.angle_deg', 'angle needs']),
    (changed_set(attitude={'kind': 'angle', 'angle_deg': [9, 8]}),
     ['sets[0].attitude.angle_deg', 'smaller one first']),
    (changed_set(attitude={'kind': 'uniform', 'xyzw': [0, 0, 0, 1]}),
     ['sets[0].attitude.xyzw', 'uniform takes no other key']),
    (changed_set(attitude={'kind': 'fixed', 'xyzw': [0, 0, 0, 2]}),
     ['sets[0].attitude.xyzw', 'unit quaternion']),
    (changed_set(rate={'kind': 'ball', 'largest_rad_s': 1.3}),
     ['sets[0].rate.largest_rad_s', '1.3', 'below 1.2']),
    (changed_set(rate={'kind': 'fixed', 'rad_s': [1.0, 1.0, 0.0]}),
     ['sets[0].rate.rad_s', 'below 1.2']),
    (changed_set(rate={'kind': 'normal', 'std_rad_s': 0.1}),
     ['sets[0].rate.kind', 'body: plant']),
    ({'sets': [plants(rate={'kind': 'normal', 'std_rad_s': -0.1})]},
     ['sets[0].rate.std_rad_s', 'at least 0']),
    ({'sets': [plants(disturbance={'frame': 'body'})]},
     ['sets[0].disturbance.largest_n_m', 'missing']),
    ({'sets': [plants(inertia={'moments_part': 1.2})]}, ['sets[0].inertia.moments_part', '1.2']),
    ({'sets': [plants(noise={'attitude_std_rad': [2e-3, 1e-3]})]},
     ['sets[0].noise.attitude_std_rad', 'smaller one first']),
    (changed_set(cones={'most': 3}), ['sets[0].cones', 'limits on torque and rate']),
    (changed_set(cones={'most': 9}), ['sets[0].cones.most', '9', 'at most 8']),
    (changed_set(cones={'most': 2, 'half_angle_deg': [50.0, 12.0]}),
     ['sets[0].cones.half_angle_deg', 'from 1 to 179, the smaller one first']),
    (changed_set(acceptance={'turn_changes': -1}), ['sets[0].acceptance.turn_changes', '-1']),
])
def test_a_mistake_names_its_key(changed: dict[str, Any], words: list[str]) -> None:
    with pytest.raises(ConfigurationError) as caught:
        CampaignPlan.from_text(yaml.safe_dump(mapping(**changed)), 'small')
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize('text', ['', '- 1', 'a: [', 'description: only'])
def test_text_that_is_no_campaign_is_refused(text: str) -> None:
    with pytest.raises(ConfigurationError, match=r'campaign|duration_s'):
        CampaignPlan.from_text(text, 'small', 'small.yaml')


def test_the_document_names_every_key() -> None:
    document = (TOP / 'docs/campaign.md').read_text(encoding='utf-8')
    missing = [name for name, _ in all_keys()
               if not re.search(rf'`{name.rpartition(".")[2]}\b', document)]
    assert missing == []
