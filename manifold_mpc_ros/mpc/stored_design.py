# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The terminal design of a configuration, found in the cache where an earlier start left it.

Designing takes about as long as all else of a start together, and its result follows from the
configuration without the horizon and the cones.
"""

from __future__ import annotations

import json
import platform
from contextlib import suppress
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import scipy

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.errors import CacheError
from manifold_mpc_ros.mpc import cache
from manifold_mpc_ros.terminal.design import TerminalDesign
from manifold_mpc_ros.terminal.existence import Existence
from manifold_mpc_ros.terminal.level import LevelReport
from manifold_mpc_ros.terminal.problem_of import terminal_design

# Taken when the modules are imported: sources that change later are not what runs here.
_SOURCES = cache.hash_of_sources(*(f'{layer}/*.py' for layer in (
    'config', 'lie', 'dynamics', 'terminal')))


def stored_design(config: AttitudeMpcConfig, cache_dir: str | Path | None) -> TerminalDesign:
    """Map a configuration to its terminal design, to the bit what `terminal_design` returns.

    Without its cones, which cut the set for every target anew.

    Raises DesignError when the design does not exist.
    """
    config = replace(config, cones=())
    try:
        path = cache.cache_directory(cache_dir) / f'design_{_name(config)}.json'
    except CacheError:  # nowhere to keep it
        return terminal_design(config)
    content = cache.read(path)
    if content is not None:
        return _unpacked(json.loads(content))
    design = terminal_design(config)
    with suppress(OSError):  # the next start designs it again
        cache.write(path, json.dumps(asdict(design), default=np.ndarray.tolist).encode())
    return design


def _name(config: AttitudeMpcConfig) -> str:
    """Return what the design follows from, as a part of a file name."""
    values = {field.name: getattr(config, field.name) for field in fields(config)
              if field.name not in ('horizon', 'horizon_s')}
    facts = {name: value.tobytes() if isinstance(value, np.ndarray) else value
             for name, value in values.items()}
    return cache.name_of(_SOURCES, facts, ca.CasadiMeta.version(), np.__version__,
                         scipy.__version__, platform.machine())


def _unpacked(values: dict[str, Any]) -> TerminalDesign:
    """Return the design that was written."""
    parts: dict[str, Any] = {
        name: np.array(value) if isinstance(value, list) else value
        for name, value in values.items()}
    parts['report'] = LevelReport(**values['report'])
    parts['existence'] = Existence(**values['existence'])
    return TerminalDesign(**parts)
