# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters that describe reaction wheels, the same for controller and simulator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from manifold_mpc_ros.config.parameter import ParameterSpec, Value
from manifold_mpc_ros.config.wheels import NULL_SPACES, WheelArray
from manifold_mpc_ros.errors import ConfigurationError

_KEY = 'actuators.wheels.'
#: In a list of names: there is none.
NONE = 'none'


def _wheels(name: str, default: Value, description: str, unit: str, kind: Any = 'floats',
            **more: Any) -> ParameterSpec:
    """Return the description of one parameter of the wheels."""
    return ParameterSpec(_KEY + name, kind, default, f'{description} (actuators.kind: wheels)',
                         unit=unit, name_in_config=f'wheels.{name}', **more)


WHEEL_PARAMETERS: tuple[ParameterSpec, ...] = (
    _wheels('names', ['wheel_1', 'wheel_2', 'wheel_3', 'wheel_4'],
            'names of the wheels in wheel_states', '', 'strs', read_only=True),
    _wheels('axes_B', [1.0, 1.0, 1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0, 1.0, -1.0, 1.0],
            'their axes in body axes, three numbers a wheel', '1'),
    _wheels('max_torque_n_m', [0.5], 'largest motor torque of each, or of all', 'N m'),
    _wheels('max_momentum_n_m_s', [4.0],
            'largest momentum about its axis of each, or of all', 'N m s'),
    _wheels('inertia_kg_m2', [0.01],
            'moment of inertia about its axis of each, or of all; that of the body is without it',
            'kg m^2'),
    _wheels('failed', [NONE], 'names of the wheels that do not work', '', 'strs'),
)
NULL_SPACE = _wheels('null_space', 'least_torque', 'what motor torques that turn nothing are for',
                     '', 'str', choices=NULL_SPACES)


def wheels_of(values: Mapping[str, Value]) -> WheelArray | None:
    """Map a node's checked parameters to its wheels, None with another kind of actuator.

    Raises ConfigurationError naming ``wheels.FIELD``, its value and what would be valid.
    """
    if values.get('actuators.kind') != 'wheels':
        return None
    given: dict[str, Any] = {spec.field.rpartition('.')[2]: values[spec.name]
                             for spec in (*WHEEL_PARAMETERS, NULL_SPACE) if spec.name in values}
    failed = given.pop('failed')
    array = WheelArray(**given)
    return array if failed == [NONE] else array.without(marked(array.names, failed))


def marked(names: Sequence[str], failed: Sequence[str]) -> Any:
    """Return which wheels (n,) bool are in a list of names, which may be [none].

    Raises ConfigurationError for a name that no wheel has.
    """
    strange = set(failed) - {NONE, *names}
    if strange:
        raise ConfigurationError('wheels.failed', sorted(strange),
                                 f'[{NONE}], or names of wheels: ' + ', '.join(names))
    return np.array([name in failed for name in names])
