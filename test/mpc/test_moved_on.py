# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A state that the compiled solver moves on is where the LGVI says, with either forcing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import CERTIFIED, LIMITED, configuration, random_states

from manifold_mpc_ros.control.torque_history import by_lgvi
from manifold_mpc_ros.errors import ConfigurationError, StepExistenceError
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc


@pytest.fixture(scope='module', params=[LIMITED, CERTIFIED], ids=['paper', 'symmetric'])
def mpc(request: pytest.FixtureRequest) -> AttitudeMpc:
    case: dict[str, Any] = request.param
    return AttitudeMpc(configuration(**case))


@pytest.mark.parametrize('steps', [1e-6, 0.3, 1.0, 2.7])
def test_it_is_where_the_lgvi_says(mpc: AttitudeMpc, steps: float) -> None:
    lasting_s = steps * mpc.config.step_s
    for R, omega in random_states('moved on', 50, 0.6):
        torque = 0.3 * omega[::-1]
        expected = by_lgvi(mpc.config)(R, omega, torque, lasting_s)
        for found, right in zip(mpc.moved_on(R, omega, torque, lasting_s), expected):
            np.testing.assert_allclose(found, right, rtol=0.0, atol=5e-15)


def test_the_warm_start_is_not_touched(mpc: AttitudeMpc) -> None:
    R, omega = random_states('moved on', 1, 0.1)[0]
    mpc.reset()
    first, second = mpc.solve(R, omega), mpc.solve(R, omega)
    mpc.reset()
    assert mpc.solve(R, omega).cost == first.cost
    mpc.moved_on(R, omega + 0.1, np.ones(3), 0.2)
    assert mpc.solve(R, omega).cost == second.cost


@pytest.mark.parametrize('omega', [[9.0, 0.0, 0.0], [np.nan, 0.0, 0.0]])
def test_what_cannot_be_moved_on_raises(mpc: AttitudeMpc, omega: list[float]) -> None:
    with pytest.raises(StepExistenceError, match='guard of the implicit step'):
        mpc.moved_on(np.eye(3), omega, np.zeros(3), 0.5)


@pytest.mark.parametrize(('name', 'value'), [
    ('R_NB', np.eye(2)), ('omega_BN_B', np.zeros(2)), ('torque_B_n_m', np.zeros(2)),
    ('lasting_s', -1.0), ('lasting_s', 0.0), ('lasting_s', np.inf), ('lasting_s', np.nan)])
def test_a_wrong_shape_or_time_is_named(mpc: AttitudeMpc, name: str, value: object) -> None:
    given = {'R_NB': np.eye(3), 'omega_BN_B': np.zeros(3), 'torque_B_n_m': np.zeros(3),
             'lasting_s': 0.5, name: value}
    with pytest.raises(ConfigurationError, match=name):
        mpc.moved_on(**given)


def test_whole_numbers_are_numbers(mpc: AttitudeMpc) -> None:
    R, omega = mpc.moved_on(np.eye(3, dtype=int), [0, 0, 0], [0, 0, 0], 1)
    np.testing.assert_array_equal(R, np.eye(3))
    np.testing.assert_array_equal(omega, np.zeros(3))
