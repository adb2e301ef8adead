# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Typed errors of the package: mistakes raise these, events at run time are status values."""

from __future__ import annotations


class ManifoldMpcError(Exception):
    """Base of every error that the package raises on purpose."""


class ConfigurationError(ManifoldMpcError, ValueError):
    """One configuration value that cannot be used.

    The message names the offending key, its value, and what would be valid.
    """

    def __init__(self, key: str, value: object, valid: str) -> None:
        """Store the three facts and build the message from them."""
        self.key = key
        self.value = value
        self.valid = valid
        super().__init__(f'{key}: {_short(value)} is not valid; expected {valid}')


class StepExistenceError(ManifoldMpcError, ArithmeticError):
    """The implicit LGVI step is not guaranteed to have a solution.

    Raised when ``|h Pi + h^2/2 tau|`` reaches the smallest principal inertia.
    """


class DesignError(ManifoldMpcError):
    """The terminal design does not exist for this configuration; the message says why."""


class SolverBuildError(ManifoldMpcError):
    """The solver could not be generated, compiled or loaded."""


class CacheError(SolverBuildError):
    """No folder can be written to that a later start would find again."""


class BagError(ManifoldMpcError):
    """A bag that cannot be written or read; the message names the file and says why."""


#: How to get what flies needs, by the name of the import.
_INSTALL = {
    'casadi': 'pip install casadi (neither ROS nor Debian has a package of it)',
    'numpy': 'python3-numpy', 'scipy': 'python3-scipy', 'yaml': 'python3-yaml',
    'rclpy': "source ROS 2, or pip install 'manifold_mpc_ros[ros]'"}


def missing_package(error: ImportError) -> str:
    """Say in one line what is not installed; empty for an import that fails for another reason."""
    package = (error.name or '').partition('.')[0]
    return f'{package} is not installed: {_INSTALL[package]}' if package in _INSTALL else ''


def _short(value: object) -> str:
    """Return ``repr(value)`` on one line, cut at 120 characters."""
    text = ' '.join(repr(value).split())
    return text if len(text) <= 120 else text[:117] + '...'
