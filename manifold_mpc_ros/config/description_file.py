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
from pathlib import Path
from typing import Any

from manifold_mpc_ros.config import checks
from manifold_mpc_ros.config import conventions as to
from manifold_mpc_ros.config.description import (
    BODY_TORQUE,
    QUANTITIES,
    RECEIPT,
    TORQUE_UNITS,
    AttitudePart,
    CommandDescription,
    CommandMessage,
    RatePart,
    SetpointDescription,
    Stamp,
    StateDescription,
)
from manifold_mpc_ros.config.field_path import Steps, steps_of
from manifold_mpc_ros.config.yaml_file import parse_mapping, read_text
from manifold_mpc_ros.errors import ConfigurationError

PRESETS = Path(__file__).with_name('presets')
#: The shipped choice, and what it was called before it had a file.
PLAIN = 'nav'
EARLIER_NAMES = {'odometry': PLAIN}
#: Units of a stamp that is a number [ns].
STAMP_UNITS_NS = {'s': 10**9, 'ms': 10**6, 'us': 10**3, 'ns': 1}

_SECTIONS = ('state', 'setpoint', 'command', 'install')
_PART_KEYS = ('topic', 'type', 'field', 'stamp', 'stamp_unit', 'absent', 'body_axes', 'world_axes',
              'body_frame_id')
_ATTITUDE_KEYS = (*_PART_KEYS, 'form', 'direction', 'inertial_frame_id')
_RATE_KEYS = (*_PART_KEYS, 'axes', 'unit')
_COMMAND_KEYS = ('topic', 'type', 'field', 'quantity', 'unit', 'body_axes', 'stamp', 'sent',
                 'stamp_unit', 'body_frame_id', 'set', 'period_s')
#: What a rate has from the attitude before it unless it says otherwise.
_SHARED_KEYS = ('topic', 'type', 'stamp', 'stamp_unit', 'body_axes', 'world_axes')



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


@functools.lru_cache(64)
def setpoint_description(given: str) -> SetpointDescription:
    """Return how commanded attitudes come; as `state_description`."""
    section, install = _section('setpoint_source', given, 'setpoint', _ATTITUDE_KEYS)
    section.values = {'stamp': RECEIPT, **section.values}
    return SetpointDescription(_attitude(section), install)


@functools.lru_cache(64)
def command_description(given: str) -> CommandDescription:
    """Return how commands go out; as `state_description`."""
    document, path = _document('command_sink', given, 'command')
    listed = document.values['command']
    if not isinstance(listed, list) or not listed:
        raise document.error('command', listed, 'a list of messages')
    messages = tuple(_command_message(_Section(f'{path}: command[{index}]', each, _COMMAND_KEYS))
                     for index, each in enumerate(listed))
    if not any(message.fields for message in messages):
        raise document.error('command', listed, 'a message with the key field')
    return CommandDescription(messages, _install(document))


def full_scale(values: Sequence[float]) -> to.Vector:
    """Return the full scale of each axis, from one number or three; raises ConfigurationError."""
    x, y, z = values if len(values) == 3 else (*values, *values, *values)
    if not min(x, y, z) > 0.0:
        raise ConfigurationError('full_scale_torque_n_m', list(values), 'positive numbers')
    return (x, y, z)


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
        """Return the path of a quantity, or those of its ``count`` numbers (0: any number)."""
        given = self.values.get('field')
        paths = given if isinstance(given, list) else [given]
        if len(paths) not in (1, count or len(paths)):
            raise self.error('field', given, f'the path of one field, or of {count} numbers')
        return tuple(steps_of(f'{self.where}.field', path) for path in paths)

    def stamp(self, key: str = 'stamp') -> Stamp:
        """Return where a stamp is."""
        if self.values.get(key) == RECEIPT:
            return Stamp()
        if key not in self.values:
            raise self.error(key, None, f'the path of the stamp, or {RECEIPT!r}')
        unit = self.choice('stamp_unit', list(STAMP_UNITS_NS)) if (
            'stamp_unit' in self.values) else ''
        return Stamp(self.steps(key), STAMP_UNITS_NS.get(unit, 0))

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
    document, _ = _document(parameter, given, name)
    return document.below(name, known), _install(document)


def _document(parameter: str, given: str, name: str) -> tuple[_Section, str]:
    """Return a description that has a key, and the name of its file."""
    preset = EARLIER_NAMES.get(given, given)
    if preset not in preset_names() and not given.endswith(('.yaml', '.yml')):
        names = ', '.join(map(repr, [*EARLIER_NAMES, *preset_names()]))
        raise ConfigurationError(parameter, given, f'one of {names}, or your own YAML file')
    path = PRESETS / f'{preset}.yaml' if preset in preset_names() else Path(given)
    document = _Section(path.name, parse_mapping(
        read_text(path, parameter), 'description', str(path)), _SECTIONS)
    if name not in document.values:
        raise ConfigurationError(parameter, given, f'a description with the key {name!r}')
    return document, path.name


def _install(document: _Section) -> Mapping[str, str]:
    """Return how to get message packages."""
    install = document.values.get('install', {})
    if not isinstance(install, Mapping):
        raise document.error('install', install, 'how to get each message package, by its name')
    return install


def _command_message(section: _Section) -> CommandMessage:
    """Return the description of one message of a command."""
    quantity, given = section.choice('quantity', QUANTITIES), section.values
    constants = given.get('set', {})
    if not isinstance(constants, Mapping) or not all(
            isinstance(value, (bool, int, float, str)) for value in constants.values()):
        raise section.error('set', constants, 'a number, text, true or false for each path')
    period_s = checks.non_negative(f'{section.where}.period_s', given.get('period_s', 0.0))
    if period_s and 'field' in given:
        raise section.error('period_s', period_s, 'left out where there is a field')
    return CommandMessage(
        topic=section.topic(), message_type=section.message_type(),
        fields=section.fields(3 if quantity == BODY_TORQUE else 0) if 'field' in given else (),
        quantity=quantity, normalised=section.choice('unit', TORQUE_UNITS) == 'normalised',
        body=section.axes('body_axes', to.BODY_AXES),
        stamp=section.stamp() if 'stamp' in given else Stamp(),
        sent=section.stamp('sent') if 'sent' in given else Stamp(),
        body_frame_id=section.steps('body_frame_id'),
        constants=tuple((steps_of(f'{section.where}.set', path), value)
                        for path, value in constants.items()),
        period_s=period_s)


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
