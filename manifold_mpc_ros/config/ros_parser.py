# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sections of a ROS parameter file, read as a node reads them (rcl_yaml_param_parser).

ROS does not build a tree: it follows the events of the YAML scanner with a few counters. Here the
same events move the same counters, so that a file which ROS reads in an unexpected way (an empty
``{}`` ends its section, a list in a list loses its brackets) or refuses (an alias, a key without a
value) is read or refused in the same way without ROS.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import yaml

from manifold_mpc_ros.config.ros_scalar import Scalar, ros_scalar
from manifold_mpc_ros.errors import ConfigurationError

PARAMETERS_KEY = 'ros__parameters'
RosValue = Scalar | list[Scalar] | None

_LOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)  # libyaml is what ROS uses
_TEXT_TAG = 'tag:yaml.org,2002:str'
_TOKEN = re.compile('[A-Za-z_][A-Za-z0-9_]*')
_BELOW = f'nested keys: a node, then {PARAMETERS_KEY!r}, then its parameters'
#: A key that is given several values of different types keeps the first of these.
_TYPES = (bool, int, float, str)


@dataclass
class _Parameter:
    """One parameter: its dotted name, and the last value that it was given of each type."""

    name: str
    scalars: dict[type, Scalar] = field(default_factory=dict)
    lists: dict[type, list[Scalar]] = field(default_factory=dict)

    @property
    def value(self) -> RosValue:
        """The value that the node gets; None for an empty list and an empty group."""
        for kept in (self.scalars, self.lists):
            for kind in _TYPES:
                if kind in kept:
                    return kept[kind]
        return None


def parse_ros_parameters(text: str, source: str) -> list[tuple[str, dict[str, RosValue]]]:
    """Map the text of a parameter file to (``/sat1/node``, dotted parameters) of each section.

    Raises ConfigurationError where ROS refuses the file: the key, or the ``source`` of the text,
    and the line.
    """
    machine = _Machine(source)
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            machine.take(event)
    except yaml.YAMLError as error:
        reason = ' '.join(str(error).split())
        raise ConfigurationError('parameter file', source, f'valid YAML ({reason})') from None
    return [('/' + section.removeprefix('/'), {each.name: each.value for each in parameters})
            for section, parameters in machine.sections.items()]


class _Machine:
    """The state of ROS's parser between two events of the YAML scanner."""

    def __init__(self, source: str) -> None:
        """Begin before the file."""
        self._source = source
        self._line = 0
        self.sections: dict[str, list[_Parameter]] = {}
        self._node_path = ''
        self._node_depth = 0
        self._group = ''
        self._group_depth = 0
        self._depth = 0
        self._in_parameters = False
        self._key_next = True
        self._new_map = False
        self._in_list = False
        self._list_type: type | None = None
        self._parameters: list[_Parameter] = []
        self._index = 0

    def take(self, event: yaml.Event) -> None:
        """Move by one event."""
        mark = event.start_mark
        self._line = mark.line + 1 if mark else self._line
        if isinstance(event, yaml.ScalarEvent):
            self._key(event.value) if self._key_next else self._value(event)
        elif isinstance(event, yaml.MappingStartEvent):
            self._depth += 1
            self._key_next = True
            self._new_map = not (
                self._in_parameters and self._depth - self._node_depth == 3)
        elif isinstance(event, yaml.MappingEndEvent):
            self._end_mapping()
        elif isinstance(event, yaml.SequenceStartEvent):
            self._refuse(self._key_next, 'a list', 'a key, or one list and none inside it')
            self._refuse(not self._in_parameters, 'a list', _BELOW)
            self._in_list, self._list_type = True, None
        elif isinstance(event, yaml.SequenceEndEvent):
            self._in_list, self._key_next = False, True
        elif isinstance(event, yaml.AliasEvent):
            self._refuse(True, f'*{event.anchor}', 'the value itself, not an alias')

    def _refuse(self, wrong: bool, given: object, expected: str) -> None:
        """Raise ConfigurationError with the present key and line when something is wrong."""
        if wrong:
            inside = self._in_parameters and self._index < len(self._parameters)
            raise ConfigurationError(
                self._parameters[self._index].name if inside else self._source, given,
                f'{expected} (line {self._line} of {self._source}; ROS reads nothing of such a '
                'file)')

    def _key(self, text: str) -> None:
        """Take the name of a part of a node's path, of a group, or of a parameter."""
        self._refuse(not text, text, 'a key')
        text = text.partition('\0')[0]
        if self._in_parameters:
            self._parameter(text)
        elif not text.startswith(PARAMETERS_KEY):
            apart = '' if self._node_path.endswith('/') or not self._node_depth else '/'
            self._node_path += apart + text
            self._node_depth += 1
        else:
            self._refuse(not _is_node_path(self._node_path), self._node_path,
                         f"a node's name above {PARAMETERS_KEY!r}")
            self._parameters = self.sections.setdefault(self._node_path, [])
            self._leave_node()
            self._in_parameters = True
        self._key_next = False

    def _parameter(self, name: str) -> None:
        """Find the parameter of a name, or make it; the key before a new map was a group."""
        if self._new_map:
            self._refuse(self._index >= len(self._parameters), name, 'a name above its group')
            self._group = self._parameters[self._index].name
            self._group_depth += 1
            self._new_map = False
        sought = self._group if self._group_depth else name
        names = [each.name for each in self._parameters]
        self._index = names.index(sought) if sought in names else len(names)
        if self._index == len(names):
            self._parameters.append(_Parameter(sought))
        if self._group_depth:
            self._parameters[self._index].name = f'{self._group}.{name}'

    def _value(self, event: yaml.ScalarEvent) -> None:
        """Give the present parameter a value, or its list one more."""
        self._refuse(not self._in_parameters or self._index >= len(self._parameters),
                     event.value, _BELOW)
        quoted = event.style in ("'", '"')
        self._refuse(not event.value and not quoted, None, 'a value')
        value = ros_scalar(event.value, plain=not quoted and event.tag != _TEXT_TAG)
        kept = self._parameters[self._index]
        if not self._in_list:
            kept.scalars[type(value)] = value
            self._key_next = True
            return
        if self._list_type is None:
            self._list_type = type(value)
            kept.lists[self._list_type] = []
        self._refuse(type(value) is not self._list_type, value, (
            'a list of one type, 1.0 where the others are 0.5'))
        kept.lists[self._list_type].append(value)

    def _end_mapping(self) -> None:
        """Leave a group, a section's parameters, or a part of a node's path."""
        if self._in_parameters:
            if self._group_depth:
                self._group_depth -= 1
                self._group = _without_last(self._group, '.')
            else:
                self._in_parameters = False
        elif self._depth == self._node_depth + 1:
            self._leave_node()
        self._depth -= 1

    def _leave_node(self) -> None:
        """Remove the last part of the node's path."""
        if self._node_depth:
            self._node_depth -= 1
            self._node_path = _without_last(self._node_path, '/') if self._node_depth else ''


def _without_last(path: str, separator: str) -> str:
    """Return a path without its last part; a single part stays."""
    return path.rpartition(separator)[0] if separator in path else path


def _is_node_path(path: str) -> bool:
    """Whether ROS takes a section's key: tokens, or the wildcards ``*`` and ``**``."""
    if path in ('/**', '/*'):
        return True
    return all(part in ('*', '**') or _TOKEN.fullmatch(part)
               for part in path.removeprefix('/').split('/'))
