# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cost of a plan and the closed loop in plain numpy, from the formulas of the paper."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.lgvi import legendre, lgvi_step, step_rotation
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution


def advance(config: AttitudeMpcConfig, R: Array, omega: Array, tau: Array
            ) -> tuple[Array, Array]:
    """Return the next attitude and rate of the predictor's model."""
    return lgvi_step(R, omega, tau, inertia_kg_m2=config.inertia_kg_m2, step_s=config.step_s,
                     forcing='paper' if config.forcing == 'paper' else 'symmetric')


def roll_out(config: AttitudeMpcConfig, R: Array, omega: Array, torques: Array
             ) -> tuple[Array, Array]:
    """Return attitudes (N + 1, 3, 3) and rates (N + 1, 3) under torques (N, 3)."""
    attitudes, rates = [R], [omega]
    for tau in torques:
        R, omega = advance(config, R, omega, tau)
        attitudes.append(R)
        rates.append(omega)
    return np.array(attitudes), np.array(rates)


def trace_cost(weight: Array, rotation: Array) -> Array:
    """Return ``tr(Q (I - R))`` (...) of rotations (..., 3, 3)."""
    return np.trace(weight @ (np.eye(3) - rotation), axis1=-2, axis2=-1)


def stage_cost(config: AttitudeMpcConfig, g: Array, omega: Array, tau: Array) -> Array:
    """Return ``tr(Qg (I - g)) + tr(Qf (I - f)) / h^2 + tr(u^T R u) / 2`` (...), u = tau^x."""
    h, u = config.step_s, so3.hat(tau)
    f = step_rotation(omega, config.inertia_kg_m2, h)
    squared = np.swapaxes(u, -1, -2) @ config.torque_weight @ u
    return (trace_cost(config.attitude_weight, g) + trace_cost(config.rate_weight, f) / h**2
            + np.trace(squared, axis1=-2, axis2=-1) / 2)


def chart(config: AttitudeMpcConfig, g: Array, omega: Array) -> Array:
    """Return ``xi = (Log g, Log f / h)`` (..., 6)."""
    f = step_rotation(omega, config.inertia_kg_m2, config.step_s)
    return np.concatenate([so3.log(g), so3.log(f) / config.step_s], axis=-1)


def chart_state(config: AttitudeMpcConfig, xi: Array) -> tuple[Array, Array]:
    """Return the attitudes (..., 3, 3) and rates (..., 3) of chart coordinates xi (..., 6)."""
    h, J = config.step_s, config.inertia_kg_m2
    c = so3.cayley_inverse(so3.exp(h * xi[..., 3:]))
    momentum = legendre(c, J) / h
    return so3.exp(xi[..., :3]), np.linalg.solve(J, momentum[..., None])[..., 0]


def plan_cost(config: AttitudeMpcConfig, P: Array, g: Array, omega: Array, torques: Array
              ) -> float:
    """Return the cost of errors g (N + 1, 3, 3), rates (N + 1, 3) and torques (N, 3)."""
    stages = stage_cost(config, g[:-1], omega[:-1], torques)
    xi = chart(config, g[-1], omega[-1])
    return float(stages.sum() + xi @ P @ xi / 2)


class Tick(NamedTuple):
    """One tick of a closed loop: the state, the answer to it, and the stage cost paid."""

    R: Array
    omega: Array
    plan: AttitudeMpcSolution
    stage_cost: float


def closed_loop(mpc: AttitudeMpc, R: Array, omega: Array, ticks: int) -> list[Tick]:
    """Run a controller on its own model from a cold start."""
    mpc.reset()
    log = []
    for _ in range(ticks):
        plan = mpc.solve(R, omega)
        paid = float(stage_cost(mpc.config, R, omega, plan.torque_B_n_m))
        log.append(Tick(R, omega, plan, paid))
        R, omega = advance(mpc.config, R, omega, plan.torque_B_n_m)
    return log
