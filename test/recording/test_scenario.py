# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scenarios: every shipped one is valid, every mistake is named, every key is documented."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from manifold_mpc_ros.config.parameter import ParameterSpec
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.recording.scenarios.keys import (
    ACCEPTANCE_KEYS,
    FAULT_GROUPS,
    GROUPS,
    all_keys,
)
from manifold_mpc_ros.lab.recording.scenarios.parts import AcceptanceLimits
from manifold_mpc_ros.lab.recording.scenarios.scenario import Scenario
from manifold_mpc_ros.lie import so3

TOP = Path(__file__).parents[2]
SHIPPED = sorted((TOP / 'config' / 'scenarios').glob('*.yaml'))
KEYS = dict(all_keys())
BASE: dict[str, Any] = {'description': 'a test', 'duration_s': 10.0}


def read(**more: Any) -> Scenario:
    return Scenario.from_text(yaml.safe_dump({**BASE, **more}), 'test')


def refused(**more: Any) -> str:
    with pytest.raises(ConfigurationError) as caught:
        read(**more)
    return str(caught.value)


@pytest.mark.parametrize('path', SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_scenario(path: Path) -> None:
    scenario = Scenario.from_yaml(path)
    assert scenario.name == path.stem
    assert scenario.text == path.read_text(encoding='utf-8')
    assert scenario.acceptance.settle_time_s is not None
    assert scenario.acceptance.final_error_deg is not None
    assert scenario.acceptance.settle_time_s < scenario.duration_s
    again = Scenario.from_text(scenario.text, scenario.name)
    assert again.controller_parameters == scenario.controller_parameters
    assert again.simulator_parameters == scenario.simulator_parameters


def test_what_the_shipped_ones_cover() -> None:
    assert len(SHIPPED) >= 10
    scenarios = {path.stem: Scenario.from_yaml(path) for path in SHIPPED}
    first = {name: so3.angle(so3.rotation_from_quaternion(np.roll(
        scenario.simulator_config.initial_attitude_xyzw, 1)))
        for name, scenario in scenarios.items()}
    for name, degrees in {'rest_to_rest_10': 10, 'rest_to_rest_90': 90, 'rest_to_rest_180': 180,
                          'paper_180': 180, 'paper_minus_178': 178.2, 'near_pi_noise': 179.9,
                          'pointing_antipode': 180}.items():
        assert np.isclose(np.degrees(first[name]), degrees, rtol=0, atol=1e-6), name
    assert scenarios['paper_180'].controller_config.mpc.forcing == 'paper'
    assert scenarios['lossy_link'].faults.state_link.drop_probability > 0.0
    assert scenarios['solver_starved'].faults.controller_stops
    assert scenarios['pointing_antipode'].controller_config.mpc.target == 'pointing'


def test_the_least_scenario_is_the_shipped_parameters_in_lockstep() -> None:
    scenario = read()
    assert scenario.lockstep
    assert scenario.controller_parameters['lockstep'] is True
    assert scenario.simulator_parameters['autostart'] is False
    assert scenario.controller_config.mpc.horizon == 20
    assert scenario.acceptance.settle_time_s is None


def test_changes_are_by_ros_name_nested_or_dotted() -> None:
    nested = read(controller={'mpc': {'horizon': 7}}, simulator={'sensor': {'seed': 3}})
    dotted = read(controller={'mpc.horizon': 7}, simulator={'sensor.seed': 3})
    for scenario in (nested, dotted):
        assert scenario.controller == {'mpc.horizon': 7}
        assert scenario.controller_config.mpc.horizon == 7
        assert scenario.simulator_config.seed == 3


def test_simulated_time_on_the_clock() -> None:
    scenario = read(time={'mode': 'clock', 'factor': 4.0})
    assert scenario.use_sim_time
    assert scenario.simulator_config.real_time_factor == 4.0
    assert scenario.simulator_config.publish_clock
    assert not read(time={'mode': 'wall'}).simulator_config.publish_clock


@pytest.mark.parametrize(('more', 'words'), [
    ({'descripton': 'x'}, "descripton: 'x' is not valid; expected a key that exists (unknown "
                          'key; the nearest is description)'),
    ({'duration_s': 'long'}, "duration_s: 'long' is not valid; expected a number"),
    ({'duration_s': 10.2}, 'expected a multiple of the control step 0.5 s'),
    ({'controller': {'mpc': {'horizn': 3}}}, "controller.mpc.horizn: 3 is not valid; expected a "
     "parameter that exists (unknown key; the nearest is 'mpc.horizon')"),
    ({'controller': {'body': {'inertia': 3}}}, "the nearest is 'spacecraft.inertia_kg_m2')"),
    ({'controller': {'mpc': {'horizon': 0}}}, 'controller.mpc.horizon: 0 is not valid; expected '
                                             'an integer of at least 1'),
    ({'controller': {'lockstep': True}}, 'controller.lockstep: True is not valid; expected left '
                                         'out: time.mode decides it'),
    ({'controller': {'mpc': {'step_s': 0.25}}}, 'simulator.timing.control_period_s: 0.5 is not '
                                                'valid; expected 0.25'),
    ({'controller': {'spacecraft': {'inertia_kg_m2': [1.0, 1.0, 5.0]}}},
     'controller.spacecraft.inertia_kg_m2: [1.0, 1.0, 5.0] is not valid'),
    ({'simulator': 3}, 'simulator: 3 is not valid; expected nested keys'),
    ({'time': {'mode': 'fast'}}, "time.mode: 'fast' is not valid; expected one of 'lockstep'"),
    ({'time': {'factor': 2.0}}, 'time.factor: 2.0 is not valid; expected 1 unless time.mode'),
    ({'setpoints': {'at_s': 0.0}}, 'expected a list of groups of keys'),
    ({'setpoints': [{'at_s': 0.0}]}, 'expected either attitude_xyzw or direction_N'),
    ({'setpoints': [{'at_s': 0.0, 'attitude_xyzw': [0, 0, 0, 2]}]},
     'setpoints[0].attitude_xyzw: [0.0, 0.0, 0.0, 2.0] is not valid; expected a unit quaternion'),
    ({'setpoints': [{'at_s': 11.0, 'attitude_xyzw': [0, 0, 0, 1]}]}, 'less than duration_s'),
    ({'setpoints': [{'at_s': t, 'attitude_xyzw': [0, 0, 0, 1]} for t in (2.0, 1.0)]},
     'setpoints[1].at_s: 1.0 is not valid; expected more than 2'),
    ({'setpoints': [{'at_s': 0.0, 'direction_N': [1, 0, 0]}]}, 'controller.target: pointing'),
    ({'faults': {'state_link': {'drop_probability': 2.0}}},
     'faults.state_link.drop_probability: 2.0 is not valid; expected a number of at least 0 and'),
    ({'faults': {'state_link': {'delay_s': 0.1}}}, 'lockstep waits for every answer'),
    ({'faults': {'controller_stops': [{'at_s': 1.0}]}},
     'faults.controller_stops[0].for_s: None is not valid'),
    ({'faults': {'controller_stops': [{'at_s': 1.0, 'for_s': 2.0}, {'at_s': 2.0, 'for_s': 1.0}]}},
     'at least 3, the end of the one before'),
    ({'acceptance': {'settle_time': 3.0}}, 'the nearest is acceptance.settle_time_s'),
    ({'acceptance': {'peak_torque_n_m': [0.3, 0.3]}}, 'expected a list of 1 or 3 numbers'),
    ({'acceptance': {'violations': 0.5}}, 'acceptance.violations: 0.5 is not valid'),
])
def test_a_mistake_is_named(more: dict[str, Any], words: str) -> None:
    message = refused(**more)
    assert words in message
    assert '\n' not in message


def test_files_that_are_no_scenarios(tmp_path: Path) -> None:
    path = tmp_path / 'scenario.yaml'
    for text, words in (('just text', 'a scenario (nested keys)'), ('a: [', 'valid YAML'),
                        ('duration_s: 3.0', 'description: None is not valid; expected text')):
        path.write_text(text, encoding='utf-8')
        with pytest.raises(ConfigurationError) as caught:
            Scenario.from_yaml(path)
        assert words in str(caught.value)
    with pytest.raises(ConfigurationError, match='a readable YAML file'):
        Scenario.from_yaml(tmp_path / 'absent.yaml')


@given(key=st.sampled_from(sorted(KEYS)), drop=st.integers(0, 30))
@settings(max_examples=60, deadline=None)
def test_the_nearest_key_is_the_right_one(key: str, drop: int) -> None:
    """With one letter missing the message still leads to the key."""
    group, _, name = key.rpartition('.')
    wrong = name[:drop % len(name)] + name[drop % len(name) + 1:]
    if f'{group}.{wrong}'.lstrip('.') in KEYS:
        return
    given_keys: Any = {wrong: 0}
    for part in reversed(group.split('.') if group else []):
        given_keys = {part.removesuffix('[]'): [given_keys] if part.endswith('[]')
                      else given_keys}
    message = refused(**given_keys)
    assert message.endswith(f'(unknown key; the nearest is {key.replace("[]", "[0]")})')


@pytest.mark.parametrize('spec', KEYS.values(), ids=KEYS)
def test_a_key_is_described_and_has_a_valid_example(spec: ParameterSpec) -> None:
    assert spec.check(spec.default) == spec.default
    assert len(spec.description.split()) >= 2
    number = spec.kind in ('float', 'floats') and spec.unit
    assert number or spec.kind not in ('float', 'floats')


def test_limits_have_a_key_each() -> None:
    assert [spec.name for spec in ACCEPTANCE_KEYS] == list(AcceptanceLimits.__dataclass_fields__)


def test_the_document_names_every_key() -> None:
    text = (TOP / 'docs' / 'scenarios.md').read_text(encoding='utf-8')
    names = [key.rpartition('.')[2] for key in KEYS] + list(GROUPS) + list(FAULT_GROUPS)
    assert [name for name in names if f'`{name}`' not in text] == []
    assert [path.stem for path in SHIPPED if f'`{path.stem}`' not in text] == []
