# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags that are written once for all tests of a file."""

from __future__ import annotations

from pathlib import Path

import pytest
from synthetic import STORAGES, run_messages, write_bag


@pytest.fixture(scope='session', params=STORAGES)
def whole(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A whole bag in either storage."""
    return write_bag(tmp_path_factory.mktemp('whole') / 'bag', run_messages(6), request.param)
