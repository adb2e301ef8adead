# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What follows from the states of a run: error by axis, momentum, energy, a bang-bang slew."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lab.recording.bags.run import BagRun
from manifold_mpc_ros.lab.tune.rule import bang_bang_time_s
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

#: A turn below this is none, so there is no bang-bang slew to compare with [rad].
LEAST_TURN_RAD = 1e-6


class Margin(NamedTuple):
    """A quantity beside what limits it: name, limit and measured as text, part that is left."""

    name: str
    limit: str
    measured: str
    left: float


def error_vectors_deg(run: BagRun) -> Array:
    """Return ``Log(R_ND^T R_NB)`` (n, 3) [deg]."""
    turned = np.swapaxes(np.broadcast_to(run.R_ND, run.states.R_NB.shape), 1, 2) @ run.states.R_NB
    return np.degrees(so3.log(turned))


def quaternions_wxyz(run: BagRun) -> Array:
    """Return the attitudes (n, 4), each with the sign that is nearer to the one before."""
    q = so3.quaternion_from_rotation(run.states.R_NB)
    q[1:] *= np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))[:, None]
    return np.asarray(q)


def momentum_N(run: BagRun, config: AttitudeMpcConfig) -> Array:
    """Return ``R_NB J omega`` (n, 3) of the body with the model's inertia [N m s]."""
    momentum = run.states.omega_BN_B @ config.inertia_kg_m2
    return (run.states.R_NB @ momentum[..., None])[..., 0]


def energy_j(run: BagRun, config: AttitudeMpcConfig) -> Array:
    """Return ``omega^T J omega / 2`` (n,) with the model's inertia [J]."""
    omega = run.states.omega_BN_B
    return np.asarray(np.sum(omega @ config.inertia_kg_m2 * omega, axis=1) / 2.0)


def bang_bang(run: BagRun, config: AttitudeMpcConfig) -> tuple[Array, Array] | None:
    """Return times [s] and angles [deg] of a bang-bang slew from the first attitude, at rest.

    About the axis of the turn: full torque, coasting at the rate limit, full braking. None
    without torque limits, for pointing, and where nothing is to be turned.
    """
    vector = np.radians(error_vectors_deg(run)[0])
    angle = float(np.linalg.norm(vector))
    if config.max_torque_n_m is None or config.target == 'pointing' or angle < LEAST_TURN_RAD:
        return None
    axis = vector / angle
    total_s = bang_bang_time_s(config, axis, angle)
    if not np.isfinite(total_s):
        return None
    # Of a trapezoid of rates: T = angle / w + w / a, or the triangle where w is not reached.
    a = 1.0 / float(np.max(np.abs(config.inertia_kg_m2 @ axis) / config.max_torque_n_m))
    ramp_s = total_s / 2.0 - np.sqrt(max(0.0, (total_s / 2.0) ** 2 - angle / a))
    time_s = np.linspace(0.0, total_s, 100)
    rising = np.minimum(time_s, ramp_s) ** 2 / 2.0
    coasting = ramp_s * np.clip(time_s - ramp_s, 0.0, total_s - 2.0 * ramp_s)
    left = np.clip(time_s - (total_s - ramp_s), 0.0, ramp_s)
    turned = a * (rising + coasting + ramp_s * left - left ** 2 / 2.0)
    return time_s, np.degrees(np.maximum(angle - turned, 0.0))


def margins(run: BagRun) -> Iterator[Margin]:
    """Yield peak torque and peak rate beside the controller's limits, and the final rate."""
    if run.scenario is None or not len(run.states):
        return
    config, accepted = run.scenario.controller_config.mpc, run.scenario.acceptance
    for name, values, limit, unit in (
            ('peak torque', run.commands.torque_B_n_m, config.max_torque_n_m, 'N m'),
            ('peak rate', run.states.omega_BN_B, config.max_rate_rad_s, 'rad/s')):
        if limit is not None and len(values):
            peak = np.abs(values).max(axis=0)
            yield Margin(name, _said(limit, unit), _said(peak, unit),
                         float(1.0 - np.max(peak / limit)))
    final, rest = float(run.rate_error_rad_s[-1]), accepted.rate_tolerance_rad_s
    yield Margin('final rate', f'{rest:.3g} rad/s', f'{final:.3g} rad/s', 1.0 - final / rest)


def _said(values: Array, unit: str) -> str:
    """Return three numbers with their unit."""
    return ', '.join(f'{value:.3g}' for value in values) + f' {unit}'
