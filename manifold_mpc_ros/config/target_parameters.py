# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of the horizon and of what is aimed at: cones, moving targets, profiles."""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.config.parameter import ParameterSpec
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array

#: Steps of a graded horizon that last one control period: as long as a plan may be followed that
#: nothing replaces.
FINE_STEPS = 6

HORIZON_PARAMETERS = (
    ParameterSpec(
        'mpc.step_s', 'float', 0.5, 'period of the torque command, and step of prediction',
        unit='s', low=0.0, high=3600.0, required=True, read_only=True),
    ParameterSpec(
        'mpc.horizon', 'int', 20, 'number of predicted steps', unit='steps', low=1, high=1000,
        required=True),
    ParameterSpec(
        'mpc.horizon_s', 'float', 0.0,
        'time that the steps cover together: the first ones last mpc.step_s each, the others grow '
        'by a constant factor (0: all last mpc.step_s)', unit='s', low=0.0, high=1e6),
)

#: Parameters of a cone, below ``cones.NAME``.
CONE_PARAMETERS = (
    ParameterSpec(
        'axis_B', 'floats', [0.0, 0.0, 1.0], 'body axis', unit='1', lengths=(3,), required=True),
    ParameterSpec(
        'half_angle_deg', 'float', 30.0, 'half angle', unit='deg', low=0.001, high=179.999,
        required=True),
    ParameterSpec(
        'kind', 'str', 'keep_out', 'whether the axis stays out of the cone, or in it',
        choices=('keep_out', 'keep_in')),
    ParameterSpec(
        'group', 'str', 'none',
        'name of a group of keep_in cones of which any one has to be kept (none: by itself)',
        read_only=True),
    ParameterSpec(
        'direction_N', 'floats', [1.0, 0.0, 0.0],
        'axis of the cone in inertial axes; with a topic, until its first message', unit='1',
        lengths=(3,), required=True),
    ParameterSpec(
        'direction_topic', 'str', 'none',
        'topic that brings the direction, geometry_msgs/Vector3Stamped (none: it is fixed)',
        read_only=True),
    ParameterSpec(
        'direction_timeout_s', 'float', 60.0,
        'age above which a direction of the topic is stale: the last one holds, with a warning',
        unit='s', low=0.0, high=1e9),
)

#: Parameters of a controller's targets.
TARGET_PARAMETERS = (
    ParameterSpec(
        'reference.timeout_s', 'float', 0.0,
        'age of an odometry_setpoint that still goes on; 0: take neither it nor a reference',
        unit='s', low=0.0, high=86400.0, read_only=True, name_in_config='reference_timeout_s'),
    ParameterSpec(
        'slew_profile.torque_fraction', 'float', 0.0,
        'part of the torque and rate limits that a profile towards a setpoint uses; 0: no profile',
        unit='1', low=0.0, high=0.99, name_in_config='slew_torque_fraction'),
    ParameterSpec(
        'slew_profile.smallest_angle_rad', 'float', 0.1,
        'a body that is nearer to where it should be begins no profile', unit='rad', low=1e-6,
        high=4.0, name_in_config='slew_smallest_angle_rad'),
)


class HorizonSteps:
    """The steps of a horizon: all one control period h long, or the later ones longer.

    ``periods`` (N,) are their lengths in control periods: ones; or `FINE_STEPS` ones and then
    q, q^2, ..., q^n, with q > 1 such that they add up to ``horizon_s``.

    Raises ConfigurationError where no q > 1 does, or there are no further steps.
    """

    def __init__(self, steps: int, step_s: float, horizon_s: float) -> None:
        """Find their lengths; ``horizon_s`` 0 is ``steps * step_s``."""
        self._step_s, self.grow = step_s, horizon_s > 0.0
        if self.grow and (steps <= FINE_STEPS or horizon_s <= steps * step_s):
            raise ConfigurationError(
                'horizon_s', horizon_s, f'0, or more than horizon * step_s = {steps * step_s:g} '
                f'with a horizon of more than {FINE_STEPS} steps')
        self.periods = np.ones(steps)
        if self.grow:
            self.periods[FINE_STEPS:] = _growing(
                steps - FINE_STEPS, horizon_s / step_s - FINE_STEPS)

    @property
    def times_s(self) -> Array:
        """Times (N + 1,) of the nodes after the first one [s]."""
        return self._step_s * np.concatenate([[0.0], np.cumsum(self.periods)])

    @property
    def longest_s(self) -> float:
        """The longest step [s]."""
        return self._step_s * float(self.periods[-1])

    @property
    def in_periods(self) -> int:
        """How many control periods they cover, rounded."""
        return round(float(self.periods.sum()))


def _growing(n: int, total: float) -> Array:
    """Return (q, q^2, ..., q^n) of this sum, above n.

    Newton's method from above the root, which the convex sum of powers brings down to it.
    """
    powers, q = np.arange(1, n + 1), total ** (1.0 / n) + 1.0
    for _ in range(100):
        q -= (np.sum(q ** powers) - total) / np.sum(powers * q ** (powers - 1))
    return np.asarray(q ** powers)
