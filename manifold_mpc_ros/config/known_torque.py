# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Torques that act unasked and are known: a constant, gravity gradient, a table over the orbit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from manifold_mpc_ros.config import checks
from manifold_mpc_ros.config.orbit import ORBIT_PARAMETERS, CircularOrbit
from manifold_mpc_ros.config.parameter import ParameterSpec, Value
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array

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
