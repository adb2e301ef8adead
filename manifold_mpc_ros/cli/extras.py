# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Packages that ``pip install manifold_mpc_ros`` leaves out, and the extras that bring them."""

from __future__ import annotations

from importlib.util import find_spec

from manifold_mpc_ros.errors import ManifoldMpcError

#: Name of the import, and the extra of setup.py.
EXTRAS = {
    'flint': 'lab', 'matplotlib': 'lab', 'plotly': 'lab', 'rich': 'lab', 'rosbags': 'lab',
    'pyarrow': 'campaign', 'distributed': 'cluster', 'rclpy': 'ros',
}


def require(what: str, *packages: str) -> None:
    """Raise ManifoldMpcError for the first package that ``what`` needs and that is missing."""
    for package in packages:
        if not _is_installed(package):
            extra = EXTRAS[package]
            source = ', or source a ROS 2 installation' if extra == 'ros' else ''
            raise ManifoldMpcError(
                f'{what} needs {package}, which is not installed: '
                f"pip install 'manifold_mpc_ros[{extra}]'{source}")


def _is_installed(package: str) -> bool:
    """Say whether a package can be found, without importing it."""
    try:
        return find_spec(package) is not None
    except (ImportError, ValueError):  # refused by a finder, or in sys.modules without a spec
        return False
