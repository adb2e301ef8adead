# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of reaction wheels, of magnetorquers beside them, of simulated wheels."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from manifold_mpc_ros.config import checks as checks
from manifold_mpc_ros.config.parameter import ParameterSpec, Value
from manifold_mpc_ros.config.wheels import NULL_SPACES, WheelArray
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array

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
    return array if failed == [NONE] else array.without(
        marked('wheels.failed', array.names, failed))


def marked(key: str, names: Sequence[str], failed: Sequence[str]) -> Any:
    """Return which devices (n,) bool are in a list of names, which may be [none].

    Raises ConfigurationError for a name that none has.
    """
    strange = set(failed) - {NONE, *names}
    if strange:
        raise ConfigurationError(key, sorted(strange),
                                 f'[{NONE}], or names among: ' + ', '.join(names))
    return np.array([name in failed for name in names])


def _motor(name: str, default: float, description: str, unit: str, **more: Any) -> ParameterSpec:
    """Return the description of a number for each wheel, or for all."""
    return ParameterSpec(f'plant.wheels.{name}', 'floats', [default],
                         f'{description}, of each wheel or of all', unit=unit,
                         name_in_config=f'wheel_motors.{name}', **more)


MOTOR_PARAMETERS: tuple[ParameterSpec, ...] = (
    _motor('initial_speed_rad_s', 0.0, 'speed at the start and after a reset', 'rad/s'),
    _motor('viscous_friction_n_m_s', 0.0, 'friction torque by speed', 'N m s'),
    _motor('coulomb_friction_n_m', 0.0, 'friction torque at any speed but near zero', 'N m'),
    _motor('static_friction_n_m', 0.0, 'friction torque near zero speed (Stribeck)', 'N m'),
    _motor('stribeck_speed_rad_s', 1.0, 'speed to which that reaches', 'rad/s'),
    _motor('speed_noise_std_rad_s', 0.0, 'standard deviation of the reported speed', 'rad/s'),
    _motor('dead_from_s', math.inf, 'time from which the motor gives no torque', 's',
           infinite=True),
    _motor('stuck_from_s', math.inf, 'time from which the wheel does not turn in the body', 's',
           infinite=True),
)


@dataclass(frozen=True, eq=False)
class WheelMotors:
    """The wheels of a simulated body; numbers (n,), or one for all, as `MOTOR_PARAMETERS` say.

    Raises ConfigurationError naming ``wheel_motors.FIELD`` for a number that is not valid, or
    ``wheels.inertia_kg_m2``.
    """

    wheels: WheelArray
    initial_speed_rad_s: Array = 0.0  # type: ignore[assignment]
    viscous_friction_n_m_s: Array = 0.0  # type: ignore[assignment]
    coulomb_friction_n_m: Array = 0.0  # type: ignore[assignment]
    static_friction_n_m: Array = 0.0  # type: ignore[assignment]
    stribeck_speed_rad_s: Array = 1.0  # type: ignore[assignment]
    speed_noise_std_rad_s: Array = 0.0  # type: ignore[assignment]
    dead_from_s: Array = math.inf  # type: ignore[assignment]
    stuck_from_s: Array = math.inf  # type: ignore[assignment]

    def __post_init__(self) -> None:
        """Check every number, and bring it to one a wheel."""
        n = len(self.wheels)
        if self.wheels.inertia_kg_m2 is None:
            raise ConfigurationError('wheels.inertia_kg_m2', None, f'{n} positive numbers')
        for entry in fields(self)[1:]:
            key, valid = f'wheel_motors.{entry.name}', f'one number, or {n}, not below 0'
            value = checks.array(key, getattr(self, entry.name), valid, infinite=True)
            signed, endless = entry.name.startswith('initial'), entry.name.endswith('from_s')
            if value.shape not in ((), (1,), (n,)) or not (signed or (value >= 0.0).all()) or not (
                    endless or np.isfinite(value).all()):
                raise ConfigurationError(key, getattr(self, entry.name), valid)
            object.__setattr__(self, entry.name, checks.frozen(
                np.array(np.broadcast_to(value, (n,)))))

    @classmethod
    def from_parameters(cls, values: Mapping[str, Value]) -> WheelMotors | None:
        """Build from the simulator's checked parameters; None with another kind of actuator."""
        wheels = wheels_of(values)
        if wheels is None:
            return None
        return cls(wheels, **{spec.field.rpartition('.')[2]: values[spec.name]  # type: ignore[arg-type]
                              for spec in MOTOR_PARAMETERS})

    @property
    def inertia_kg_m2(self) -> Array:
        """Moments of inertia about the axes (n,) [kg m^2]."""
        assert self.wheels.inertia_kg_m2 is not None
        return self.wheels.inertia_kg_m2

    def net_torques(
        self, command_n_m: Array, speed_rad_s: Array, momentum_n_m_s: Array,
        time_s: float, step_s: float,
    ) -> Array:
        """Map motor commands (n,) to the torques (n,) about the axes over a step [N m].

        A motor gives no more than its torque, none beyond its momentum, none when it is dead;
        friction is viscous, Coulomb and Stribeck's, in the middle of the step, and stops a wheel
        rather than turn it round; a stuck wheel stops at once.
        """
        array = self.wheels
        J, room = self.inertia_kg_m2, array.max_momentum_n_m_s
        works = array.available & (time_s < self.dead_from_s)
        drive = np.clip(command_n_m, -array.max_torque_n_m, array.max_torque_n_m) * works
        drive = np.clip(drive, np.minimum(0.0, (-room - momentum_n_m_s) / step_s),
                        np.maximum(0.0, (room - momentum_n_m_s) / step_s))
        free = speed_rad_s + step_s * drive / J
        middle = np.abs(speed_rad_s + free) / 2
        friction = self._friction(np.maximum(
            middle - step_s / 2 * self._friction(middle) / J, 0.0))
        friction = np.where(time_s >= self.stuck_from_s, np.inf, friction)
        return np.asarray(drive - np.sign(free) * np.minimum(friction, np.abs(free) * J / step_s))

    def _friction(self, speed_rad_s: Array) -> Array:
        """Return the friction torques (n,) at speeds that are not negative [N m]."""
        beyond = np.maximum(self.static_friction_n_m - self.coulomb_friction_n_m, 0.0)
        with np.errstate(divide='ignore', invalid='ignore'):
            near = np.exp(-(speed_rad_s / self.stribeck_speed_rad_s) ** 2)
        return np.asarray(self.viscous_friction_n_m_s * speed_rad_s + self.coulomb_friction_n_m
                          + np.where(beyond > 0.0, beyond * near, 0.0))


_MAGNETORQUERS = 'magnetorquers.'
#: What turns the body where magnetorquers can act: wheels that store, or nothing else.
_MAGNETIC = ('wheels', 'magnetorquers')

MAX_DIPOLE = ParameterSpec(
    f'{_MAGNETORQUERS}max_dipole_a_m2', 'floats', [0.0],
    'largest dipole about each body axis, either sign; 0: no magnetorquers', unit='A m^2',
    lengths=(1, 3), name_in_config='max_dipole_a_m2')
MAGNETORQUER_PARAMETERS = (
    MAX_DIPOLE,
    ParameterSpec(
        f'{_MAGNETORQUERS}dump_time_s', 'float', 600.0,
        'time constant by which the momentum of wheels is dumped, as the field allows', unit='s',
        low=1e-3, high=1e9),
    ParameterSpec(
        f'{_MAGNETORQUERS}max_error_rad', 'float', 0.01,
        'attitude error above which no momentum is dumped', unit='rad', low=0.0, high=4.0),
    ParameterSpec(
        f'{_MAGNETORQUERS}braking_gain', 'float', 4.4e-3,
        'gain of braking a tumble, over the least moment of inertia: 2 n (1 + sin(inclination)) '
        'for an orbit of rate n', unit='1/s', low=1e-9, high=1e3),
    ParameterSpec(
        f'{_MAGNETORQUERS}field_timeout_s', 'float', 5.0,
        'age above which a measured magnetic field counts for nothing', unit='s', low=1e-3,
        high=1e6),
)


def half_widths(key: str, value: object) -> Array:
    """Return the largest dipoles (3,) of one number or three; 0: none about that axis."""
    valid = 'one number of at least 0, or three [A m^2]'
    given = checks.array(key, value, valid)
    if given.shape not in ((), (1,), (3,)) or not (given >= 0.0).all():
        raise ConfigurationError(key, value, valid)
    return checks.frozen(np.array(np.broadcast_to(given, (3,))))


@dataclass(frozen=True, eq=False)
class Magnetorquers:
    """As `MAGNETORQUER_PARAMETERS` say; ``max_dipole_a_m2`` (3,) or one number for all.

    Raises ConfigurationError for dipoles that are not finite, negative, or all 0.
    """

    max_dipole_a_m2: Array
    dump_time_s: float = 600.0
    max_error_rad: float = 0.01
    braking_gain: float = 4.4e-3
    field_timeout_s: float = 5.0

    def __post_init__(self) -> None:
        """Check the dipoles."""
        object.__setattr__(self, 'max_dipole_a_m2', half_widths(
            MAX_DIPOLE.name, self.max_dipole_a_m2))
        if not self.max_dipole_a_m2.any():
            raise ConfigurationError(MAX_DIPOLE.name, self.max_dipole_a_m2.tolist(),
                                     'above 0 about some axis, for magnetorquers')

    @classmethod
    def from_parameters(cls, values: Mapping[str, Value]) -> Magnetorquers | None:
        """Build from the controller's checked parameters; None without a dipole.

        Raises ConfigurationError too where nothing stores momentum that they could dump.
        """
        given = {spec.name.removeprefix(_MAGNETORQUERS): values[spec.name]
                 for spec in MAGNETORQUER_PARAMETERS}
        kind, dipole = values['actuators.kind'], given['max_dipole_a_m2']
        if kind not in _MAGNETIC and any(dipole):  # type: ignore[arg-type]
            raise ConfigurationError(
                MAX_DIPOLE.name, dipole, f'0 unless actuators.kind is {" or ".join(_MAGNETIC)}')
        if kind != 'magnetorquers' and not any(dipole):  # type: ignore[arg-type]
            return None
        return cls(**given)  # type: ignore[arg-type]
