# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The simulator's configuration: what is stored, and every mistake with its one message."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from manifold_mpc_ros.config.control_law import SimulatorConfig
from manifold_mpc_ros.errors import ConfigurationError


def make(**changes: Any) -> SimulatorConfig:
    return SimulatorConfig(**{'inertia_kg_m2': [1.0, 0.9, 0.6], **changes})


def test_an_inertia_is_enough() -> None:
    config = make()
    assert config.max_torque_n_m is None
    np.testing.assert_array_equal(config.initial_attitude_xyzw, [0.0, 0.0, 1.0, 0.0])
    assert not config.initial_rate_rad_s.any()
    assert not config.disturbance_torque_n_m.any()
    with pytest.raises(ValueError, match='read-only'):
        config.initial_rate_rad_s[0] = 1.0


def test_the_quaternion_is_normalised() -> None:
    config = make(initial_attitude_xyzw=[0.0, 0.0, 0.0, 1.005])
    np.testing.assert_array_equal(config.initial_attitude_xyzw, [0.0, 0.0, 0.0, 1.0])


def test_periods_in_steps_and_the_life_of_a_command() -> None:
    config = make(step_s=0.02, state_period_s=0.1, control_period_s=0.5)
    assert (config.steps_per_state, config.steps_per_control) == (5, 25)
    assert config.command_life_s == 1.5
    assert make(step_s=0.01, state_period_s=0.01, control_period_s=0.01).command_life_s == 0.15


@pytest.mark.parametrize(('changes', 'key', 'valid'), [
    ({'inertia_kg_m2': [1.0, 0.3, 0.6]}, 'inertia_kg_m2', 'J_1 + J_2 > J_3'),
    ({'step_s': 0.0}, 'step_s', 'above 0'),
    ({'initial_attitude_xyzw': [0.0, 0.0, 0.0, 0.0]}, 'initial_attitude_xyzw', 'norm is 0'),
    ({'initial_attitude_xyzw': [0.0, 0.0, 1.0]}, 'initial_attitude_xyzw', '4 numbers'),
    ({'initial_attitude_xyzw': [0.0, math.nan, 1.0, 0.0]}, 'initial_attitude_xyzw', 'finite'),
    ({'initial_rate_rad_s': [0.0, math.inf, 0.0]}, 'initial_rate_rad_s', 'finite'),
    ({'disturbance_torque_n_m': 0.1}, 'disturbance_torque_n_m', '3 numbers'),
    ({'max_torque_n_m': [0.3, -0.3, 0.3]}, 'max_torque_n_m', 'positive'),
    ({'attitude_noise_std_rad': -1e-3}, 'attitude_noise_std_rad', 'at least 0'),
    ({'rate_noise_std_rad_s': math.nan}, 'rate_noise_std_rad_s', 'finite'),
    ({'seed': -1}, 'seed', 'at least 0'),
    ({'seed': 1.0}, 'seed', 'an integer'),
    ({'state_period_s': 0.06}, 'state_period_s', 'multiple of the plant step'),
    ({'control_period_s': 0.01}, 'control_period_s', 'multiple of the plant step'),
    ({'command_timeout_periods': 0}, 'command_timeout_periods', 'at least 1'),
    ({'real_time_factor': 0.0, 'publish_clock': True}, 'real_time_factor', 'above 0'),
    ({'real_time_factor': 20.0}, 'real_time_factor', 'publish_clock or lockstep'),
    ({'overdue_wait_s': -1.0}, 'overdue_wait_s', 'at least 0'),
    ({'lockstep': 'yes'}, 'lockstep', 'true or false'),
    ({'lockstep_retry_s': 0.0}, 'lockstep_retry_s', 'above 0'),
])
def test_mistakes(changes: dict[str, Any], key: str, valid: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        make(**changes)
    assert caught.value.key == key
    assert valid in str(caught.value)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize('follow', ['publish_clock', 'lockstep'])
def test_a_factor_needs_somebody_who_can_follow(follow: str) -> None:
    assert make(real_time_factor=20.0, **{follow: True}).real_time_factor == 20.0
