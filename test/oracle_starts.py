# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starting trajectories of the oracle: both ways round, octants of torque, random torques."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.errors import StepExistenceError
from manifold_mpc_ros.lab.benchmark.peers.oracle import Optimum, Oracle, Steps, steps_of
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

OCTANTS = np.array(list(itertools.product((1.0, -1.0), repeat=3)))
NOTHING = Optimum(np.inf, np.zeros((0, 3)))
# The starting law follows a rate of this part of the error per step, with this part of the rate
# error per step; it stays below this part of the existence guard.
_BANDWIDTH, _DAMPING, _GUARD = 0.3, 0.6, 0.6
# Torques where there is no limit, as a part of the smallest inertia over h^2.
_FREE_TORQUE = 0.35


def follow(config: AttitudeMpcConfig, R: Array, omega: Array, first: Array, *,
           long_way: bool = False) -> Steps | None:
    """Roll out given torques (n, 3), then a saturated PD law; None where no step exists.

    ``long_way`` turns through more than 180 degrees for as long as the way has not wrapped.
    """
    h, J = config.step_s, config.inertia_kg_m2
    attitudes, rates, wound = [R], [omega], long_way
    limit, moments = torque_scale(config), np.linalg.eigvalsh(J)
    cap = _GUARD * moments[0] / (h * moments[-1])
    try:
        for k in range(config.horizon):
            error = so3.log(attitudes[-1])
            length = float(np.linalg.norm(error))
            if wound and length > 0:
                error = error * (1 - 2 * np.pi / length)
            wanted = -_BANDWIDTH / h * error
            wanted *= min(1.0, cap / max(float(np.linalg.norm(wanted)), 1e-12))
            torque = first[k] if k < len(first) else J @ (wanted - rates[-1]) * _DAMPING / h
            R, omega = lgvi_step(
                attitudes[-1], rates[-1], np.clip(torque, -limit, limit), inertia_kg_m2=J,
                step_s=h, forcing='paper' if config.forcing == 'paper' else 'symmetric')
            # Past 180 degrees the short way continues in the direction of the turn.
            wound = wound and float(so3.log(R) @ so3.log(attitudes[-1])) > 0
            attitudes.append(R)
            rates.append(omega)
        return steps_of(np.array(attitudes), np.array(rates), config)
    except StepExistenceError:
        return None


def torque_scale(config: AttitudeMpcConfig) -> Array:
    """Return the torque limits (3,), a fair stand-in on axes that have none."""
    free = _FREE_TORQUE * np.linalg.eigvalsh(config.inertia_kg_m2)[0] / config.step_s**2
    limit = np.full(3, np.inf) if config.max_torque_n_m is None else config.max_torque_n_m
    return np.where(np.isfinite(limit), limit, free)


def starts(config: AttitudeMpcConfig, R: Array, omega: Array, rng: np.random.Generator, *,
           octants: int, randoms: int) -> Iterator[Steps]:
    """Yield both ways round, octants of the first torques (0 to 8), and random torques.

    Fewer than eight octants are drawn at random; none of those drawn is opposite to another
    while there are at most four.
    """
    limit, N = torque_scale(config), config.horizon
    nothing = np.zeros((0, 3))
    plans = [(nothing, False), (nothing, True)]
    half = rng.permutation(OCTANTS[:4]) * rng.choice([-1.0, 1.0], size=(4, 1))
    chosen = np.concatenate([half, -half])[:octants]
    plans += [(np.tile(sign * limit, (3, 1)), False) for sign in chosen]
    for _ in range(randoms):
        held = int(rng.integers(1, N + 1))
        smooth = np.repeat(rng.uniform(-1, 1, size=(-(-held // 3), 3)), 3, axis=0)[:held]
        plans.append((smooth * limit, bool(rng.integers(2))))
    for torques, long_way in plans:
        for scale in (1.0, 0.5, 0.25, 0.125):
            steps = follow(config, R, omega, scale * torques, long_way=long_way)
            if steps is not None:
                yield steps
                break


def best(oracle: Oracle, R: Array, omega: Array, rng: np.random.Generator, *, octants: int,
         randoms: int) -> Optimum:
    """Return the cheapest optimum over all starts."""
    found = [oracle.solve(R, omega, steps) for steps in
             starts(oracle.config, R, omega, rng, octants=octants, randoms=randoms)]
    return min(found, key=lambda optimum: optimum.cost, default=NOTHING)
