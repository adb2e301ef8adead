# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One description of a node parameter, used by the YAML reader, by rclpy and by ``--help``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

from manifold_mpc_ros.config import checks as checks
from manifold_mpc_ros.config.yaml_file import read_parameter_file
from manifold_mpc_ros.errors import ConfigurationError

Kind = Literal['float', 'int', 'bool', 'str', 'floats', 'strs', 'names']
Value = float | int | bool | str | list[float] | list[str]

#: Parameters that every rclpy node has; they are nobody's mistake in a parameter file.
ROS_PARAMETERS = ('use_sim_time', 'start_type_description_service')
ROS_PREFIXES = ('qos_overrides.',)


@dataclass(frozen=True)
class ParameterSpec:
    """One parameter of a node: its name, type, shipped value, unit, meaning and valid range.

    ``required`` parameters describe the spacecraft and its tuning: a parameter file gives all of
    them. ``read_only`` ones are fixed when the node starts; the others are read at configure.
    ``name_in_config`` is the attribute of the configuration class where that is not the last
    part of the name. ``lengths`` are the valid numbers of elements of a 'floats' parameter, any
    number when empty. Every name of a 'names' parameter GROUP.names brings the parameters
    GROUP.NAME.X of ``each``; one empty name stands for none, as ROS has no empty list in a file.
    """

    name: str
    kind: Kind
    default: Value
    description: str
    unit: str = ''
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    lengths: tuple[int, ...] = ()
    infinite: bool = False
    required: bool = False
    read_only: bool = False
    name_in_config: str = ''
    each: tuple[ParameterSpec, ...] = ()

    @property
    def field(self) -> str:
        """Name of the attribute that holds the value in the configuration class."""
        return self.name_in_config or self.name.rpartition('.')[2]

    @property
    def valid(self) -> str:
        """What a value has to be, in words."""
        if self.kind == 'floats':
            sizes = ' or '.join(str(length) for length in self.lengths) + ' ' * bool(self.lengths)
            free = ' (.inf: no limit)' if self.infinite else ''
            return f'a list of {sizes}numbers{free}'
        if self.kind == 'strs':
            return 'a list of texts that are not empty'
        if self.kind == 'names':
            return "a list of different names of letters, digits and underscores ([''] for none)"
        if self.choices:
            return 'one of ' + ', '.join(map(repr, self.choices))
        noun = {'float': 'a number', 'int': 'an integer', 'bool': 'true or false',
                'str': 'text that is not empty'}[self.kind]
        bounds = [f'of at least {self.low:g}' if self.low is not None else '',
                  f'of at most {self.high:g}' if self.high is not None else '']
        return ' '.join([noun, ' and '.join(bound for bound in bounds if bound)]).strip()

    def check(self, value: Any) -> Value:
        """Return ``value`` in this parameter's type, or raise ConfigurationError."""
        if self.kind == 'floats':
            return self._check_floats(value)
        if self.kind == 'strs':
            return self._check_texts(value)
        if self.kind == 'names':
            return self._check_names(value)
        if self.kind == 'bool':
            return checks.boolean(self.name, value)
        if self.kind == 'str':
            if not isinstance(value, str) or not value:
                raise ConfigurationError(self.name, value, self.valid)
            return checks.choice(self.name, value, self.choices) if self.choices else value
        if self.kind == 'int' and (isinstance(value, bool) or not isinstance(value, int)):
            raise ConfigurationError(self.name, value, self.valid)
        result = checks.number(self.name, value, self.valid)
        low = -math.inf if self.low is None else self.low
        high = math.inf if self.high is None else self.high
        if not low <= result <= high:
            raise ConfigurationError(self.name, value, self.valid)
        return int(value) if self.kind == 'int' else result

    def _check_names(self, value: Any) -> list[str]:
        """Return a list of names, or of one empty name."""
        names = list(value) if isinstance(value, (list, tuple)) else [value]
        valid = all(isinstance(name, str) and name.isidentifier() for name in names)
        if names != [''] and not (names and valid and len(set(names)) == len(names)):
            raise ConfigurationError(self.name, value, self.valid)
        return names

    def _check_floats(self, value: Any) -> list[float]:
        """Return a list of numbers of a valid length; one bare number is a list of one."""
        given = [value] if isinstance(value, (int, float)) else value
        if not isinstance(given, (list, tuple)) or not given or (
                self.lengths and len(given) not in self.lengths):
            raise ConfigurationError(self.name, value, self.valid)
        if not all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in given):
            raise ConfigurationError(self.name, value, self.valid)
        numbers = checks.array(self.name, list(given), self.valid, infinite=self.infinite)
        return [float(item) for item in numbers]

    def _check_texts(self, value: Any) -> list[str]:
        """Return a list of texts; one bare text is a list of one."""
        given = [value] if isinstance(value, str) else value
        if (not isinstance(given, (list, tuple)) or not given
                or not all(isinstance(each, str) and each for each in given)):
            raise ConfigurationError(self.name, value, self.valid)
        return list(given)


def resolve_parameters(
    specs: Sequence[ParameterSpec], given: Mapping[str, Any], *, complete: bool,
) -> dict[str, Value]:
    """Map the values that were given to one checked value for every parameter of a node.

    ``complete`` asks for every required parameter; otherwise the shipped value stands in for each
    one that is missing.

    Raises ConfigurationError for an unknown name (with the nearest valid one), a missing one, or
    an invalid value.
    """
    specs = with_named(specs, given)
    refuse_unknown(specs, given)
    checks.boolean('use_sim_time', given.get('use_sim_time', False))
    values: dict[str, Value] = {}
    for spec in specs:
        if spec.name in given:
            values[spec.name] = spec.check(given[spec.name])
        elif complete and spec.required:
            raise ConfigurationError(
                spec.name, None, f'{spec.valid}: {spec.description} (the key is missing)')
        else:
            values[spec.name] = spec.check(spec.default)
    return values


def with_named(specs: Sequence[ParameterSpec], given: Mapping[str, Any]
               ) -> tuple[ParameterSpec, ...]:
    """Return a table with the parameters of every name that was given.

    Raises ConfigurationError for a list of names that is not valid.
    """
    table = {spec.name: spec for spec in specs}
    for spec in [spec for spec in specs if spec.each]:
        names = spec.check(given.get(spec.name, spec.default))
        assert isinstance(names, list)
        for name in filter(None, names):
            for one in spec.each:
                full = f'{spec.name.removesuffix("names")}{name}.{one.name}'
                table[full] = replace(one, name=full)
    return tuple(table.values())


def refuse_unknown(specs: Sequence[ParameterSpec], given: Mapping[str, Any]) -> None:
    """Raise ConfigurationError for the first name that is not a parameter of the node."""
    known = [spec.name for spec in specs]
    for name, value in given.items():
        if name in known or name in ROS_PARAMETERS or name.startswith(ROS_PREFIXES):
            continue
        raise ConfigurationError(
            name, value, 'a parameter that exists (unknown key; the nearest is '
            f'{checks.nearest(name, known)!r})')


def read_values(
    path: str | Path, node_name: str, specs: Sequence[ParameterSpec],
) -> dict[str, Value]:
    """Return the checked values of a node in a ROS parameter file, complete; needs no ROS."""
    return resolve_parameters(specs, read_parameter_file(path, node_name), complete=True)


def by_field(
    specs: Sequence[ParameterSpec], values: Mapping[str, Value], config: type[Any],
) -> dict[str, Any]:
    """Return the values that belong to fields of a configuration class, by field name."""
    wanted = {entry.name for entry in fields(config)}
    return {spec.field: values[spec.name] for spec in specs if spec.field in wanted}


def named_as_parameter(
    specs: Sequence[ParameterSpec], error: ConfigurationError,
) -> ConfigurationError:
    """Return ``error`` with the parameter's full name in place of the field's."""
    names = {spec.field: spec.name for spec in specs}
    return ConfigurationError(names.get(error.key, error.key), error.value, error.valid)
