# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A controller beside the plant of another spacecraft says so; beside its own it is silent."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import CERTIFIED, configuration
from closed_loops import Flight, fly

from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

START = (0.0, 0.0, 1.0, 0.0)
J_KG_M2 = np.array([1.0, 0.9, 0.6])


@pytest.fixture(scope='module')
def mpc() -> AttitudeMpc:
    return AttitudeMpc(configuration(**CERTIFIED))


def flown(mpc: AttitudeMpc, *, law: dict[str, Any] | None = None, **plant: Any) -> Flight:
    """Return 12 s from 180 degrees at rest."""
    return fly(mpc, 12.0, plant={'initial_attitude_xyzw': START, **plant}, law=law or {})


@pytest.mark.parametrize(('factor', 'told'), [(3.0, 0.33), (0.35, 2.9)])
def test_another_body_is_named(mpc: AttitudeMpc, factor: float, told: float) -> None:
    watch = flown(mpc, inertia_kg_m2=factor * J_KG_M2).loop.body_watch
    assert watch.ratio == pytest.approx(told, rel=0.1)
    assert 'is of another spacecraft' in watch.warning


def test_the_law_of_a_small_spacecraft_beside_a_large_body_is_named() -> None:
    """The pair that was silent: a 3U law, a body of 1 kg m^2."""
    small = np.array([0.035, 0.035, 0.007])
    mpc = AttitudeMpc(configuration(**{
        **CERTIFIED, 'inertia_kg_m2': small, 'rate_weight': small, 'max_torque_n_m': 1e-4,
        'max_rate_rad_s': 0.05, 'torque_weight': np.full(3, 1e6)}))
    watch = flown(mpc, inertia_kg_m2=J_KG_M2, max_torque_n_m=[0.3]).loop.body_watch
    assert watch.ratio < 0.1
    assert 'spacecraft.inertia_kg_m2' in watch.warning


@pytest.mark.parametrize('plant', [
    {'inertia_kg_m2': 1.4 * J_KG_M2}, {'inertia_kg_m2': 0.7 * J_KG_M2},
    {'disturbance_torque_n_m': [0.05, -0.05, 0.05]},
    {'rate_noise_std_rad_s': 3e-3, 'attitude_noise_std_rad': 3e-3},
    {'initial_rate_rad_s': [0.2, -0.3, 0.25]}, {'actuation_delay_s': 0.5}])
def test_the_own_body_is_not(mpc: AttitudeMpc, plant: dict[str, Any]) -> None:
    """Nor one a third off, noise, a torque that acts unasked, or one that comes a step late."""
    watch = flown(mpc, **plant).loop.body_watch
    assert watch.warning == ''
    assert 0.5 < watch.ratio < 2.0


def test_a_declared_delay_is_counted(mpc: AttitudeMpc) -> None:
    flight = flown(mpc, law={'actuation_delay_s': 0.5}, actuation_delay_s=0.5)
    assert flight.loop.body_watch.ratio == pytest.approx(1.0, abs=0.1)


def test_nothing_is_told_of_a_body_that_is_not_turned(mpc: AttitudeMpc) -> None:
    watch = flown(mpc, initial_attitude_xyzw=(0.0, 0.0, 0.0, 1.0)).loop.body_watch
    assert np.isnan(watch.ratio)
    assert watch.warning == ''
