# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters as a study has them, nested, in the forms of ROS: dotted names, and a file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import yaml

from manifold_mpc_ros.config.ros_parser import PARAMETERS_KEY
from manifold_mpc_ros.errors import ConfigurationError


class _Dumper(yaml.SafeDumper):
    """YAML with quoted text and no alias."""

    def ignore_aliases(self, _data: Any) -> bool:
        """Write everything out."""
        return True


_Dumper.add_representer(str, lambda dumper, text: dumper.represent_scalar(
    'tag:yaml.org,2002:str', text, style="'"))


def parameter_file_text(node_name: str, values: Mapping[str, Any]) -> str:
    """Return the text of a parameter file that gives ``values`` to a node in any namespace.

    Text is quoted and nothing is an alias: ROS takes ``1e5`` and ``nan`` for numbers and ``n``
    for false where YAML does not, and refuses aliases.
    """
    return yaml.dump({f'/**/{node_name}': {PARAMETERS_KEY: dict(values)}}, Dumper=_Dumper)


def flatten_parameters(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Return nested groups of parameters as one level with dotted names, as ROS has them."""
    return _flatten(tree, '')


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
