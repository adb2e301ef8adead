# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Descriptions of a stack's messages: topics, types, fields and conventions, from YAML.

The shipped ones are the files in presets/; docs/interfaces.md explains every key. An empty path is
a field that is not there. ``install`` says how to get the package of a message type.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from manifold_mpc_ros.config import checks
from manifold_mpc_ros.config import conventions as to
from manifold_mpc_ros.config.yaml_file import parse_mapping, read_text
from manifold_mpc_ros.errors import ConfigurationError

#: Attributes and indices that lead to a field of a message.
Steps = tuple[str | int, ...]
_FIELD = r'[A-Za-z]\w*(\[\d+\])*'
_PATH = re.compile(rf'{_FIELD}(\.{_FIELD})*', re.ASCII)

PRESETS = Path(__file__).with_name('presets')
#: The shipped choice, and what it was called before it had a file.
PLAIN = 'nav'
EARLIER_NAMES = {'odometry': PLAIN}
#: States that the simulator publishes unless it is told otherwise.
SHIPPED_STATES = (PLAIN, 'imu')
#: Parameters of the controller that are descriptions.
DESCRIBED = ('state_source', 'setpoint_source', 'command_sink')
RECEIPT = 'receipt'
#: Units of a stamp that is a number [ns]; 0 is a time.
STAMP_UNITS_NS = {'time': 0, 's': 10**9, 'ms': 10**6, 'us': 10**3, 'ns': 1}

_TOPIC = ('topic', 'type', 'field', 'stamp', 'stamp_unit', 'body_axes', 'body_frame_id', 'set')
_PART = (*_TOPIC, 'world_axes', 'absent', 'covariance')
_ATTITUDE = (*_PART, 'form', 'direction', 'inertial_frame_id')
_RATE = (*_PART, 'axes', 'unit')
_COMMAND = (*_TOPIC, 'quantity', 'unit', 'sent', 'period_s')
#: What a rate has from the attitude before it unless it says otherwise.
_SHARED = ('topic', 'type', 'stamp', 'stamp_unit', 'body_axes', 'world_axes')


@dataclass(frozen=True)
class Part:
    """An attitude or a rate in the messages of one topic.

    ``stamp`` is the path of a time, or of a number of ``stamp_unit_ns``; without a path it is
    that of the receipt. ``absent`` is a field that is -1 where the quantity is not there.
    ``covariance`` and ``constants`` are only written.
    """

    topic: str
    message_type: str
    install: str
    fields: tuple[Steps, ...]
    convention: Any  # AttitudeConvention or RateConvention
    stamp: Steps
    stamp_unit_ns: int
    absent: Steps
    covariance: Steps
    inertial_frame_id: Steps
    body_frame_id: Steps
    constants: Mapping[Steps, bool | int | float | str]


@dataclass(frozen=True)
class StateDescription:
    """An attitude and a rate, of one message or of two with stamps within ``join_within_ns``."""

    attitude: Part
    rate: Part
    join_within_ns: int


@dataclass(frozen=True)
class CommandMessage:
    """What the messages of one topic say of a command; without ``fields`` no number of it.

    ``quantity``: 'body_torque', 'device' (the command to the devices) or 'dipole' (to
    magnetorquers); a normalised torque is divided by the full scale. ``stamp`` is that of the
    state that is answered, ``sent`` when the message is published. With a period: by itself.
    """

    topic: str
    message_type: str
    install: str
    fields: tuple[Steps, ...]
    quantity: str
    normalised: bool
    body: to.Axes | None
    stamp: Steps
    sent: Steps
    stamp_unit_ns: int
    body_frame_id: Steps
    constants: Mapping[Steps, bool | int | float | str]
    period_s: float


def preset_names() -> list[str]:
    """Return the names of the shipped descriptions."""
    return sorted(path.stem for path in PRESETS.glob('*.yaml'))


@functools.lru_cache(64)
def state_description(given: str, parameter: str = 'state_source') -> StateDescription:
    """Return how states come, by the name of a shipped description or the path of a YAML file.

    Raises ConfigurationError for what does not describe any.
    """
    state = _document(parameter, given, 'state').below(
        'state', ('attitude', 'rate', 'join_within_s'))
    whole = state.below('attitude', _ATTITUDE)
    attitude = whole.attitude()
    rate = state.below('rate', _RATE, {
        key: whole.values[key] for key in _SHARED if key in whole.values}).rate()
    if attitude.topic == rate.topic and attitude.message_type != rate.message_type:
        raise state.error('rate.type', rate.message_type, 'the same type on the same topic')
    if (not attitude.stamp, attitude.stamp_unit_ns) != (not rate.stamp, rate.stamp_unit_ns):
        raise state.error('rate.stamp', rate.stamp, 'of the kind and unit of the attitude')
    return StateDescription(
        attitude, rate, round(1e9 * state.number('join_within_s')))


@functools.lru_cache(64)
def setpoint_description(given: str) -> Part:
    """Return how commanded attitudes come; as `state_description`."""
    return _document('setpoint_source', given, 'setpoint').below(
        'setpoint', _ATTITUDE, {'stamp': RECEIPT}).attitude()


@functools.lru_cache(64)
def command_description(
    given: str, parameter: str = 'command_sink',
) -> tuple[CommandMessage, ...]:
    """Return the messages of a command; as `state_description`."""
    document = _document(parameter, given, 'command')
    listed = document.values['command']
    if not isinstance(listed, list) or not any(
            isinstance(each, Mapping) and 'field' in each for each in listed):
        raise document.error('command', listed, 'a list of messages, of which one has a field')
    return tuple(_Section(f'{document.where}.command[{index}]', each, _COMMAND,
                          document.install).command() for index, each in enumerate(listed))


def is_text(given: str) -> bool:
    """Say whether a description is YAML itself, in lines, and neither a name nor a path."""
    return '\n' in given


@functools.lru_cache(64)
def text_of(given: str) -> str:
    """Return the YAML of a description that is a file, which says the same anywhere."""
    return read_text(given, 'description') if _is_path(given) and not is_text(given) else given


def _is_path(given: str) -> bool:
    return given.endswith(('.yaml', '.yml'))


def steps_of(key: str, path: object) -> Steps:
    """Return the steps of a path; raises ConfigurationError naming ``key``."""
    if not isinstance(path, str) or not _PATH.fullmatch(path):
        raise ConfigurationError(key, path, 'a path of fields such as pose.orientation or data[2]')
    return tuple(int(step) if step.isdecimal() else step for step in re.findall(r'\w+', path))


def _document(parameter: str, given: str, key: str) -> _Section:
    """Return a description that has a key."""
    name = EARLIER_NAMES.get(given, given)
    shipped = preset_names()
    if name not in shipped and not is_text(given) and not _is_path(given):
        of_key = [each for each in shipped if re.search(
            rf'^{key}:', (PRESETS / f'{each}.yaml').read_text(encoding='utf-8'), re.MULTILINE)]
        names = ', '.join(map(repr, [*EARLIER_NAMES, *of_key]))
        raise ConfigurationError(parameter, given, f'one of {names}, or your own YAML file')
    path = PRESETS / f'{name}.yaml' if name in shipped else Path(given)
    source, text = (parameter, given) if is_text(given) else (
        str(path), read_text(path, parameter))
    document = _Section(Path(source).name, parse_mapping(text, 'description', source),
                        ('state', 'setpoint', 'command', 'install'), {})
    if key not in document.values:
        raise ConfigurationError(parameter, given, f'a description with the key {key!r}')
    document.install = document.values.get('install', {})
    if not isinstance(document.install, Mapping):
        raise document.error('install', document.install, 'how to get each package, by its name')
    return document


class _Section:
    """One mapping of a description, and the keys that lead to it."""

    def __init__(
        self, where: str, values: Any, known: Sequence[str], install: Mapping[str, str],
    ) -> None:
        """Refuse what is no mapping, and the first key that is unknown."""
        self.where, self.install = where, install
        if not isinstance(values, Mapping):
            raise ConfigurationError(where, values, 'a mapping of ' + ', '.join(known))
        for key, value in values.items():
            if key not in known:
                raise self.error(
                    key, value, f'no such key (the nearest is {checks.nearest(key, known)!r})')
        self.values: dict[str, Any] = dict(values)

    def below(
        self, key: str, known: Sequence[str], shared: Mapping[str, Any] | None = None,
    ) -> _Section:
        """Return the mapping of a key, with what it shares with another one."""
        section = _Section(f'{self.where}.{key}', self.values.get(key), known, self.install)
        section.values = {**(shared or {}), **section.values}
        return section

    def error(self, key: str, value: object, valid: str) -> ConfigurationError:
        """Return the error of a key."""
        return ConfigurationError(f'{self.where}.{key}', value, valid)

    def number(self, key: str) -> float:
        """Return a number of at least zero, which is the default."""
        return checks.non_negative(f'{self.where}.{key}', self.values.get(key, 0.0))

    def choice(self, key: str, choices: Sequence[str]) -> str:
        """Return one of several texts, the first where none is given."""
        return checks.choice(f'{self.where}.{key}', self.values.get(key, choices[0]), choices)

    def steps(self, key: str) -> Steps:
        """Return the path of a field, empty where none is given, and for the receipt."""
        path = self.values.get(key, RECEIPT)
        return () if path == RECEIPT else steps_of(f'{self.where}.{key}', path)

    def axes(self, key: str, named: to.Named) -> to.Axes | None:
        """Return the axes of the stack, None for ours."""
        return to.axes_of(f'{self.where}.{key}', self.values.get(key, next(iter(named))), named)

    def attitude(self) -> Part:
        """Return the description of an attitude."""
        return self._part(to.AttitudeConvention(
            self.choice('form', [*to.FORMS]), self.choice('direction', to.DIRECTIONS),
            self.axes('world_axes', to.WORLD_AXES), self.axes('body_axes', to.BODY_AXES)))

    def rate(self) -> Part:
        """Return the description of a rate."""
        return self._part(to.RateConvention(
            self.choice('axes', to.RATE_AXES), self.choice('unit', [*to.RATE_UNITS]),
            self.axes('world_axes', to.WORLD_AXES), self.axes('body_axes', to.BODY_AXES)))

    def command(self) -> CommandMessage:
        """Return the description of one message of a command."""
        quantity = self.choice('quantity', ['body_torque', 'device', 'dipole'])
        period_s = self.number('period_s')
        if period_s and 'field' in self.values:
            raise self.error('period_s', period_s, 'left out where there is a field')
        return CommandMessage(
            **self._topic(), fields=self._fields(0 if quantity == 'device' else 3),
            quantity=quantity,
            normalised=self.choice('unit', ['N m', 'normalised']) == 'normalised',
            body=self.axes('body_axes', to.BODY_AXES), sent=self.steps('sent'), period_s=period_s)

    def _part(self, convention: to.AttitudeConvention | to.RateConvention) -> Part:
        """Return what every part of a state has."""
        if 'stamp' not in self.values or 'field' not in self.values:
            key = 'field' if 'stamp' in self.values else 'stamp'
            raise self.error(key, None, f'a path, or {RECEIPT!r} for a stamp')
        return Part(
            **self._topic(), fields=self._fields(len(convention.names)), convention=convention,
            absent=self.steps('absent'), covariance=self.steps('covariance'),
            inertial_frame_id=self.steps('inertial_frame_id'))

    def _topic(self) -> dict[str, Any]:
        """Return what every message has."""
        topic, kind = self.values.get('topic'), self.values.get('type')
        if not isinstance(topic, str) or not re.fullmatch(
                r'[~/]?[A-Za-z_]\w*(/[A-Za-z_]\w*)*', topic, re.ASCII):
            raise self.error('topic', topic, 'the name of a topic')
        if not isinstance(kind, str) or not re.fullmatch(r'\w+/msg/\w+', kind, re.ASCII):
            raise self.error('type', kind, 'a message type package/msg/Name')
        constants = self.values.get('set', {})
        if not isinstance(constants, Mapping) or not all(
                isinstance(value, (bool, int, float, str)) for value in constants.values()):
            raise self.error('set', constants, 'a number, text, true or false for each path')
        return {'topic': topic, 'message_type': kind, 'stamp': self.steps('stamp'),
                'install': self.install.get(kind.partition('/')[0], ''),
                'stamp_unit_ns': STAMP_UNITS_NS[self.choice('stamp_unit', [*STAMP_UNITS_NS])],
                'body_frame_id': self.steps('body_frame_id'),
                'constants': {steps_of(f'{self.where}.set', path): value
                              for path, value in constants.items()}}

    def _fields(self, count: int) -> tuple[Steps, ...]:
        """Return the path of a quantity, or those of its ``count`` numbers (0: any number)."""
        given = self.values.get('field', [])
        paths = given if isinstance(given, list) else [given]
        if len(paths) not in (0, 1, count or len(paths)):
            raise self.error('field', given, f'the path of one field, or of {count} numbers')
        return tuple(steps_of(f'{self.where}.field', path) for path in paths)
