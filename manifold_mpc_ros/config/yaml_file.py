# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reader of ROS parameter files that needs no ROS."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from manifold_mpc_ros.errors import ConfigurationError

_PARAMETERS = 'ros__parameters'


class _Loader(yaml.SafeLoader):
    """YAML 1.1 with the exponents that ROS accepts too: ``1e-3`` is a number, not text."""


_Loader.add_implicit_resolver(
    'tag:yaml.org,2002:float', re.compile(r'^[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+$'),
    list('-+0123456789'))


def read_parameter_file(path: str | Path, node_name: str) -> dict[str, Any]:
    """Return the parameters that a ROS parameter file gives to a node, as dotted names.

    A section belongs to the node when the last part of its key is the node's name, whatever the
    namespace, or a wildcard (``/**``, ``/*``). Where several sections match, the later one wins
    for each parameter, as in ROS; two sections for the node in two namespaces are refused.

    Raises
    ------
    ConfigurationError
        When the file cannot be read, is not YAML, or has no section for the node.

    """
    document = _read(path)
    named: list[str] = []
    found: dict[str, Any] = {}
    matched = False
    for section, parameters in _sections(document, ''):
        last = section.rpartition('/')[2]
        if last not in (node_name, '*', '**'):
            continue
        matched = True
        if last == node_name:
            named.append(section)
        if not isinstance(parameters, Mapping):
            raise ConfigurationError(f'{section}.{_PARAMETERS}', parameters, 'nested keys')
        found.update(_flatten(parameters, ''))
    if not matched:
        raise ConfigurationError(
            str(path), sorted(map(str, document)),
            f'a section {node_name!r} with the key {_PARAMETERS!r}')
    if len(named) > 1:
        raise ConfigurationError(str(path), named, f'one section for {node_name!r}')
    return found


def check_parameter_file(path: str | Path) -> None:
    """Raise ConfigurationError unless ROS can read the file, whichever nodes it is for."""
    for section, parameters in _sections(_read(path), ''):
        if isinstance(parameters, Mapping):
            _flatten(parameters, '')
        elif parameters is not None:
            raise ConfigurationError(f'{section}.{_PARAMETERS}', parameters, 'nested keys')


def read_text(path: str | Path, what: str) -> str:
    """Return the text of a file; ``what`` it is names it in the ConfigurationError otherwise."""
    try:
        return Path(path).read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else 'not UTF-8 text'
        raise ConfigurationError(what, str(path), f'a readable YAML file ({reason})') from None


def parse_mapping(text: str, what: str, source: str) -> Mapping[str, Any]:
    """Return the top-level mapping of YAML text; raises ConfigurationError naming ``source``."""
    try:
        document = yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as error:
        raise ConfigurationError(
            what, source, 'valid YAML (' + ' '.join(str(error).split()) + ')') from None
    if not isinstance(document, Mapping):
        raise ConfigurationError(source, document, f'a {what} (nested keys)')
    return document


def flatten_parameters(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Return nested groups of parameters as one level with dotted names, as ROS has them."""
    return _flatten(tree, '')


def _read(path: str | Path) -> Mapping[str, Any]:
    """Return the top-level mapping of a ROS parameter file."""
    return parse_mapping(read_text(path, 'parameter file'), 'ROS parameter file', str(path))


def _sections(tree: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    """Yield (node path, parameters) for every section of a parameter file."""
    for key, branch in tree.items():
        section = f'{prefix}/{str(key).strip("/")}'
        if isinstance(branch, Mapping):
            if _PARAMETERS in branch:
                yield section, branch[_PARAMETERS]
            yield from _sections(
                {name: value for name, value in branch.items() if name != _PARAMETERS}, section)


def _flatten(tree: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """Return nested groups as one level with dotted names."""
    flat: dict[str, Any] = {}
    for key, value in tree.items():
        name = f'{prefix}{key}'
        if isinstance(value, Mapping) and value:
            flat.update(_flatten(value, f'{name}.'))
        else:
            flat[name] = _ros_value(name, value)
    return flat


def _ros_value(name: str, value: Any) -> Any:
    """Return a value that ROS can hold: a scalar, or a list of scalars of one type."""
    items = value if isinstance(value, list) else [value]
    if not items or not all(isinstance(item, (bool, int, float, str)) for item in items):
        raise ConfigurationError(name, value, 'a number, text, true or false, or a list of them')
    if len({type(item) for item in items}) > 1:
        raise ConfigurationError(
            name, value, 'a list of one type (ROS asks for 1.0 where the others are 0.5)')
    return value
