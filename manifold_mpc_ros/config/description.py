# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Descriptions of a stack's messages: topics, types, fields and conventions, from YAML.

The shipped ones are the files in presets/; docs/interfaces.md explains every key.
"""

from __future__ import annotations

import difflib
import functools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from manifold_mpc_ros.config import checks
from manifold_mpc_ros.config import conventions as to
from manifold_mpc_ros.config.field_path import Steps, steps_of
from manifold_mpc_ros.config.yaml_file import parse_mapping, read_text
from manifold_mpc_ros.errors import ConfigurationError

PRESETS = Path(__file__).with_name('presets')
#: The shipped choice, and what it was called before it had a file.
PLAIN = 'nav'
EARLIER_NAMES = {'odometry': PLAIN}
#: Units of a stamp that is a number [ns].
STAMP_UNITS_NS = {'s': 10**9, 'ms': 10**6, 'us': 10**3, 'ns': 1}
RECEIPT = 'receipt'

_SECTIONS = ('state', 'setpoint', 'command', 'install')
_PART_KEYS = ('topic', 'type', 'field', 'stamp', 'stamp_unit', 'absent', 'body_axes', 'world_axes',
              'body_frame_id')
_ATTITUDE_KEYS = (*_PART_KEYS, 'form', 'direction', 'inertial_frame_id')
_RATE_KEYS = (*_PART_KEYS, 'axes', 'unit')
#: What a rate has from the attitude before it unless it says otherwise.
_SHARED_KEYS = ('topic', 'type', 'stamp', 'stamp_unit', 'body_axes', 'world_axes')


@dataclass(frozen=True)
class Stamp:
    """Where a stamp is: no path: on receipt; no unit: a time; else a number of the unit [ns]."""

    steps: Steps = ()
    unit_ns: int = 0

    @property
    def kind(self) -> str:
        """What it is, in words."""
        return 'a number' if self.unit_ns else 'a time' if self.steps else RECEIPT


@dataclass(frozen=True)
class Part:
    """One quantity in the messages of one topic; an empty path is a field that is not there.

    ``absent`` is a field that is -1 where the quantity is not there (REP-145).
    """

    topic: str
    message_type: str
    fields: tuple[Steps, ...]
    stamp: Stamp
    absent: Steps
    inertial_frame_id: Steps
    body_frame_id: Steps

    @property
    def names(self) -> str:
        """One character for each number."""
        return 'xyz'


@dataclass(frozen=True)
class AttitudePart(Part):
    """An attitude in messages."""

    convention: to.AttitudeConvention

    @property
    def names(self) -> str:
        """One character for each number."""
        return to.FORMS[self.convention.form]


@dataclass(frozen=True)
class RatePart(Part):
    """A body rate in messages."""

    convention: to.RateConvention


@dataclass(frozen=True)
class StateDescription:
    """Attitude and rate, of one message or of two whose stamps are within ``join_within_ns``.

    ``install`` says how to get message packages.
    """

    attitude: AttitudePart
    rate: RatePart
    join_within_ns: int
    install: Mapping[str, str]

    @property
    def topics(self) -> dict[str, str]:
        """The type of the messages on each topic."""
        return {part.topic: part.message_type for part in (self.attitude, self.rate)}


def preset_names() -> list[str]:
    """Return the names of the shipped descriptions."""
    return sorted(path.stem for path in PRESETS.glob('*.yaml'))


@functools.lru_cache(64)
def state_description(given: str) -> StateDescription:
    """Return how states come, by the name of a preset or the path of a YAML file.

    Raises ConfigurationError for what does not describe any.
    """
    section, install = _section('state_source', given, 'state', ('attitude', 'rate',
                                                                 'join_within_s'))
    whole = section.below('attitude', _ATTITUDE_KEYS)
    attitude = _attitude(whole)
    rate = _rate(section.below('rate', _RATE_KEYS, {
        key: whole.values[key] for key in _SHARED_KEYS if key in whole.values}))
    if attitude.topic == rate.topic and attitude.message_type != rate.message_type:
        raise section.error('rate.type', rate.message_type, 'the same type on the same topic')
    if attitude.stamp.kind != rate.stamp.kind:
        raise section.error('rate.stamp', rate.stamp.kind, f'{attitude.stamp.kind}, as before')
    join_within_s = checks.non_negative(
        f'{section.where}.join_within_s', section.values.get('join_within_s', 0.0))
    return StateDescription(attitude, rate, round(1e9 * join_within_s), install)


class _Section:
    """One mapping of a description, and the keys that lead to it."""

    def __init__(self, where: str, values: Any, known: Sequence[str]) -> None:
        """Refuse what is no mapping, and the first key that is unknown."""
        self.where = where
        if not isinstance(values, Mapping):
            raise ConfigurationError(where, values, 'a mapping of ' + ', '.join(known))
        for key, value in values.items():
            if key not in known:
                nearest = difflib.get_close_matches(str(key), known, n=1, cutoff=0.0)[0]
                raise self.error(key, value, f'no such key (the nearest is {nearest!r})')
        self.values: Mapping[str, Any] = values

    def below(
        self, key: str, known: Sequence[str], shared: Mapping[str, Any] | None = None,
    ) -> _Section:
        """Return the mapping of a key, with what it shares with another one."""
        section = _Section(f'{self.where}.{key}', self.values.get(key), known)
        section.values = {**(shared or {}), **section.values}
        return section

    def error(self, key: str, value: object, valid: str) -> ConfigurationError:
        """Return the error of a key."""
        return ConfigurationError(f'{self.where}.{key}', value, valid)

    def text(self, key: str, pattern: str, valid: str) -> str:
        """Return a text of a form."""
        value = self.values.get(key)
        if not isinstance(value, str) or not re.fullmatch(pattern, value, re.ASCII):
            raise self.error(key, value, valid)
        return value

    def topic(self) -> str:
        """Return the name of the topic."""
        return self.text('topic', r'[~/]?[A-Za-z_]\w*(/[A-Za-z_]\w*)*', 'the name of a topic')

    def message_type(self) -> str:
        """Return the type of the messages."""
        return self.text('type', r'\w+/msg/\w+', 'a message type package/msg/Name')

    def choice(self, key: str, choices: Sequence[str]) -> str:
        """Return one of several texts, the first where none is given."""
        return checks.choice(
            f'{self.where}.{key}', self.values.get(key, choices[0]), list(choices))

    def steps(self, key: str) -> Steps:
        """Return the path of a field, empty where none is given."""
        return steps_of(f'{self.where}.{key}', self.values[key]) if key in self.values else ()

    def fields(self, count: int) -> tuple[Steps, ...]:
        """Return the path of a quantity, or those of its ``count`` numbers."""
        given = self.values.get('field')
        paths = given if isinstance(given, list) else [given]
        if len(paths) not in (1, count):
            raise self.error('field', given, f'the path of one field, or of {count} numbers')
        return tuple(steps_of(f'{self.where}.field', path) for path in paths)

    def stamp(self) -> Stamp:
        """Return where the stamp is."""
        if self.values.get('stamp') == RECEIPT:
            return Stamp()
        if 'stamp' not in self.values:
            raise self.error('stamp', None, f'the path of the stamp, or {RECEIPT!r}')
        unit = self.choice('stamp_unit', list(STAMP_UNITS_NS)) if (
            'stamp_unit' in self.values) else ''
        return Stamp(self.steps('stamp'), STAMP_UNITS_NS.get(unit, 0))

    def axes(self, key: str, named: dict[str, to.Rows | None]) -> to.Axes | None:
        """Return the axes of the stack, None for ours."""
        return to.axes_of(f'{self.where}.{key}', self.values.get(key, next(iter(named))), named)

    def part(self, count: int) -> dict[str, Any]:
        """Return what every part of a state has, of so many numbers."""
        return {
            'topic': self.topic(), 'message_type': self.message_type(),
            'fields': self.fields(count), 'stamp': self.stamp(), 'absent': self.steps('absent'),
            'inertial_frame_id': self.steps('inertial_frame_id'),
            'body_frame_id': self.steps('body_frame_id')}


def _section(
    parameter: str, given: str, name: str, known: Sequence[str],
) -> tuple[_Section, Mapping[str, str]]:
    """Return a section of a description, and how to install message packages."""
    preset = EARLIER_NAMES.get(given, given)
    if preset not in preset_names() and not given.endswith(('.yaml', '.yml')):
        names = ', '.join(map(repr, [*EARLIER_NAMES, *preset_names()]))
        raise ConfigurationError(parameter, given, f'one of {names}, or your own YAML file')
    path = PRESETS / f'{preset}.yaml' if preset in preset_names() else Path(given)
    document = _Section(path.name, parse_mapping(
        read_text(path, parameter), 'description', str(path)), _SECTIONS)
    if name not in document.values:
        raise ConfigurationError(parameter, given, f'a description with the key {name!r}')
    install = document.values.get('install', {})
    if not isinstance(install, Mapping):
        raise document.error('install', install, 'how to get each message package, by its name')
    return document.below(name, known), install


def _attitude(section: _Section) -> AttitudePart:
    """Return the description of an attitude."""
    convention = to.AttitudeConvention(
        section.choice('form', list(to.FORMS)), section.choice('direction', to.DIRECTIONS),
        section.axes('world_axes', to.WORLD_AXES), section.axes('body_axes', to.BODY_AXES))
    return AttitudePart(**section.part(len(to.FORMS[convention.form])), convention=convention)


def _rate(section: _Section) -> RatePart:
    """Return the description of a rate."""
    convention = to.RateConvention(
        section.choice('axes', to.RATE_AXES), section.choice('unit', list(to.RATE_UNITS)),
        section.axes('world_axes', to.WORLD_AXES), section.axes('body_axes', to.BODY_AXES))
    return RatePart(**section.part(3), convention=convention)
