# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From a body and its limits to step, horizon and weights: the rule of docs/tuning.md."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.parameter import Value
from manifold_mpc_ros.errors import ConfigurationError

# Steps of a half turn, and of the horizon beyond the time that a half turn takes.
STEPS, HORIZON_PART = 60, 1.25
LARGEST_HORIZON = 1000
# A step that the body refuses (no implicit step, a turn beyond its branch) is shortened by this.
SHORTER, SHORTEN = 0.8, 20


class Weights(NamedTuple):
    """What the rule chooses beside Qg = I.

    ``torque_angle_rad``: full torque costs what this error does. ``damping``: time constant of
    the last approach, as a part of the time of a half turn. ``torque_fraction``: of the limits,
    what slew profiles use; 0: setpoints are aimed at.
    """

    torque_angle_rad: float
    damping: float
    torque_fraction: float = 0.0


class Timing(NamedTuple):
    """Step [s] and number of steps of the prediction."""

    step_s: float
    horizon: int


def bang_bang_time_s(config: AttitudeMpcConfig, axis_B: ArrayLike, angle_rad: float) -> float:
    """Return the time of a slew at rest about a body axis: full torque, coast at the limit, brake.

    About the axis, torque limits allow the acceleration ``a = min_i tau_i / |J axis|_i`` and rate
    limits the rate w: ``2 sqrt(angle / a)``, or ``angle / w + w / a`` when that is longer. Slews
    that leave the axis may be quicker than that.
    """
    assert config.max_torque_n_m is not None
    axis = np.asarray(axis_B, dtype=float)
    effort = np.abs(config.inertia_kg_m2 @ axis) / config.max_torque_n_m
    acceleration = 1.0 / float(effort.max())
    rate = min((float(limit.rate_about(axis)) for limit in config.rate_limits), default=math.inf)
    if rate * rate < angle_rad * acceleration:
        return angle_rad / rate + rate / acceleration
    return 2.0 * math.sqrt(angle_rad / acceleration)


def half_turn_s(config: AttitudeMpcConfig) -> float:
    """Return the time of a bang-bang half turn about the slowest body axis."""
    return max(bang_bang_time_s(config, axis, math.pi) for axis in np.eye(3))


def settled_rate_rad_s(config: AttitudeMpcConfig, accuracy_rad: float) -> float:
    """Return the rate that counts as rest: ``sqrt(accuracy * a)``.

    Full torque about the slowest axis stops it within half the accuracy; inf without limits.
    """
    if config.max_torque_n_m is None:
        return math.inf
    slowest = float(np.min(config.max_torque_n_m / np.diag(config.inertia_kg_m2)))
    return math.sqrt(accuracy_rad * slowest)


def controller(values: Mapping[str, Value], timing: Timing, weights: Weights, half_turn: float
               ) -> tuple[dict[str, Value], AttitudeMpcConfig]:
    """Return the parameters that the rule sets, and the configuration with them.

    ``Qg = I``, ``R = (torque_angle / max_torque)^2``, ``Qf = (damping half_turn)^2 I``; and rate
    limits are kept between samples where that is proved.
    """
    torque = np.asarray(values['limits.max_torque_n_m'], dtype=float)
    chosen: dict[str, Value] = {
        'mpc.step_s': timing.step_s, 'mpc.horizon': timing.horizon, 'mpc.horizon_s': 0.0,
        'mpc.attitude_weight': [1.0] * 3,
        'mpc.rate_weight': [(weights.damping * half_turn) ** 2] * 3,
        'mpc.torque_weight': [(weights.torque_angle_rad / float(torque.max())) ** 2] * 3,
        'mpc.terminal_constraint': True, 'slew_profile.torque_fraction': weights.torque_fraction}
    keep = 'limits.keep_rate_between_samples'
    config = AttitudeMpcConfig.from_parameters({**values, **chosen, keep: False})
    chosen[keep] = config.can_keep_rate_between_samples
    return chosen, AttitudeMpcConfig.from_parameters({**values, **chosen})


def timing_of(values: Mapping[str, Value], weights: Weights, step_s: float | None
              ) -> tuple[Timing, float]:
    """Return step and horizon for a body, and the time of its half turn [s].

    The step given, else a sixtieth of the half turn, shorter where the body has no such step.

    Raises ConfigurationError for a body without torque limits, a step that it refuses, or one with
    which the horizon would need more than 1000 steps.
    """
    torque = np.asarray(values['limits.max_torque_n_m'], dtype=float)
    if not np.all(np.isfinite(torque)):
        raise ConfigurationError('limits.max_torque_n_m', torque.tolist(), 'finite torque limits')
    tiny = Timing(1e-9, 1)
    half_turn = half_turn_s(controller(values, tiny, weights, 1.0)[1])
    step = step_s or _rounded(half_turn / STEPS)
    for attempt in range(SHORTEN):
        timing = Timing(step, math.ceil(HORIZON_PART * half_turn / step))
        if timing.horizon > LARGEST_HORIZON:
            raise ConfigurationError(
                'mpc.step_s', step, f'at least {HORIZON_PART * half_turn / LARGEST_HORIZON:.3g} s:'
                f' a half turn takes {half_turn:.4g} s and a horizon has at most '
                f'{LARGEST_HORIZON} steps')
        try:
            controller(values, timing, weights, half_turn)
        except ConfigurationError:
            if step_s is not None or attempt == SHORTEN - 1:
                raise
            step = _rounded(SHORTER * step)
        else:
            break
    return timing, half_turn


def _rounded(value: float) -> float:
    """Return a positive number with two digits."""
    return float(f'{value:.1e}')
