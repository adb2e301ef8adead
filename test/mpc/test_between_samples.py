# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rate limits hold between samples where it is asked for: the margin, and closed loops with it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from strategies import generator, random_inertias

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

# Of a step; a body in continuous time to within 1/400 of the error of the model's step.
PARTS = 20
# A rod: gyroscopic torque turns the rate across it by much in a step.
ROD: dict[str, Any] = {
    'inertia_kg_m2': np.diag([0.0067, 0.0419, 0.0419]), 'step_s': 0.9, 'horizon': 60,
    'attitude_weight': np.eye(3), 'rate_weight': 0.25 * np.eye(3),
    'torque_weight': 300 * np.eye(3), 'max_torque_n_m': 1e-3, 'max_rate_rad_s': 0.1}


def largest_used(config: AttitudeMpcConfig, omega: Array) -> Array:
    """Return the largest part of a rate limit that rates (n, 3) use, (n,)."""
    return np.max([part for limit in config.rate_limits
                   for part in limit.used(omega).values()], axis=0)


def path(config: AttitudeMpcConfig, R: Array, omega: Array, torque: Array
         ) -> tuple[Array, Array]:
    """Return the attitudes (n, 3, 3) after a step and the rates (PARTS, n, 3) in it."""
    rates, J = [], np.broadcast_to(config.inertia_kg_m2, R.shape)
    for _ in range(PARTS):
        R, omega = lgvi_step(R, omega, torque, inertia_kg_m2=J, step_s=config.step_s / PARTS)
        rates.append(omega)
    return R, np.array(rates)


def flown(config: AttitudeMpcConfig, law: AttitudeMpcConfig, rng: np.random.Generator, n: int
          ) -> float:
    """Return the most of a limit that n bodies use in two steps whose nodes keep those of a law.

    They begin on a limit, and many torques are at theirs.
    """
    omega, torque, most = rng.normal(size=(n, 3)), config.max_torque_n_m, 0.0
    assert torque is not None
    omega /= largest_used(law, omega)[:, None]
    for _ in range(2):
        R = np.broadcast_to(np.eye(3), (len(omega), 3, 3))
        tau = torque * np.clip(rng.uniform(-1.5, 1.5, (len(omega), 3)), -1.0, 1.0)
        node = lgvi_step(R, omega, tau, step_s=config.step_s,
                         inertia_kg_m2=np.broadcast_to(config.inertia_kg_m2, R.shape))[1]
        keeps = largest_used(law, node) <= 1.0
        _, rates = path(config, R[keeps], omega[keeps], tau[keeps])
        omega, most = rates[-1], max(most, *(
            float(largest_used(config, each).max()) for each in rates))
    return most


@pytest.mark.parametrize('limit', ['box', 'ellipsoid'])
def test_nodes_within_the_margins_keep_a_body_within_the_limits(limit: str) -> None:
    """And within the limits alone they do not; rates that three steps of torque reach."""
    rng, within, without = generator('between samples', limit), [], []
    for J in random_inertias(rng, 10):
        least, greatest = np.linalg.eigvalsh(J)[[0, -1]]
        h, rate = 0.4, 0.8 * least / (0.4 * greatest)
        widths, turned = rate * rng.uniform(0.2, 0.6, 3), so3.random_rotations(rng, 1)[0]
        limits = {'max_rate_rad_s': widths} if limit == 'box' else {
            'rate_ellipsoid_s2': turned @ np.diag(widths ** -2) @ turned.T}
        config = AttitudeMpcConfig(
            inertia_kg_m2=J, step_s=h, horizon=10, attitude_weight=np.eye(3),
            rate_weight=np.eye(3), torque_weight=np.eye(3),
            max_torque_n_m=least * rate / (6 * h), **limits)
        within.append(flown(config, config.within_rate_margins, rng, 2000))
        without.append(flown(config, config, rng, 2000))
    assert max(within) <= 1.0
    assert max(without) > 1.0


def test_closed_loops_keep_rate_limits_between_samples() -> None:
    """Without being asked to they do not; the limits of the two laws are the same."""
    largest = {}
    for keep in (True, False):
        mpc, peak = AttitudeMpc(AttitudeMpcConfig(**ROD, keep_rate_between_samples=keep)), 0.0
        R, omega = so3.exp(np.array([1.0, 1.6, -0.9])), np.zeros(3)
        for _ in range(40):
            solution = mpc.solve(R, omega)
            R, rates = path(mpc.config, R, omega, solution.torque_B_n_m)
            omega, peak = rates[-1], max(peak, float(largest_used(mpc.config, rates).max()))
        largest[keep] = peak
    assert largest[True] <= 1.0 < largest[False]


@pytest.mark.parametrize('changes', [
    {'forcing': 'paper'}, {'max_torque_n_m': None}, {'max_rate_rad_s': (0.1, np.inf, 0.1)},
    {'wheels': WheelArray(np.eye(3), 1e-3, 0.01)}])
def test_what_is_not_proved_between_samples_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(ConfigurationError, match='no paper forcing, wheels'):
        AttitudeMpcConfig(**{**ROD, 'keep_rate_between_samples': True, **changes})
