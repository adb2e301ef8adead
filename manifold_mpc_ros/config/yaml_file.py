# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reader of ROS parameter files that needs no ROS."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from manifold_mpc_ros.config.ros_parser import PARAMETERS_KEY, RosValue, parse_ros_parameters
from manifold_mpc_ros.errors import ConfigurationError


class _Loader(yaml.SafeLoader):
    """YAML 1.1 with the exponents that ROS accepts too: ``1e-3`` is a number, not text."""


_Loader.add_implicit_resolver(
    'tag:yaml.org,2002:float', re.compile(r'^[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+$'),
    list('-+0123456789'))


def read_parameter_file(path: str | Path, node_name: str) -> dict[str, Any]:
    """Return the parameters that a ROS parameter file gives to a node, as dotted names.

    The file is read as the node reads it: the one in the root namespace where a section names
    that, else the one in the namespace that the sections name (``/sat1/attitude_controller``,
    ``/sat1/*``). Where several sections apply, the later one wins for each parameter, as in ROS.

    Raises ConfigurationError when ROS cannot read the file, or it has no section for the node, or
    sections for the node in several namespaces.
    """
    sections = _read(path)
    keys = [section for section, _ in sections]
    names = _full_names(keys, node_name)
    if not names:
        raise ConfigurationError(
            str(path), keys or 'no section',
            f'a section {node_name!r} with the key {PARAMETERS_KEY!r}')
    if len(names) > 1:
        raise ConfigurationError(str(path), names, f'one section for {node_name!r}')
    found: dict[str, Any] = {}
    for section, parameters in sections:
        if applies(section, names[0]):
            found.update(parameters)
    return found


def sections_of(path: str | Path) -> list[str]:
    """Return the keys of a parameter file's sections; ConfigurationError where ROS refuses it."""
    return [section for section, _ in _read(path)]


def applies(section: str, full_name: str) -> bool:
    """Whether a section is for a node: ``*`` is one part of its full name, ``**`` any number."""
    pattern = re.escape(section).replace(r'/\*', r'(/\w+)')
    return re.fullmatch(pattern.replace(r')\*', ')*'), full_name, re.ASCII) is not None


def _full_names(sections: Sequence[str], node_name: str) -> list[str]:
    """Return the full names of the nodes of one name that sections are for; root alone if it is.

    A section with the node's name counts more than one for all nodes, and a namespace more than a
    wildcard, which stands for one part.
    """
    paths = [section.split('/')[1:] for section in sections]
    chosen = [path for path in paths if path[-1] == node_name] or [
        path for path in paths if path[-1] in ('*', '**')]
    spaces = [[part for part in path[:-1] if part != '**'] for path in chosen]
    spaces = [space for space in spaces if '*' not in space] or spaces
    if [] in spaces:
        return [f'/{node_name}']
    return sorted({'/' + '/'.join([*space, node_name]).replace('*', 'any') for space in spaces})


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


def _read(path: str | Path) -> list[tuple[str, dict[str, RosValue]]]:
    """Return the sections of a ROS parameter file."""
    return parse_ros_parameters(read_text(path, 'parameter file'), str(path))
