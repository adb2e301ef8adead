# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A rig for each test that asks for one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from harness import Rig


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    """Give a domain with a watching node; nothing is left on it afterwards."""
    from harness import open_rig

    with open_rig(tmp_path) as opened:
        yield opened


@pytest.fixture(scope='session')
def bond_package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the message package ``bond``, whose fields are public; return its folder."""
    import message_packages

    if message_packages.missing():
        pytest.skip(f'bond cannot be built without {message_packages.missing()}')
    folder = tmp_path_factory.mktemp('bond')
    message_packages.build(folder, 'bond', {'Status': (
        'std_msgs/Header header\nstring id\nstring instance_id\nbool active\n'
        'float32 heartbeat_timeout\nfloat32 heartbeat_period\n')},
        'std_msgs', 'builtin_interfaces')
    return folder
