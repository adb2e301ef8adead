# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bang-bang times by hand, and a step that every body accepts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from manifold_mpc_ros.config.parameter import resolve_parameters
from manifold_mpc_ros.config.tables import CONTROLLER_PARAMETERS
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.tune import rule
from manifold_mpc_ros.lab.tune.rule import Timing, Weights

WEIGHTS = Weights(0.01, 0.03)


def values(inertia: list[float], torque: float, rate: float) -> dict[str, Any]:
    """Return all parameters of a controller for a body."""
    return resolve_parameters(CONTROLLER_PARAMETERS, {
        'spacecraft.inertia_kg_m2': inertia, 'limits.max_torque_n_m': [torque] * 3,
        'limits.max_rate_rad_s': [rate] * 3}, complete=False)


def test_bang_bang_times_by_torque_and_by_rate() -> None:
    """By torque ``2 sqrt(angle J / tau)``; with coasting ``angle / w + w J / tau``."""
    given = values([2.0, 2.0, 3.0], 0.5, 0.4)
    _, config = rule.controller(given, Timing(0.01, 1), WEIGHTS, 1.0)
    assert rule.bang_bang_time_s(config, (1, 0, 0), 0.1) == pytest.approx(2 * np.sqrt(0.4))
    assert rule.bang_bang_time_s(config, (0, 0, 1), np.pi) == pytest.approx(
        np.pi / 0.4 + 0.4 * 6.0)
    assert rule.half_turn_s(config) == pytest.approx(np.pi / 0.4 + 0.4 * 6.0)
    diagonal = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    # Both torques work, and both rates: root two more of each.
    assert rule.bang_bang_time_s(config, diagonal, 0.1) == pytest.approx(
        2 * np.sqrt(0.1 * 2.0 / (0.5 * np.sqrt(2))))


def test_a_slender_body_gets_a_shorter_step_and_as_long_a_view() -> None:
    slender = values([100.0, 100.0, 4.0], 0.2, 0.02)
    timing, half_turn = rule.timing_of(slender, WEIGHTS, None)
    assert timing.step_s < half_turn / rule.STEPS
    assert timing.step_s * timing.horizon >= rule.HORIZON_PART * half_turn
    with pytest.raises(ConfigurationError, match='smallest'):
        rule.timing_of(slender, WEIGHTS, half_turn / rule.STEPS)


def test_a_step_too_short_for_the_slew_and_a_body_without_limits_are_refused() -> None:
    with pytest.raises(ConfigurationError, match='1000 steps'):
        rule.timing_of(values([1.0, 0.9, 0.6], 0.3, 0.6), WEIGHTS, 0.001)
    with pytest.raises(ConfigurationError, match='finite torque'):
        rule.timing_of(values([1.0, 0.9, 0.6], np.inf, 0.6), WEIGHTS, None)
