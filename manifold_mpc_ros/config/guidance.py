# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of guidance, and its configuration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from manifold_mpc_ros.config import checks
from manifold_mpc_ros.config.orbit import EARTH_RADIUS_M
from manifold_mpc_ros.config.parameter import ParameterSpec, Value, by_field
from manifold_mpc_ros.config.tables import AUTOSTART, BOND_PERIOD, INERTIAL_FRAME, SECURE
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array

GUIDANCE_NAME = 'attitude_guidance'
#: What to aim at; those that need an orbit, and whether it has to be above the ground.
ORBITING = ('nadir', 'velocity', 'target')
MODES = ('inertial', 'spin', 'sun', *ORBITING)


def _orbit(name: str, default: float, description: str, unit: str, low: float, high: float
           ) -> ParameterSpec:
    """Return the description of an element of the orbit."""
    return ParameterSpec(f'orbit.{name}', 'float', default, description, unit=unit, low=low,
                         high=high)


GUIDANCE_PARAMETERS: tuple[ParameterSpec, ...] = (
    ParameterSpec(
        'mode', 'str', 'inertial',
        'what the axis points at: what attitude_xyzw says (inertial), or turns about from there '
        '(spin), the Sun, the centre of the Earth (nadir), the velocity, a target on the ground',
        choices=MODES),
    ParameterSpec(
        'axis_B', 'floats', [0.0, 0.0, 1.0], 'body axis that points', unit='1', lengths=(3,)),
    ParameterSpec(
        'second_axis_B', 'floats', [1.0, 0.0, 0.0],
        'body axis that is turned as near as it goes to the velocity; to nadir in mode velocity, '
        'to the north of the ecliptic in mode sun', unit='1', lengths=(3,)),
    ParameterSpec(
        'attitude_xyzw', 'floats', [0.0, 0.0, 0.0, 1.0],
        'attitude of modes inertial and spin, body to inertial', unit='1', lengths=(4,)),
    ParameterSpec(
        'spin_rate_rad_s', 'float', 0.01, 'rate about axis_B of mode spin', unit='rad/s',
        low=-10.0, high=10.0),
    ParameterSpec(
        'target.latitude_deg', 'float', 0.0, 'geodetic latitude of the target (WGS 84)',
        unit='deg', low=-90.0, high=90.0, name_in_config='latitude_deg'),
    ParameterSpec(
        'target.longitude_deg', 'float', 0.0, 'longitude of the target, east', unit='deg',
        low=-360.0, high=360.0, name_in_config='longitude_deg'),
    ParameterSpec(
        'target.altitude_m', 'float', 0.0, 'height of the target above the ellipsoid', unit='m',
        low=-1e4, high=1e6),
    ParameterSpec(
        'orbit.tle', 'strs', ['none'],
        'the two lines of a TLE, of 69 characters each (needs sgp4); none: the elements below'),
    _orbit('semi_major_axis_m', 6.878e6, 'half the long axis', 'm', EARTH_RADIUS_M, 1e9),
    _orbit('eccentricity', 0.0, 'eccentricity', '1', 0.0, 0.99),
    _orbit('inclination_deg', 97.4, 'angle to the equator', 'deg', 0.0, 180.0),
    _orbit('ascending_node_deg', 0.0, 'from x to the ascending node', 'deg', -360.0, 360.0),
    _orbit('perigee_deg', 0.0, 'from the node to the perigee', 'deg', -360.0, 360.0),
    _orbit('mean_anomaly_deg', 0.0, 'mean anomaly at the epoch', 'deg', -360.0, 360.0),
    _orbit('epoch_s', 0.0, 'time of the elements, seconds since 1970 (UTC)', 's', 0.0, 1e11),
    ParameterSpec(
        'period_s', 'float', 5.0, 'wall clock between two publications', unit='s', low=0.1,
        high=60.0, read_only=True),
    ParameterSpec(
        'ahead_s', 'float', 60.0, 'time that a published reference reaches ahead: the horizon of '
        'the controller and a period at least', unit='s', low=1.0, high=3600.0),
    INERTIAL_FRAME,
    BOND_PERIOD,
    AUTOSTART,
    SECURE,
)


@dataclass(frozen=True, eq=False)
class GuidanceConfig:
    """Everything that ``config/guidance.yaml`` says; its comments describe each field.

    Raises ConfigurationError for axes that are parallel, a quaternion that is none, or a TLE of
    other than two lines.
    """

    mode: str
    axis_B: Array
    second_axis_B: Array
    attitude_xyzw: Array
    spin_rate_rad_s: float
    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    tle: list[str]
    semi_major_axis_m: float
    eccentricity: float
    inclination_deg: float
    ascending_node_deg: float
    perigee_deg: float
    mean_anomaly_deg: float
    epoch_s: float
    period_s: float
    ahead_s: float
    inertial_frame_id: str

    def __post_init__(self) -> None:
        """Check what is more than a number in a range."""
        checks.fields(self, {'axis_B': checks.direction, 'second_axis_B': checks.direction,
                             'attitude_xyzw': checks.unit_quaternion})
        if np.linalg.norm(np.cross(self.axis_B, self.second_axis_B)) < 1e-3:
            raise ConfigurationError('second_axis_B', self.second_axis_B.tolist(),
                                     'a direction across axis_B')
        if self.tle != ['none'] and [len(line) for line in self.tle] != [69, 69]:
            raise ConfigurationError('orbit.tle', self.tle, 'two lines of 69 characters, or none')
        perigee_m = self.semi_major_axis_m * (1.0 - self.eccentricity)
        if perigee_m < EARTH_RADIUS_M:
            raise ConfigurationError('orbit.eccentricity', self.eccentricity,
                                     f'an orbit that stays above {EARTH_RADIUS_M:.0f} m')

    @classmethod
    def from_parameters(cls, values: Mapping[str, Value]) -> GuidanceConfig:
        """Build from the node's checked parameters; raises ConfigurationError."""
        chosen = by_field(GUIDANCE_PARAMETERS, values, cls)
        return cls(**chosen)
