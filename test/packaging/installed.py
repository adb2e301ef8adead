# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Run commands of an installation and see what an install prefix holds."""

from __future__ import annotations

import os
import re
import selectors
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import IO

import pytest
from ament_index_python.packages import PackageNotFoundError, get_package_prefix

from manifold_mpc_ros.cli.processes import reserved_domain

TOP = Path(__file__).parents[2]
COMMANDS = {'controller', 'guidance', 'simulator', 'markers', 'manifold-mpc'}
PIP = [sys.executable, '-m', 'pip', '--disable-pip-version-check', '--no-input']
BUILD = ['--quiet', '--no-deps', '--no-build-isolation', '--no-index']


def environment(**variables: str) -> dict[str, str]:
    """Return this process's environment, without the checkout on Python's path."""
    path = [folder for folder in os.environ.get('PYTHONPATH', '').split(os.pathsep)
            if folder and Path(folder).resolve() != TOP]
    return {**os.environ, 'PYTHONPATH': os.pathsep.join(path), **variables}


def run(command: Sequence[str | Path], cwd: Path, **variables: str) -> str:
    """Run a command that must succeed and return what it printed."""
    done = subprocess.run([str(word) for word in command], cwd=cwd, text=True, check=False,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=240,
                          env=environment(**variables))
    assert done.returncode == 0, f'{command} ended with {done.returncode}:\n{done.stdout}'
    return done.stdout


def found_by_ros2_run(prefix: Path) -> set[str]:
    """Return the names that ``ros2 run manifold_mpc_ros`` accepts with this prefix alone.

    Its rule: the ament index names the prefix, and any executable file below
    ``lib/manifold_mpc_ros`` of that prefix can be run.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('AMENT_PREFIX_PATH', str(prefix))
        try:
            folder = Path(get_package_prefix('manifold_mpc_ros'), 'lib', 'manifold_mpc_ros')
        except PackageNotFoundError:
            return set()
    return {p.name for p in folder.rglob('*') if p.is_file() and os.access(p, os.X_OK)}


def shipped(folder: Path) -> dict[str, bytes]:
    """Return name and content of package.xml and of the configuration and launch files."""
    files = [folder / 'package.xml', *folder.glob('config/**/*'), *folder.glob('launch/*.py')]
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in files if p.is_file()}


def starts_and_stops(command: Sequence[str | Path], parameters: Path) -> None:
    """Start a node with a parameter file, wait until it is active, end it with SIGINT."""
    arguments = [*map(str, command), '--ros-args', '--params-file', str(parameters)]
    with reserved_domain() as domain, subprocess.Popen(
            arguments, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, cwd=parameters.parent,
            env=environment(ROS_DOMAIN_ID=str(domain))) as node:
        try:
            assert node.stdout is not None
            seen = read_until(rb'\]: active\b', node.stdout, timeout_s=90.0)
            node.send_signal(signal.SIGINT)
            rest, _ = node.communicate(timeout=30.0)
            assert node.returncode == 0, (seen + rest).decode()
        finally:
            node.kill()


def read_until(pattern: bytes, stream: IO[bytes], timeout_s: float) -> bytes:
    """Return what the stream gave up to the pattern; fail at its end or when it is late."""
    seen = b''
    with selectors.DefaultSelector() as selector:
        selector.register(stream, selectors.EVENT_READ)
        while not re.search(pattern, seen):
            assert selector.select(timeout_s), f'no {pattern!r} in {seen.decode()}'
            chunk = os.read(stream.fileno(), 65536)
            assert chunk, f'ended without {pattern!r}: {seen.decode()}'
            seen += chunk
    return seen
