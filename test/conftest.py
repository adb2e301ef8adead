# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One cache of compiled solvers for the session, and one controller per configuration."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cases import configuration
from hypothesis import settings

from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

# No example has a time to keep: the machine may be busy.
settings.register_profile('untimed', deadline=None)
settings.load_profile('untimed')


@pytest.fixture(scope='session')
def cache_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the solvers' cache: $MANIFOLD_MPC_CACHE, or a fresh one for all workers."""
    given = os.environ.get('MANIFOLD_MPC_CACHE')
    if given:
        return Path(given)
    base = tmp_path_factory.getbasetemp()
    fresh = (base.parent if 'PYTEST_XDIST_WORKER' in os.environ else base) / 'solvers'
    fresh.mkdir(exist_ok=True)
    return fresh


@pytest.fixture(scope='session')
def controller(cache_dir: Path) -> Callable[..., AttitudeMpc]:
    """Return ``make(**changes)``: the controller of `cases.configuration`, without warm start.

    ``backend`` is one of the changes; the same changes give the same controller.
    """
    made: dict[str, AttitudeMpc] = {}

    def make(**changes: Any) -> AttitudeMpc:
        key = repr(sorted(changes.items()))
        if key not in made:
            backend = changes.pop('backend', 'auto')
            made[key] = AttitudeMpc(
                configuration(**changes), backend=backend, cache_dir=cache_dir)
        made[key].reset()
        return made[key]
    return make
