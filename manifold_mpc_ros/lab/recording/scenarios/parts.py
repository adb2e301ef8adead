# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parts of a scenario: setpoints, faults, limits; each reads and checks its own keys."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from manifold_mpc_ros.config import checks as checks
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.recording.scenarios.keys import (
    ACCEPTANCE_KEYS,
    FAULT_GROUPS,
    LINK_KEYS,
    SETPOINT_KEYS,
    STOP_KEYS,
    check_group,
)
from manifold_mpc_ros.lie.arrays import Array


@dataclass(frozen=True, eq=False)
class Setpoint:
    """What is commanded from ``at_s`` on: an attitude, or a direction for the pointing axis.

    With ``cone`` it is no command: from then on the cone of that name has this direction.
    ``guidance`` is a mode of guidance: an attitude that moves.
    """

    at_s: float
    attitude_xyzw: Array | None = None
    direction_N: Array | None = None
    cone: str | None = None
    guidance: str | None = None

    @classmethod
    def from_mapping(cls, given: object, prefix: str) -> Setpoint:
        """Read one element of ``setpoints``."""
        values = check_group(SETPOINT_KEYS, {}, given, prefix)
        if sum(key in values for key in ('attitude_xyzw', 'direction_N', 'guidance')) != 1:
            raise ConfigurationError(
                prefix.rstrip('.'), given, 'either attitude_xyzw or direction_N, or guidance')
        if 'cone' in values and 'direction_N' not in values:
            raise ConfigurationError(f'{prefix}cone', values['cone'], 'left out, or direction_N')
        if 'attitude_xyzw' in values:
            values['attitude_xyzw'] = checks.unit_quaternion(
                f'{prefix}attitude_xyzw', values['attitude_xyzw'])
        elif 'direction_N' in values:
            values['direction_N'] = checks.direction(
                f'{prefix}direction_N', values['direction_N'])
        return cls(**values)


@dataclass(frozen=True)
class LinkFault:
    """What a link does to messages: loses some, delivers the others late."""

    drop_probability: float = 0.0
    delay_s: float = 0.0
    seed: int = 0

    @property
    def acts(self) -> bool:
        """Whether it does anything at all."""
        return self.drop_probability > 0.0 or self.delay_s > 0.0


@dataclass(frozen=True)
class Stop:
    """A time in which the controller's process is stopped."""

    at_s: float
    for_s: float


@dataclass(frozen=True)
class Faults:
    """Everything that goes wrong on purpose."""

    state_link: LinkFault = field(default_factory=LinkFault)
    command_link: LinkFault = field(default_factory=LinkFault)
    controller_stops: tuple[Stop, ...] = ()

    @classmethod
    def from_mapping(cls, given: object) -> Faults:
        """Read the group ``faults``."""
        values = check_group((), FAULT_GROUPS, given, 'faults.')
        for name in ('state_link', 'command_link'):
            if name in values:
                values[name] = LinkFault(
                    **check_group(LINK_KEYS, {}, values[name], f'faults.{name}.'))
        stops = tuple(
            Stop(**check_group(STOP_KEYS, {}, item, f'faults.controller_stops[{index}].'))
            for index, item in enumerate(values.get('controller_stops', ())))
        for index, (one, other) in enumerate(itertools.pairwise(stops), start=1):
            if other.at_s < one.at_s + one.for_s:
                raise ConfigurationError(
                    f'faults.controller_stops[{index}].at_s', other.at_s,
                    f'at least {one.at_s + one.for_s:g}, the end of the one before')
        return replace(cls(**values), controller_stops=stops)


@dataclass(frozen=True, eq=False)
class AcceptanceLimits:
    """What a run is judged by; None is not judged. `ACCEPTANCE_KEYS` describes each."""

    attitude_tolerance_deg: float = 0.1
    rate_tolerance_rad_s: float = 1e-3
    settle_time_s: float | None = None
    final_error_deg: float | None = None
    final_rate_rad_s: float | None = None
    peak_torque_n_m: Array | None = None
    peak_rate_rad_s: Array | None = None
    violations: int | None = None
    cone_violation_s: float | None = None
    solver_time_p99_ms: float | None = None
    promises_broken: int | None = None
    infeasible_ticks: int | None = None
    hold_ticks: int | None = None
    fallback_ticks: int | None = None
    coast_ticks: int | None = None
    refused_messages: int | None = None

    @classmethod
    def from_mapping(cls, given: object) -> AcceptanceLimits:
        """Read the group ``acceptance``."""
        values: dict[str, Any] = check_group(ACCEPTANCE_KEYS, {}, given, 'acceptance.')
        for name in ('peak_torque_n_m', 'peak_rate_rad_s'):
            if name in values:
                values[name] = _box(f'acceptance.{name}', values[name])
        return cls(**values)


def setpoints_from(given: object) -> tuple[Setpoint, ...]:
    """Read the list ``setpoints``, which is in the order of time."""
    items = given if isinstance(given, (list, tuple)) else ()
    setpoints = tuple(Setpoint.from_mapping(item, f'setpoints[{index}].')
                      for index, item in enumerate(items))
    for index, (one, other) in enumerate(itertools.pairwise(setpoints), start=1):
        if other.at_s <= one.at_s:
            raise ConfigurationError(
                f'setpoints[{index}].at_s', other.at_s, f'more than {one.at_s:g}, the one before')
    return setpoints


def as_mapping(value: object) -> Mapping[str, Any]:
    """Return a group that was left out as one without keys."""
    return value if isinstance(value, Mapping) else {}


def _box(key: str, values: list[float]) -> Array:
    """Return one or three bounds as a read-only (3,)."""
    if min(values) < 0.0:
        raise ConfigurationError(key, values, '1 or 3 numbers of at least 0')
    return checks.frozen(np.array(np.broadcast_to(np.array(values), (3,))))
