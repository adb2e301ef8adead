# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bodies from a PocketQube to a space station, and controllers and turns drawn for them."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / 'test'))

from strategies import generator

from manifold_mpc_ros import AttitudeMpc, AttitudeMpcConfig
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array


class Body(NamedTuple):
    """Inertia [kg m^2], largest torque [N m] and rate [rad/s] on every axis."""

    inertia: Array
    torque: float
    rate: Array


def _turned(moments: list[float], key: str) -> Array:
    """Return an inertia with these principal moments about random axes."""
    R = so3.random_rotations(generator(key), 1)[0]
    return np.asarray(R @ np.diag(moments) @ R.T)


def _body(inertia: Any, torque: float, rate: Any) -> Body:
    inertia = np.asarray(inertia, dtype=float)
    return Body(np.diag(inertia) if inertia.ndim == 1 else inertia, torque,
                np.broadcast_to(np.asarray(rate, dtype=float), 3).copy())


BODIES = {
    'pocketqube': _body([1.1e-4, 1.0e-4, 0.9e-4], 1e-6, 0.1),
    '1u': _body([2.2e-3, 2.0e-3, 2.1e-3], 2e-5, 0.1),
    'bar': _body([0.0067, 0.0419, 0.0419], 1e-3, 0.1),
    '3u': _body([0.035, 0.035, 0.007], 1e-4, 0.05),
    '6u': _body([0.13, 0.10, 0.05], 1e-3, 0.1),
    'wheeled': _body([0.167174901, 0.125963211, 0.0612346508], 7e-4, 0.012),
    'shipped': _body([1.0, 0.9, 0.6], 0.3, 0.6),
    'table': _body([0.9, 0.8, 1.5], 0.5, 1.0),
    'off_diagonal': _body([[15, 1.2, -0.5], [1.2, 12, 0.8], [-0.5, 0.8, 9]], 0.02, 0.02),
    'plate': _body([10.0, 6.0, 4.1], 0.05, 0.03),
    'rod': _body(_turned([100.0, 100.0, 10.0], 'rod'), 0.2, 0.02),
    'geo': _body(_turned([9000.0, 4000.0, 8500.0], 'geo'), 0.5, np.radians(0.3)),
    'telescope': _body([31046.0, 77217.0, 78754.0], 1.2, np.radians([0.5, 0.2, 0.2])),
    'station': _body([[1.28e8, -5e6, 6e6], [-5e6, 1.07e8, 3e6], [6e6, 3e6, 2.01e8]], 150.0,
                     np.radians(0.1)),
}
HORIZONS = (10, 14, 20, 28, 40, 80, 160, 330)
LONGER = 1.5
# Turns that every controller flies.
TURNS = 4


def half_turn_s(body: Body) -> float:
    """Return the time of a bang-bang half turn about the slowest body axis."""
    times = []
    for axis in range(3):
        inertia = float(np.abs(body.inertia[axis]).max())
        time_s, cap = 2 * np.sqrt(np.pi * inertia / body.torque), float(body.rate[axis])
        if time_s / 2 * body.torque / inertia > cap:
            time_s = np.pi / cap + cap * inertia / body.torque
        times.append(time_s)
    return max(times)


def configuration(body: Body, step_s: float, horizon: int, accuracy_rad: float, damping: float
                  ) -> AttitudeMpcConfig:
    """Return a controller for which full torque costs what this error does."""
    return AttitudeMpcConfig(
        inertia_kg_m2=body.inertia, step_s=step_s, horizon=horizon, attitude_weight=np.eye(3),
        rate_weight=damping * accuracy_rad * np.trace(body.inertia) / 3 / body.torque * np.eye(3),
        torque_weight=(accuracy_rad / body.torque) ** 2 * np.eye(3),
        max_torque_n_m=body.torque, max_rate_rad_s=body.rate)


def draw(number: int) -> dict[str, Any]:
    """Return body, weights, time and steps of the horizon, and turn of an instance.

    The turn is drawn by the number, all else by the number of its `TURNS` turns.
    """
    rng = generator('bodies', number // TURNS)
    controller = {
        'body': str(rng.choice(list(BODIES))), 'horizon': int(rng.choice(HORIZONS)),
        'times_half_turn': float(rng.choice([1.1, 1.5, 2.5])),
        'accuracy_deg': float(rng.choice([0.5, 1.0, 5.0, 25.0])),
        'damping': float(rng.choice([0.3, 1.0, 3.0]))}
    rng = generator('turns', number)
    axis = (np.eye(3)[rng.integers(3)] if rng.random() < 0.4
            else so3.random_rotations(rng, 1)[0][0])
    angle = [180.0, 179.7, rng.uniform(140, 180), rng.uniform(20, 180)][rng.integers(4)]
    return {**controller, 'axis': axis.tolist(), 'angle_deg': float(angle)}


def controllers(number: int) -> Iterator[tuple[dict[str, Any], AttitudeMpc, Array]]:
    """Yield both horizons of an instance with its controller and rotation vector.

    None where its body refuses the step.
    """
    instance = draw(number)
    body = BODIES[instance['body']]
    step_s = half_turn_s(body) * instance['times_half_turn'] / instance['horizon']
    vector = np.radians(instance['angle_deg']) * np.array(instance['axis'])
    for horizon in (instance['horizon'], round(LONGER * instance['horizon'])):
        try:
            mpc = AttitudeMpc(configuration(
                body, step_s, horizon, np.radians(instance['accuracy_deg']),
                instance['damping']))
        except ManifoldMpcError:
            return
        yield {'number': number, **instance, 'horizon': horizon}, mpc, vector
