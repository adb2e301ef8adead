# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which enclosure proves which problem, and the exact text of a problem that a file can carry."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial
from typing import Any

import numpy as np

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.certification.double_integrator import double_integrator_problem
from manifold_mpc_ros.lab.certification.enclosure import ClosedLoop
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.design import TerminalDesign, design_terminal
from manifold_mpc_ros.terminal.problem_of import terminal_design

KINDS = ('attitude', 'pointing', 'double integrator')


# Limits that a certificate names where the configuration has them.
_WHERE_GIVEN = {'rate_ellipsoid_s2', 'max_rate_norm_rad_s', 'max_kinetic_energy_j', 'cones',
                'wheels', 'thrusters', 'horizon_s', 'keep_rate_between_samples'}


def describe(config: AttitudeMpcConfig) -> tuple[str, dict[str, Any]]:
    """Map a configuration to (kind, values), the values plain JSON that keeps every bit."""
    values = {entry.name: _plain(getattr(config, entry.name)) for entry in fields(config)}
    return config.target, {name: value for name, value in values.items()
                           if name not in _WHERE_GIVEN or value not in (None, [], 0.0, False)}


def configuration_of(values: Mapping[str, Any]) -> AttitudeMpcConfig:
    """Map the values of `describe` back; raises ConfigurationError when they are not valid."""
    known = {entry.name for entry in fields(AttitudeMpcConfig)}
    strange = sorted((set(values) ^ known) - (_WHERE_GIVEN - set(values)))
    if strange:
        raise ManifoldMpcError(f'the configuration has other keys than this version: {strange}')
    return AttitudeMpcConfig(**{name: _unplain(value) for name, value in values.items()})


def design_of(kind: str, values: Mapping[str, Any]) -> TerminalDesign:
    """Return the terminal design that the controller of a described problem uses."""
    if kind == 'double integrator':
        return design_terminal(double_integrator_problem(**values))
    return terminal_design(configuration_of(values))


def loop_maker(kind: str, values: Mapping[str, Any], gain: Array) -> Callable[[], ClosedLoop]:
    """Return what builds the enclosure of a described problem, for this or another process."""
    if kind not in KINDS:
        raise ManifoldMpcError(f'problem {kind!r} is not one of {", ".join(KINDS)}')
    return partial(_make_loop, kind, dict(values), np.asarray(gain, dtype=float))


def _make_loop(kind: str, values: Mapping[str, Any], gain: Array) -> ClosedLoop:
    """Build an enclosure; imports python-flint."""
    from manifold_mpc_ros.lab.certification.attitude_enclosure import AttitudeEnclosure
    from manifold_mpc_ros.lab.certification.double_integrator_enclosure import (
        DoubleIntegratorEnclosure,
    )
    from manifold_mpc_ros.lab.certification.pointing_enclosure import PointingEnclosure
    if kind == 'double integrator':
        rest = {name: value for name, value in values.items() if name != 'terminal_scale'}
        return DoubleIntegratorEnclosure(gain, **rest)
    config = configuration_of(values)
    if config.target != kind:
        raise ManifoldMpcError(f'the configuration is for {config.target}, not for {kind}')
    return (PointingEnclosure if kind == 'pointing' else AttitudeEnclosure)(config, gain)


def _plain(value: Any) -> Any:
    """Return a value as JSON holds it: arrays as lists, infinity as text."""
    if isinstance(value, np.ndarray):
        return [_plain(entry) for entry in value.tolist()]
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if isinstance(value, (Cone, WheelArray)):
        return {entry.name: _plain(getattr(value, entry.name)) for entry in fields(value)}
    return 'inf' if isinstance(value, float) and value == float('inf') else value


def _unplain(value: Any) -> Any:
    """Return the value of `_plain`'s."""
    if isinstance(value, list):
        return [_unplain(entry) for entry in value]
    if isinstance(value, dict):
        return (WheelArray if 'null_space' in value else Cone)(**value)
    return float('inf') if value == 'inf' else value
