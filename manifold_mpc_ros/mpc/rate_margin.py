# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""By how much the model has to stay within a rate limit so that a rigid body keeps it.

The model's step is of second order: from one node to the next a body in continuous time reaches
another rate than it says, and a larger one between. About targets that move for long at large
rates that would be seen; both fall with the cube of the step (docs/theory.md, section 16).
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.rate_limits import RateBox, RateLimit
from manifold_mpc_ros.dynamics.inertia import existence_guard
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lie.arrays import Array

#: A step is compared with so many parts of it.
_PARTS = 8
#: Steps that need more than this part of the existence guard are no plan's.
_INSIDE = 0.95

#: Margins of a limit by the name of its ratio, as a part of it.
Margins = dict[str, float]


def relative(limit: RateLimit, omega_BN_B: Array) -> dict[str, Array]:
    """Map rates (n, 3) [rad/s] to what they use of a limit, by name, as a part of it."""
    power = 1.0 if isinstance(limit, RateBox) else 0.5
    return {name: np.asarray(ratio) ** power for name, ratio in limit.ratios(omega_BN_B.T).items()}


def rate_margins(config: AttitudeMpcConfig) -> list[Margins]:
    """Return the margins of every rate limit, in their order.

    The largest over 15,625 steps, rates and torques each of none, half or all of the limits about
    each axis, of what the end of a step is off by and what the middle has more than both ends.
    Sampled, not proved.
    """
    torque, limits = config.max_torque_n_m, config.rate_limits
    if torque is None or not all(each.limits_every_axis for each in limits):
        return [{} for _ in limits]
    parts = np.array(list(itertools.product((-1.0, -0.5, 0.0, 0.5, 1.0), repeat=6)))
    return [_margins(config, limit, parts, np.where(np.isfinite(torque), torque, 0.0))
            for limit in limits]


def _margins(config: AttitudeMpcConfig, limit: RateLimit, parts: Array, torque: Array) -> Margins:
    """Return those of one limit."""
    J, h = config.inertia_kg_m2, config.step_s
    axes = np.array([limit.rate_about(axis) for axis in np.eye(3)])
    omega, tau = parts[:, :3] * axes, parts[:, 3:] * torque
    largest = np.max(list(relative(limit, omega).values()), axis=0)
    omega = omega / np.maximum(largest, 1e-9)[:, None]
    pushed = h * np.linalg.norm(omega @ J + h / 2.0 * tau, axis=1)
    inside = pushed < _INSIDE * existence_guard(J)
    omega, tau = omega[inside], tau[inside]
    many = np.broadcast_to(J, (len(omega), 3, 3))
    R = np.broadcast_to(np.eye(3), many.shape)
    begin = relative(limit, omega)
    model = relative(limit, lgvi_step(R, omega, tau, inertia_kg_m2=many, step_s=h)[1])
    path = [begin]
    for _ in range(_PARTS):
        R, omega = lgvi_step(R, omega, tau, inertia_kg_m2=many, step_s=h / _PARTS)
        path.append(relative(limit, omega))
    found = {}
    for name, end in path[-1].items():
        off = np.max(np.abs(end - model[name]), initial=0.0)
        between = np.max([each[name] for each in path], axis=0)
        found[name] = float(off + np.max(between - np.maximum(begin[name], end), initial=0.0))
    return found


def with_margins(config: AttitudeMpcConfig, margins: list[Margins]) -> AttitudeMpcConfig:
    """Return the configuration with its rate limits smaller by their margins."""
    box, shapes = config.max_rate_rad_s, []
    for limit, margin in zip(config.rate_limits, margins, strict=True):
        if isinstance(limit, RateBox):
            box = limit.max_rate_rad_s * (1.0 - np.array(
                [margin.get(f'rate {axis}', 0.0) for axis in 'xyz']))
        else:
            shapes.append(limit.E_s2 / (1.0 - margin.get(limit.name, 0.0)) ** 2)  # type: ignore[attr-defined]
    return replace(config, max_rate_rad_s=box,
                   rate_ellipsoid_s2=np.array(shapes) if shapes else None)
