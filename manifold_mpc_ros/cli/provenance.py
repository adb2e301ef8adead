# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which software a recording comes from."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import subprocess
from pathlib import Path

import manifold_mpc_ros

#: What the result of a run may depend on.
WHEELS = ('casadi', 'numpy', 'scipy', 'rosbags', 'ros-jazzy-rclpy', 'ros-jazzy-rmw-fastrtps-cpp',
          'ros-jazzy-common-interfaces')
_GIT_TIMEOUT_S = 5.0


def versions(rmw: str) -> dict[str, str]:
    """Return the versions of the package, its revision, Python, ROS and the wheels in use."""
    found = {
        'manifold_mpc_ros': _installed('manifold_mpc_ros') or 'source tree, not installed',
        'revision': revision(),
        'python': platform.python_version(),
        'machine': platform.machine(),
        'processor': processor(),
        'ros_distro': os.environ.get('ROS_DISTRO', 'jazzy'),
        'rmw': rmw,
    }
    for wheel in WHEELS:
        found[wheel] = _installed(wheel)
    return {name: version for name, version in found.items() if version}


def revision() -> str:
    """Return what git calls the sources in use, empty where they are not a checkout."""
    top = Path(manifold_mpc_ros.__path__[0]).resolve().parent
    if not (top / '.git').exists():
        return ''
    try:
        done = subprocess.run(
            ['git', '-C', str(top), 'describe', '--always', '--dirty', '--tags'], text=True,
            capture_output=True, check=False, timeout=_GIT_TIMEOUT_S)
    except (OSError, subprocess.TimeoutExpired):
        return ''
    return done.stdout.strip()


def processor() -> str:
    """Return what the processor calls itself, empty where the system does not say."""
    try:
        lines = Path('/proc/cpuinfo').read_text(encoding='utf-8', errors='replace').splitlines()
    except OSError:
        return platform.processor()
    names = (line.partition(':')[2].strip() for line in lines if line.startswith('model name'))
    return next(names, platform.processor())


def _installed(name: str) -> str:
    """Return the version of an installed distribution, empty without one."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return ''
