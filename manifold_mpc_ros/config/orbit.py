# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A circular orbit about the Earth, and torques that are known on it; their parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from manifold_mpc_ros.config import checks as checks
from manifold_mpc_ros.config.parameter import ParameterSpec, Value
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array

EARTH_GM_M3_S2 = 3.986004418e14
EARTH_RADIUS_M = 6378137.0


def _angle(name: str, description: str, high: float = 360.0) -> ParameterSpec:
    """Return the description of an angle of the orbit."""
    return ParameterSpec(f'orbit.{name}_deg', 'float', 0.0, description, unit='deg', low=-high,
                         high=high, name_in_config=f'orbit.{name}_rad')


ORBIT_PARAMETERS: tuple[ParameterSpec, ...] = (
    ParameterSpec(
        'orbit.altitude_m', 'float', 0.0,
        'height of a circular orbit above the equator, on which gravity gradient and magnetic '
        'field act; 0: no orbit', unit='m', low=0.0, high=1e9,
        name_in_config='orbit.altitude_m'),
    _angle('inclination', 'angle of the orbit to the equator', 180.0),
    _angle('ascending_node', 'angle from x to where the orbit crosses the equator northwards'),
    _angle('phase', 'angle from there to the spacecraft at time zero'),
)


@dataclass(frozen=True)
class CircularOrbit:
    """An orbit of constant height; angles as `ORBIT_PARAMETERS` say, in radians.

    Raises ConfigurationError naming ``orbit.FIELD``, its value and what would be valid.
    """

    altitude_m: float
    inclination_rad: float = 0.0
    ascending_node_rad: float = 0.0
    phase_rad: float = 0.0

    def __post_init__(self) -> None:
        """Check every number."""
        checks.positive('orbit.altitude_m', self.altitude_m)
        for name in ('inclination_rad', 'ascending_node_rad', 'phase_rad'):
            checks.number(f'orbit.{name}', getattr(self, name), 'a finite angle [rad]')

    @classmethod
    def from_parameters(cls, values: Mapping[str, Value]) -> CircularOrbit | None:
        """Build from a node's checked parameters; None for an altitude of 0."""
        altitude, *angles = (float(values[spec.name])  # type: ignore[arg-type]
                             for spec in ORBIT_PARAMETERS)
        return cls(altitude, *map(math.radians, angles)) if altitude > 0.0 else None

    @property
    def radius_m(self) -> float:
        """Distance from the Earth's centre [m]."""
        return EARTH_RADIUS_M + self.altitude_m

    @property
    def rate_rad_s(self) -> float:
        """Mean motion ``sqrt(GM / r^3)`` [rad/s]."""
        return math.sqrt(EARTH_GM_M3_S2 / self.radius_m ** 3)

    def angle_rad(self, time_s: float) -> float:
        """Return the angle from the ascending node at a time, ``u = phase + rate time``."""
        return self.phase_rad + self.rate_rad_s * time_s

    def position_N_m(self, time_s: float) -> Array:
        """Return the place (3,) at a time: ``r (cos u p + sin u q)``, u = phase + rate time [m].

        p points to the ascending node, q at right angles in the orbit's plane.
        """
        u = self.angle_rad(time_s)
        node, tilt = self.ascending_node_rad, self.inclination_rad
        p = np.array([math.cos(node), math.sin(node), 0.0])
        q = np.array([-math.cos(tilt) * math.sin(node), math.cos(tilt) * math.cos(node),
                      math.sin(tilt)])
        return np.asarray(self.radius_m * (math.cos(u) * p + math.sin(u) * q))


_GROUP = 'disturbance.known.'
KNOWN_PARAMETERS: tuple[ParameterSpec, ...] = (
    ParameterSpec(
        f'{_GROUP}constant_n_m', 'floats', [0.0, 0.0, 0.0],
        'constant torque in body axes that plans count on', unit='N m', lengths=(3,)),
    ParameterSpec(
        f'{_GROUP}gravity_gradient', 'bool', False,
        'count on the gravity gradient of the orbit (orbit.altitude_m above 0)'),
    ParameterSpec(
        f'{_GROUP}table_n_m', 'floats', [0.0, 0.0, 0.0],
        'torques in body axes, three numbers each, at equal angles round the orbit from the '
        'ascending node on, linear between', unit='N m'),
    *ORBIT_PARAMETERS,
    ParameterSpec(
        'orbit.epoch_s', 'float', 0.0, 'time of orbit.phase_deg, seconds since 1970 (UTC)',
        unit='s', low=0.0, high=1e11, name_in_config='orbit.epoch_s'),
)


@dataclass(frozen=True, eq=False)
class KnownTorque:
    """As `KNOWN_PARAMETERS` say: constant_n_m (3,), table_n_m (m, 3), the orbit from ``epoch_s``.

    Raises ConfigurationError for a table of other than three numbers a place, and for gravity
    gradient or a table of several places without an orbit.
    """

    inertia_kg_m2: Array
    constant_n_m: Array
    gravity_gradient: bool
    table_n_m: Array
    orbit: CircularOrbit | None
    epoch_s: float

    @classmethod
    def from_parameters(cls, values: Mapping[str, Value], inertia_kg_m2: Array
                        ) -> KnownTorque | None:
        """Build from the controller's checked parameters; None where nothing is known."""
        constant, gradient, table = (values[spec.name] for spec in KNOWN_PARAMETERS[:3])
        rows = checks.array(f'{_GROUP}table_n_m', table, 'three numbers for each place')
        if rows.size % 3 or not rows.size:
            raise ConfigurationError(f'{_GROUP}table_n_m', table, 'three numbers for each place')
        orbit = CircularOrbit.from_parameters(values)
        if orbit is None and (gradient or rows.size > 3):
            raise ConfigurationError('orbit.altitude_m', 0.0, f'above 0 with {_GROUP}*')
        constant_n_m = checks.array(f'{_GROUP}constant_n_m', constant, '3 finite numbers')
        if not (gradient or rows.any() or constant_n_m.any()):
            return None
        return cls(inertia_kg_m2, constant_n_m, bool(gradient), rows.reshape(-1, 3), orbit,
                   float(values['orbit.epoch_s']))  # type: ignore[arg-type]
