# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Definitions of message types: ROS's own, those in a bag, those of installed packages."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from pathlib import Path

from rosbags.interfaces import MessageDefinitionFormat
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from manifold_mpc_ros.errors import BagError

#: Text of definitions by the names of types.
Definitions = Iterable[tuple[str, str]]


def standard_types() -> Typestore:
    """Return the definitions of ROS 2 Jazzy."""
    return get_typestore(Stores.ROS2_JAZZY)


def types_of(path: Path, kinds: Iterable[str]) -> Typestore:
    """Return the definitions of types: standard ones, those in a bag, those of installed packages.

    Raises BagError for a type that none of them has.
    """
    store = standard_types()
    for kind in kinds:
        if not (kind in store.fielddefs or learn(store, kind, _in_bag(path))
                or learn(store, kind)):
            raise BagError(f'{path}: the definition of {kind} is neither in the bag nor '
                           f'in an installed package {kind.partition("/")[0]}')
    return store


def learn(store: Typestore, kind: str, definitions: Definitions | None = None) -> bool:
    """Say whether a type is known, with definitions or else with those of its package."""
    if kind not in store.fielddefs:
        for name, text in _installed(kind) if definitions is None else definitions:
            store.register({each: fields for each, fields in get_types_from_msg(
                text, name).items() if each not in store.fielddefs})
    return kind in store.fielddefs


def _in_bag(path: Path) -> Definitions:
    """Return the definitions that a bag carries, none where it cannot be opened as a whole."""
    try:
        with Reader(path) as reader:
            return [(each.msgtype, each.msgdef.data) for each in reader.connections
                    if each.msgdef.format == MessageDefinitionFormat.MSG]
    except Exception:  # noqa: BLE001  (a damaged bag; rosbags has no common error)
        return []


def _installed(kind: str) -> Definitions:
    """Return the definitions of the package of a type."""
    package = kind.partition('/')[0]
    prefixes = [*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix]
    files = [file for prefix in filter(None, prefixes)
             for file in sorted(Path(prefix, 'share', package, 'msg').glob('*.msg'))]
    return [(f'{package}/msg/{file.stem}', file.read_text(encoding='utf-8')) for file in files]
