# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""On/off thrusters: where they are, which way they push, how much and how briefly they can."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from manifold_mpc_ros.config import checks as checks
from manifold_mpc_ros.config.parameter import ParameterSpec, Value
from manifold_mpc_ros.config.wheel_parameters import NONE, marked
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array

_KEY = 'actuators.thrusters.'
#: Standard gravity, by which a specific impulse is one [m/s^2].
_GRAVITY_M_S2 = 9.80665


def _thrusters(name: str, default: Value, description: str, unit: str, kind: Any = 'floats',
               **more: Any) -> ParameterSpec:
    """Return the description of one parameter of the thrusters."""
    return ParameterSpec(_KEY + name, kind, default, f'{description} (actuators.kind: thrusters)',
                         unit=unit, name_in_config=f'thrusters.{name}', **more)


THRUSTER_PARAMETERS: tuple[ParameterSpec, ...] = (
    _thrusters('names', [f'thruster_{i}' for i in range(1, 7)], 'names of the thrusters', '',
               'strs', read_only=True),
    _thrusters('positions_B_m', [0.0, 0.5, 0.0, 0.0, -0.5, 0.0, 0.0, 0.0, 0.5,
                                 0.0, 0.0, -0.5, 0.5, 0.0, 0.0, -0.5, 0.0, 0.0],
               'where they push, from the mass centre, three numbers a thruster', 'm'),
    _thrusters('directions_B', [0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0,
                                1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0],
               'which way they push the body, three numbers a thruster', '1'),
    _thrusters('force_n', [1.0], 'force of each, or of all', 'N'),
    _thrusters('min_on_time_s', [0.02], 'shortest pulse of each, or of all', 's'),
    _thrusters('specific_impulse_s', [220.0], 'specific impulse of each, or of all', 's'),
    _thrusters('failed', [NONE], 'names of the thrusters that do not work', '', 'strs'),
)
THRUSTER_OFF = ParameterSpec(
    'plant.thrusters.off_from_s', 'floats', [math.inf],
    'time from which a thruster gives nothing, of each or of all', unit='s', infinite=True,
    name_in_config='thruster_off_from_s')


@dataclass(frozen=True, eq=False)
class ThrusterArray:
    """On/off thrusters, n of them; as `THRUSTER_PARAMETERS` say, one number for all or each.

    Raises ConfigurationError naming ``thrusters.FIELD``, its value and what would be valid; for
    thrusters that do not give torque about every axis, either way, too. ``longest`` (n,) is 1, 0
    for one that does not work or turn the body.
    """

    positions_B_m: Array
    directions_B: Array
    force_n: Array
    min_on_time_s: Array = 0.02  # type: ignore[assignment]
    specific_impulse_s: Array = 220.0  # type: ignore[assignment]
    names: Sequence[str] = ()
    failed: Sequence[str] = ()
    longest: Array = field(init=False)

    def __post_init__(self) -> None:
        """Check every field."""
        for name in ('positions_B_m', 'directions_B'):
            valid = 'three numbers for each of four thrusters or more'
            given = checks.array(f'thrusters.{name}', getattr(self, name), valid).reshape(-1)
            if given.size % 3 or given.size < 12:
                raise ConfigurationError(f'thrusters.{name}', getattr(self, name), valid)
            object.__setattr__(self, name, checks.frozen(given.reshape(-1, 3)))
        n, length = len(self.positions_B_m), np.linalg.norm(self.directions_B, axis=1)
        if len(length) != n or not (length > 1e-9).all():
            raise ConfigurationError('thrusters.directions_B', self.directions_B.tolist(),
                                     f'{n} directions, none of them zero')
        object.__setattr__(self, 'directions_B', checks.frozen(
            self.directions_B / length[:, None]))
        for name in ('force_n', 'min_on_time_s', 'specific_impulse_s'):
            object.__setattr__(self, name, checks.each_positive(
                f'thrusters.{name}', getattr(self, name), n))
        names = tuple(self.names) or tuple(f'thruster_{i + 1}' for i in range(n))
        if len(set(names)) != n:
            raise ConfigurationError('thrusters.names', self.names, f'{n} names, each of its own')
        object.__setattr__(self, 'names', names)
        works = self.matrix * ~marked('thrusters.failed', names, self.failed)
        object.__setattr__(self, 'longest', checks.frozen(np.array(works.any(axis=0), float)))
        from scipy.optimize import nnls
        for axis in np.vstack([np.eye(3), -np.eye(3)]):
            if nnls(works / np.abs(self.matrix).max(), axis)[1] > 1e-6:
                raise ConfigurationError(
                    'thrusters.positions_B_m', self.positions_B_m.tolist(),
                    f'working thrusters that give torque about {axis.tolist()} too')

    def __len__(self) -> int:
        """Return the number of thrusters."""
        return len(self.names)

    @classmethod
    def from_parameters(cls, values: Mapping[str, Value]) -> ThrusterArray | None:
        """Build from a node's checked parameters; None with another kind of actuator."""
        if values.get('actuators.kind') != 'thrusters':
            return None
        return cls(**{spec.field.rpartition('.')[2]: values[spec.name]  # type: ignore[arg-type]
                      for spec in THRUSTER_PARAMETERS})

    @cached_property
    def matrix(self) -> Array:
        """The torque ``r x d F`` (3, n) of each [N m]."""
        return np.asarray(np.cross(self.positions_B_m, self.directions_B).T * self.force_n)

    @cached_property
    def flow_kg_s(self) -> Array:
        """What each uses while it is on, ``F / (Isp g_0)`` (n,) [kg/s]."""
        return np.asarray(self.force_n / (self.specific_impulse_s * _GRAVITY_M_S2))
