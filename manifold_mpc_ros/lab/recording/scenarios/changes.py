# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Changes to a node's shipped parameters inside a larger file, checked by the node's own table."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import yaml

from manifold_mpc_ros.config.parameter import ParameterSpec, Value, refuse_unknown, with_named
from manifold_mpc_ros.config.tables import CONTROLLER_NAME, SIMULATOR_NAME
from manifold_mpc_ros.config.yaml_file import parse_mapping, read_parameter_file
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.parameter_files import flatten_parameters

Built = TypeVar('Built')


#: The key of a scenario that names a parameter file of both nodes, beside it.
PARAMETERS = 'parameters'


def with_parameter_file(text: str, path: Path, decided: Container[str]) -> str:
    """Return a scenario's text with the parameters of the file that it names written out.

    The scenario's own changes win; what its ``time`` decides is left out of the file's.
    """
    document = dict(parse_mapping(text, 'scenario', str(path)))
    if PARAMETERS not in document:
        return text
    file = path.parent / str(document.pop(PARAMETERS))
    for group, node in (('controller', CONTROLLER_NAME), ('simulator', SIMULATOR_NAME)):
        own = document.get(group) or {}
        if not isinstance(own, Mapping):
            return text
        shared = {name: value for name, value in read_parameter_file(file, node).items()
                  if name not in decided}
        document[group] = {**shared, **flatten_parameters(own)}
    return yaml.safe_dump(document, sort_keys=False, default_flow_style=None)


def parameter_changes(
    node: str, specs: Sequence[ParameterSpec], given: Mapping[str, Any],
    decided: Mapping[str, str],
) -> dict[str, Value]:
    """Return the checked changes to one node's parameters by dotted name.

    ``decided`` maps the parameters that are not to be given to what decides them.

    Raises ConfigurationError for an unknown or decided parameter or an invalid value, ``node``
    before its name.
    """
    def read() -> dict[str, Value]:
        flat = flatten_parameters(given)
        for name, by in decided.items():
            if name in flat:
                raise ConfigurationError(name, flat[name], f'left out: {by} decides it')
        table = with_named(specs, flat)
        refuse_unknown(table, flat)
        return {spec.name: spec.check(flat[spec.name]) for spec in table if spec.name in flat}
    return named(node, read)


def named(group: str, build: Callable[[], Built]) -> Built:
    """Return what ``build()`` returns; errors carry the group's name before the key's."""
    try:
        return build()
    except ConfigurationError as error:
        raise ConfigurationError(f'{group}.{error.key}', error.value, error.valid) from None
