# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The controller's configuration: what is stored, and every mistake with its one message."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.rate_limits import MAX_STEP_ANGLE_RAD
from manifold_mpc_ros.errors import ConfigurationError, ManifoldMpcError
from manifold_mpc_ros.lie import so3

INERTIA = np.diag([1.0, 0.9, 0.6])
GOOD: dict[str, Any] = {
    'inertia_kg_m2': INERTIA, 'step_s': 0.5, 'horizon': 10, 'attitude_weight': np.eye(3),
    'rate_weight': np.diag([0.25, 0.35, 0.65]), 'torque_weight': 2.0 * np.eye(3),
    'max_torque_n_m': [0.3, 0.3, 0.3], 'max_rate_rad_s': [0.6, 0.6, 0.6],
}


def make(**changes: Any) -> AttitudeMpcConfig:
    return AttitudeMpcConfig(**{**GOOD, **changes})


def turned(matrix: np.ndarray) -> np.ndarray:
    """Return the same tensor in body axes that are not principal ones."""
    R = so3.exp([0.4, -0.7, 0.2])
    return R @ matrix @ R.T


def test_defaults() -> None:
    config = AttitudeMpcConfig(**{key: value for key, value in GOOD.items() if 'max' not in key})
    assert config.terminal_scale == 0.1
    assert config.max_torque_n_m is None
    assert config.max_rate_rad_s is None
    assert config.forcing == 'symmetric'
    assert config.terminal_constraint is True


def test_nothing_can_be_changed() -> None:
    config = make()
    with pytest.raises(dataclasses.FrozenInstanceError):
        config.step_s = 1.0
    for name in ('inertia_kg_m2', 'attitude_weight', 'rate_weight', 'torque_weight',
                 'max_torque_n_m', 'max_rate_rad_s'):
        with pytest.raises(ValueError, match='read-only'):
            getattr(config, name)[0] = 7.0


def test_the_caller_keeps_its_arrays() -> None:
    mine = np.eye(3)
    config = make(attitude_weight=mine)
    mine[0, 0] = 5.0
    np.testing.assert_array_equal(config.attitude_weight, np.eye(3))


@pytest.mark.parametrize('given', [
    [1.0, 0.9, 0.6], (1, 0.9, 0.6), INERTIA, INERTIA.tolist(), INERTIA.ravel().tolist()])
def test_a_matrix_is_its_diagonal_or_all_of_it(given: Any) -> None:
    np.testing.assert_array_equal(make(inertia_kg_m2=given).inertia_kg_m2, INERTIA)


@pytest.mark.parametrize(('given', 'stored'), [
    (None, None), (0.3, [0.3] * 3), ([0.3], [0.3] * 3), ([0.1, 0.2, 0.3], [0.1, 0.2, 0.3]),
    ([0.1, math.inf, 0.3], [0.1, math.inf, 0.3]), ([math.inf] * 3, None), (math.inf, None)])
@pytest.mark.parametrize('name', ['max_torque_n_m', 'max_rate_rad_s'])
def test_limits(name: str, given: Any, stored: Any) -> None:
    value = getattr(make(**{name: given}), name)
    if stored is None:
        assert value is None
    else:
        np.testing.assert_array_equal(value, stored)


@pytest.mark.parametrize(('key', 'value', 'valid'), [
    ('inertia_kg_m2', [1.0, 0.9], '3 numbers'),
    ('inertia_kg_m2', np.eye(4), '3x3'),
    ('inertia_kg_m2', [[1.0, 0.0], [0.0]], '3x3'),
    ('inertia_kg_m2', 'heavy', '3 numbers'),
    ('inertia_kg_m2', None, '3 numbers'),
    ('inertia_kg_m2', [1.0, math.nan, 0.6], 'finite'),
    ('inertia_kg_m2', [1.0, math.inf, 0.6], 'finite'),
    ('inertia_kg_m2', np.diag([1.0, 0.9, 0.6]) + 0.1 * np.eye(3, k=1), 'symmetric'),
    ('inertia_kg_m2', [1.0, 0.9, 0.0], 'positive principal moments'),
    ('inertia_kg_m2', [-1.0, -0.9, -0.6], 'positive principal moments'),
    ('inertia_kg_m2', turned(np.diag([1.0, 0.5, 0.5])), 'J_1 + J_2 > J_3'),
    ('inertia_kg_m2', turned(np.diag([1.0, 0.3, 0.5])), 'J_1 + J_2 > J_3'),
    ('step_s', 0.0, 'above 0'),
    ('step_s', -0.5, 'above 0'),
    ('step_s', math.nan, 'finite'),
    ('step_s', math.inf, 'finite'),
    ('step_s', '0.5', 'a finite number'),
    ('step_s', True, 'a finite number'),
    ('horizon', 0, 'at least 1'),
    ('horizon', 2.0, 'an integer'),
    ('horizon', True, 'an integer'),
    ('attitude_weight', [1.0, 0.0, 0.0], 'tr(Q) I - Q'),
    ('attitude_weight', np.zeros((3, 3)), 'tr(Q) I - Q'),
    ('attitude_weight', turned(np.diag([1.0, 1.0, -0.1])), 'semidefinite'),
    ('rate_weight', turned(np.diag([1.0, 0.0, 0.0])), 'tr(Q) I - Q'),
    ('rate_weight', np.eye(3) + 0.1 * np.eye(3, k=1), 'symmetric'),
    ('torque_weight', [1.0, 1.0, 0.0], 'positive definite'),
    ('torque_weight', turned(np.diag([2.0, 1.0, -1.0])), 'positive definite'),
    ('terminal_scale', 0.0, 'above 0 and below 1'),
    ('terminal_scale', 1.0, 'above 0 and below 1'),
    ('terminal_scale', math.nan, 'above 0 and below 1'),
    ('max_torque_n_m', [0.3, 0.3], 'three'),
    ('max_torque_n_m', [0.3, 0.0, 0.3], 'positive'),
    ('max_torque_n_m', [0.3, math.nan, 0.3], 'positive'),
    ('max_rate_rad_s', -0.6, 'positive'),
    ('forcing', 'explicit', "'symmetric', 'paper'"),
    ('terminal_constraint', 1, 'true or false'),
])
def test_mistakes(key: str, value: Any, valid: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        make(**{key: value})
    assert isinstance(caught.value, ManifoldMpcError)
    assert caught.value.key == key
    message = str(caught.value)
    assert message.startswith(f'{key}: ')
    assert valid in message
    assert '\n' not in message


def test_semidefinite_weights_are_enough_where_the_cost_is_definite() -> None:
    assert make(attitude_weight=[1.0, 1.0, 0.0]).attitude_weight[2, 2] == 0.0


def test_rate_limits_end_below_the_branch_bound() -> None:
    """With a heavy body only the branch bound counts; the bound itself is refused."""
    heavy = {'inertia_kg_m2': [1.0, 1.0, 1.0], 'max_torque_n_m': None, 'step_s': 0.1}
    inside = 0.999 / math.sqrt(3.0) / 0.1
    make(**heavy, max_rate_rad_s=inside)
    for rate in (MAX_STEP_ANGLE_RAD / math.sqrt(3.0) / 0.1, 20.0):
        with pytest.raises(ConfigurationError, match=r'below 1\.5 rad'):
            make(**heavy, max_rate_rad_s=rate)
    with pytest.raises(ConfigurationError, match=r'below 1\.5 rad'):
        make(**heavy, max_rate_rad_s=[16.0, math.inf, math.inf])


def test_the_implicit_step_exists_at_the_corner_of_both_boxes() -> None:
    """The bound |J omega| h + |tau| h^2/2 at the largest corner, on either side of it."""
    J = turned(INERTIA)
    corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
    h, torque = 0.5, 0.3
    largest = np.linalg.norm(corners @ J, axis=1).max()
    impulse = h * h / 2.0 * torque * math.sqrt(3.0)
    rate = (0.6 - impulse) / (h * largest)
    make(inertia_kg_m2=J, max_rate_rad_s=rate * (1.0 - 1e-9))
    with pytest.raises(ConfigurationError, match='smallest moment of inertia') as caught:
        make(inertia_kg_m2=J, max_rate_rad_s=rate * (1.0 + 1e-9))
    assert caught.value.key == 'max_rate_rad_s'
    with pytest.raises(ConfigurationError, match='smallest moment of inertia') as caught:
        make(inertia_kg_m2=J, max_rate_rad_s=None, max_torque_n_m=100.0)
    assert caught.value.key == 'max_torque_n_m'


def test_the_largest_acceleration_is_that_of_a_corner_of_the_torque_box() -> None:
    inertia, limit = turned(INERTIA), np.array([0.1, 0.2, 0.3])
    corners = [np.linalg.solve(inertia, limit * [a, b, c])
               for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]
    config = make(inertia_kg_m2=inertia, max_torque_n_m=limit)
    assert config.largest_acceleration_rad_s2 == pytest.approx(
        max(map(np.linalg.norm, corners)), rel=1e-12)
    for unlimited in (None, [0.1, np.inf, 0.3]):
        assert make(max_torque_n_m=unlimited).largest_acceleration_rad_s2 == np.inf
