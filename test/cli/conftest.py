# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameter files that are quick to run, and the command as a function."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from manifold_mpc_ros.cli.main import main

CONFIG = Path(__file__).parents[2] / 'config'


@pytest.fixture
def write_config(tmp_path: Path) -> Callable[..., Path]:
    """Write a shipped parameter file with some of its dotted names changed; return where."""
    def write(which: str, **changed: Any) -> Path:
        document = yaml.safe_load((CONFIG / f'{which}.yaml').read_text(encoding='utf-8'))
        (section,) = document.values()
        for name, value in changed.items():
            *groups, last = name.split('.')
            target = section['ros__parameters']
            for group in groups:
                target = target.setdefault(group, {})
            target[last] = value
        path = tmp_path / f'{which}_changed.yaml'
        path.write_text(yaml.safe_dump(document), encoding='utf-8')
        return path
    return write


@pytest.fixture
def quick_controller(write_config: Callable[..., Path]) -> Path:
    """A controller that is built in a second or two without a compiler."""
    return write_config('controller', **{
        'mpc.horizon': 5, 'mpc.terminal_constraint': False,
        'limits.max_rate_rad_s': [float('inf')] * 3})


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run ``manifold-mpc`` in this process; return exit status, stdout and stderr."""
    def run(*arguments: object) -> tuple[int, str, str]:
        try:
            status = main([str(argument) for argument in arguments])
        except SystemExit as end:
            status = int(end.code or 0)
        captured = capsys.readouterr()
        return status, captured.out, captured.err
    return run
