# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One set of a campaign: how many loops, of which body, what is drawn, what is judged."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from manifold_mpc_ros.config import checks as checks
from manifold_mpc_ros.config.parameter import ParameterSpec
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.campaign import keys
from manifold_mpc_ros.lab.campaign.keys import KINDS, MODEL, PLANT, SET_GROUPS
from manifold_mpc_ros.lab.recording.scenarios.keys import check_group

Numbers = tuple[float, ...]


@dataclass(frozen=True)
class AttitudeDraw:
    """Initial attitudes, seen from the commanded one; `keys.ATTITUDE_KEYS` describes each."""

    kind: str = 'uniform'
    angle_deg: Numbers | None = None
    xyzw: Numbers | None = None


@dataclass(frozen=True)
class RateDraw:
    """Initial body rates."""

    kind: str = 'rest'
    largest_rad_s: float | None = None
    std_rad_s: Numbers | None = None
    rad_s: Numbers | None = None


@dataclass(frozen=True)
class SetpointDraw:
    """Commanded attitudes."""

    kind: str = 'identity'
    xyzw: Numbers | None = None


@dataclass(frozen=True)
class InertiaDraw:
    """Bodies about the model's inertia."""

    moments_part: float = 0.0
    axes_deg: float = 0.0


@dataclass(frozen=True)
class DisturbanceDraw:
    """Constant torques."""

    largest_n_m: float = 0.0
    frame: str = 'body'


@dataclass(frozen=True)
class NoiseDraw:
    """Standard deviations of the sensor noise: the ends of their ranges."""

    attitude_std_rad: Numbers = (0.0,)
    rate_std_rad_s: Numbers = (0.0,)


@dataclass(frozen=True)
class ConesDraw:
    """Cones; `keys.CONE_KEYS` describes each; half angles by the ends of their ranges."""

    most: int
    most_axes: int = 3
    half_angle_deg: Numbers = (12.0, 50.0)
    keep_in_part: float = 0.0
    keep_in_half_angle_deg: Numbers = (70.0, 135.0)
    margin_deg: float = 1.0
    on_the_way: bool = False


@dataclass(frozen=True)
class Limits:
    """What a loop is judged by; None is not judged. `keys.LIMIT_KEYS` describes each."""

    attitude_tolerance_deg: float = 0.1
    rate_tolerance_rad_s: float = 1e-3
    settle_time_s: float | None = None
    final_error_deg: float | None = None
    final_rate_rad_s: float | None = None
    peak_rate_rad_s: Numbers | None = None
    promises_broken: int | None = None
    infeasible_ticks: int | None = None
    limits_exceeded: int | None = None
    feasibility_lost: int | None = None
    turn_changes: int | None = None
    cone_violation_s: float | None = None

    def changed(self, given: object, prefix: str) -> Limits:
        """Return these with the checked keys of a group in their place."""
        values = check_group(keys.LIMIT_KEYS, {}, given, prefix)
        if 'peak_rate_rad_s' in values:
            values['peak_rate_rad_s'] = tuple(values['peak_rate_rad_s'])
        return replace(self, **values)


@dataclass(frozen=True)
class CaseSet:
    """A set of cases: index k is case ``name-k``."""

    name: str
    loops: int
    body: str = MODEL
    attitude: AttitudeDraw = field(default_factory=AttitudeDraw)
    rate: RateDraw = field(default_factory=RateDraw)
    setpoint: SetpointDraw = field(default_factory=SetpointDraw)
    inertia: InertiaDraw = field(default_factory=InertiaDraw)
    disturbance: DisturbanceDraw = field(default_factory=DisturbanceDraw)
    noise: NoiseDraw = field(default_factory=NoiseDraw)
    cones: ConesDraw | None = None
    acceptance: Limits = field(default_factory=Limits)

    @classmethod
    def from_mapping(cls, given: object, prefix: str, acceptance: Limits) -> CaseSet:
        """Read one element of ``sets``; raises ConfigurationError naming the key in full."""
        values = check_group(keys.SET_KEYS, SET_GROUPS, given, prefix)
        if not re.fullmatch(r'[A-Za-z][A-Za-z0-9_]*', values['name']):
            raise ConfigurationError(
                f'{prefix}name', values['name'], 'a letter, then letters, digits and _')
        for group in ('inertia', 'disturbance', 'noise'):
            if group in values and values.get('body', MODEL) == MODEL:
                raise ConfigurationError(
                    f'{prefix}{group}', values[group],
                    f'left out, or body: {PLANT} (the model has none)')
        values['acceptance'] = acceptance.changed(
            values.get('acceptance', {}), f'{prefix}acceptance.')
        for group, read in _READERS.items():
            if group in values:
                values[group] = read(values[group], f'{prefix}{group}.')
        return cls(**values)

    def as_mapping(self) -> dict[str, Any]:
        """Return what a campaign file would say; `from_mapping` reads it back."""
        groups = {name: _given(part) if isinstance(part, dict) else part
                  for name, part in asdict(self).items()}
        if self.body == MODEL:
            for name in ('inertia', 'disturbance', 'noise'):
                del groups[name]
        return _given(groups)


def _given(group: Mapping[str, Any]) -> dict[str, Any]:
    """Return a group without what it leaves out, tuples as lists."""
    return {key: list(value) if isinstance(value, tuple) else value
            for key, value in group.items() if value is not None}


def _of_kind(group: str, specs: Sequence[ParameterSpec], given: object, prefix: str,
             ) -> dict[str, Any]:
    """Return the checked values of a group with ``kind``, lists as tuples."""
    values = check_group(specs, {}, given, prefix)
    kinds = KINDS[group]
    kind = values['kind']
    needed = kinds[kind]
    for key in values:
        if key not in ('kind', needed):
            takes = f'{kind} takes {needed or "no other key"}'
            raise ConfigurationError(f'{prefix}{key}', values[key], f'left out (kind: {takes})')
    if needed is not None and needed not in values:
        spec = next(spec for spec in specs if spec.name == needed)
        raise ConfigurationError(
            f'{prefix}{needed}', None, f'{spec.valid}, which kind: {kind} needs')
    return {key: tuple(value) if isinstance(value, list) else value
            for key, value in values.items()}


def _attitude(given: object, prefix: str) -> AttitudeDraw:
    """Read ``attitude``."""
    values = _of_kind('attitude', keys.ATTITUDE_KEYS, given, prefix)
    if 'angle_deg' in values:
        _check_range(f'{prefix}angle_deg', values['angle_deg'], 180.0)
    return AttitudeDraw(**_unit_quaternion(values, prefix))


def _rate(given: object, prefix: str) -> RateDraw:
    """Read ``rate``."""
    values = _of_kind('rate', keys.RATE_KEYS, given, prefix)
    if min(values.get('std_rad_s', (0.0,))) < 0.0:
        raise ConfigurationError(
            f'{prefix}std_rad_s', list(values['std_rad_s']), '1 or 3 numbers of at least 0')
    return RateDraw(**values)


def _setpoint(given: object, prefix: str) -> SetpointDraw:
    """Read ``setpoint``."""
    values = _of_kind('setpoint', keys.SETPOINT_KEYS, given, prefix)
    return SetpointDraw(**_unit_quaternion(values, prefix))


def _inertia(given: object, prefix: str) -> InertiaDraw:
    """Read ``inertia``."""
    return InertiaDraw(**check_group(keys.INERTIA_KEYS, {}, given, prefix))


def _disturbance(given: object, prefix: str) -> DisturbanceDraw:
    """Read ``disturbance``."""
    return DisturbanceDraw(**check_group(keys.DISTURBANCE_KEYS, {}, given, prefix))


def _noise(given: object, prefix: str) -> NoiseDraw:
    """Read ``noise``."""
    values = check_group(keys.NOISE_KEYS, {}, given, prefix)
    for name, most in (('attitude_std_rad', 3.0), ('rate_std_rad_s', 100.0)):
        if name in values:
            _check_range(f'{prefix}{name}', values[name], most)
    return NoiseDraw(**{name: tuple(value) for name, value in values.items()})


def _cones(given: object, prefix: str) -> ConesDraw:
    """Read ``cones``."""
    values = check_group(keys.CONE_KEYS, {}, given, prefix)
    for name in ('half_angle_deg', 'keep_in_half_angle_deg'):
        if name in values:
            _check_range(f'{prefix}{name}', values[name], 179.0, least=1.0)
            values[name] = tuple(values[name])
    return ConesDraw(**values)


def _unit_quaternion(values: dict[str, Any], prefix: str) -> dict[str, Any]:
    """Return the values after a check of ``xyzw``."""
    if 'xyzw' in values:
        checks.unit_quaternion(f'{prefix}xyzw', list(values['xyzw']))
    return values


def _check_range(key: str, ends: Sequence[float], most: float, least: float = 0.0) -> None:
    """Refuse ends that are too small, too large or in the wrong order."""
    if not least <= ends[0] <= ends[-1] <= most:
        raise ConfigurationError(
            key, list(ends), f'numbers from {least:g} to {most:g}, the smaller one first')


_READERS: dict[str, Callable[[object, str], Any]] = {
    'attitude': _attitude, 'rate': _rate, 'setpoint': _setpoint, 'inertia': _inertia,
    'disturbance': _disturbance, 'noise': _noise, 'cones': _cones}
