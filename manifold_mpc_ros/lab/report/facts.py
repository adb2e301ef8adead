# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What ran, in a few lines: spacecraft, controller, software, and how the run was recorded."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.lab.recording.bags.run import BagRun
from manifold_mpc_ros.lie.arrays import Array


def facts(run: BagRun) -> Iterator[tuple[str, str]]:
    """Yield named facts about a run."""
    if run.scenario is not None:
        yield from _controller(run.scenario.controller_config.mpc)
        mode = run.scenario.time_mode
        factor = f', {run.scenario.clock_factor:g} times real time' if mode == 'clock' else ''
        yield 'time', f'{mode}{factor}'
    yield 'messages', (f'{len(run.states)} states, {len(run.commands)} torques, '
                       f'{len(run.setpoints)} setpoints'
                       + (f', {len(run.references)} references' if len(run.references) else ''))
    received = dt.datetime.fromtimestamp(
        int(run.states.received_ns[0]) / NANOSECONDS, tz=dt.timezone.utc)
    yield 'recorded', received.strftime('%Y-%m-%d %H:%M UTC')
    yield 'bag', f'{run.path} ({run.contents.storage})'
    versions = run.description.versions
    if versions:
        names = ('manifold_mpc_ros', 'revision', 'casadi', 'ros_distro', 'rmw')
        yield 'software', ', '.join(f'{name} {versions[name]}' for name in names
                                    if name in versions)
    if run.backend:
        yield 'solver', f'backend {run.backend}'
    for note in run.notes:
        yield 'note', note


def _controller(config: AttitudeMpcConfig) -> Iterator[tuple[str, str]]:
    """Yield what defines the control law."""
    inertia = config.inertia_kg_m2
    diagonal = bool((inertia == np.diag(np.diag(inertia))).all())
    yield 'inertia of the model', (_vector(np.diag(inertia)) if diagonal
                                   else '; '.join(_vector(row) for row in inertia)) + ' kg m²'
    yield 'limits', ', '.join((_limit(config.max_torque_n_m, 'N m'),
                               _limit(config.max_rate_rad_s, 'rad/s')))
    yield 'controller', (f'{config.target}, N = {config.horizon}, step {config.step_s:g} s, '
                         + (f'{config.horizon_s:g} s ahead, ' if config.horizon_s else '')
                         + ('with' if config.terminal_constraint else 'without')
                         + ' terminal set')


def _limit(limit: Array | None, unit: str) -> str:
    """Return a limit as text."""
    return f'no limit [{unit}]' if limit is None else f'{_vector(limit)} {unit}'


def _vector(values: Array) -> str:
    """Return numbers as text, one where they are equal."""
    distinct = values[:1] if (values == values[0]).all() else values
    return ', '.join(f'{value:g}' for value in distinct)
