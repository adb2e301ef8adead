# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The optimal control problem that is compared, as our configuration and in quaternion form.

Ours is the LGVI on SO(3). The peers get what their users would write: a unit quaternion and a
body rate as state (7,), one Runge-Kutta step of order 4 per interval, and the stage cost

    4 |v|^2 + omega^T J omega / 2 + 2 |tau|^2,

v the vector part: ``tr(I - R) = 4 |v|^2`` exactly, and ``tr(J_d (I - f)) / h^2`` tends to
``omega^T J omega / 2`` as h goes to 0. The terminal cost is ``xi^T P xi / 2`` with our P and
``xi = (2 atan2(|v|, |w|) v / |v|, omega)``. Same limits, no terminal set.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lab.reference.stage_cost import stage_costs
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.problem_of import terminal_design

INERTIA_KG_M2 = np.diag([1.0, 0.9, 0.6])
STEP_S = 0.5
MAX_TORQUE_N_M = 0.3
MAX_RATE_RAD_S = 0.6
STATE, TORQUE = 7, 3
#: Weights of the residuals (v, omega, tau), the cost being half of the weighted squares.
RESIDUAL_WEIGHTS = np.array([8.0, 8.0, 8.0, *np.diag(INERTIA_KG_M2), 4.0, 4.0, 4.0])


def comparison_config(horizon: int) -> AttitudeMpcConfig:
    """Return the problem for our solver: the forcing of a physical plant, no terminal set."""
    J = INERTIA_KG_M2
    return AttitudeMpcConfig(
        inertia_kg_m2=J, step_s=STEP_S, horizon=horizon, attitude_weight=np.eye(3),
        rate_weight=np.trace(J) / 2 * np.eye(3) - J, torque_weight=2 * np.eye(3),
        terminal_scale=0.1, max_torque_n_m=np.full(3, MAX_TORQUE_N_M),
        max_rate_rad_s=np.full(3, MAX_RATE_RAD_S), forcing='symmetric', terminal_constraint=False)


@dataclass(frozen=True)
class Model:
    """The quaternion form as CasADi functions, and P (6, 6).

    ``step``: (x, tau) to the next x. ``stage``: (x, tau) to the residuals (9,). ``end``: x to xi.
    """

    step: ca.Function
    stage: ca.Function
    end: ca.Function
    terminal_weight: Array

    def cost(self, states: Array, torques: Array) -> float:
        """Return the cost of states (N + 1, 7) under torques (N, 3)."""
        residuals = np.hstack([states[:-1, 1:7], torques])
        xi = np.array(self.end(states[-1])).ravel()
        return float(np.sum(RESIDUAL_WEIGHTS * residuals ** 2) / 2
                     + xi @ self.terminal_weight @ xi / 2)

    def roll_out(self, state: Array, torques: Array) -> Array:
        """Return the states (N + 1, 7) that torques (N, 3) lead to."""
        states = [np.asarray(state, dtype=float)]
        for torque in torques:
            states.append(np.array(self.step(states[-1], torque)).ravel())
        return np.array(states)


def rate_of_change(x: ca.SX, tau: ca.SX) -> ca.SX:
    """Return ``(q (0, omega) / 2, J^-1 (tau - omega x J omega))``."""
    w, v, omega = x[0], x[1:4], x[4:7]
    J = ca.DM(INERTIA_KG_M2)
    turning = ca.vertcat(-ca.dot(v, omega), w * omega + ca.cross(v, omega)) / 2
    torque = tau - ca.cross(omega, J @ omega)
    return ca.vertcat(turning, ca.DM(np.linalg.inv(INERTIA_KG_M2)) @ torque)


def runge_kutta(x: ca.SX, tau: ca.SX) -> ca.SX:
    """Return the state after one step of order 4 under constant torque."""
    h = STEP_S
    k1 = rate_of_change(x, tau)
    k2 = rate_of_change(x + h / 2 * k1, tau)
    k3 = rate_of_change(x + h / 2 * k2, tau)
    k4 = rate_of_change(x + h * k3, tau)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def terminal_coordinates(x: ca.SX) -> ca.SX:
    """Return xi (6,); the length of its first half is pi at 180 degrees."""
    length = ca.sqrt(ca.dot(x[1:4], x[1:4]) + 1e-24)
    sign = ca.if_else(x[0] >= 0, 2, -2)
    return ca.vertcat(sign * ca.atan2(length, ca.fabs(x[0])) / length * x[1:4], x[4:7])


def quaternion_model() -> Model:
    """Build the quaternion form."""
    x, tau = ca.SX.sym('x', STATE), ca.SX.sym('tau', TORQUE)
    return Model(
        ca.Function('rk4_step', [x, tau], [runge_kutta(x, tau)]),
        ca.Function('stage_residuals', [x, tau], [ca.vertcat(x[1:7], tau)]),
        ca.Function('terminal_residuals', [x], [terminal_coordinates(x)]),
        terminal_weight())


def terminal_weight() -> Array:
    """Return P (6, 6) of our terminal design; it does not depend on the horizon."""
    return terminal_design(comparison_config(1)).P


def slew(model: Model, state: Array, horizon: int) -> tuple[Array, Array]:
    """Return states (N + 1, 7) and torques (N, 3) of a saturated slew the short way round.

    The starting guess of every peer: it follows the dynamics and keeps the limits. The rate
    aims along the eigenaxis, as fast as it can still be stopped and the rate limit allows.
    """
    x, states, torques = np.asarray(state, dtype=float), [], []
    diagonal = np.diag(INERTIA_KG_M2)
    states.append(x)
    for _ in range(horizon):
        error = np.array(model.end(x)).ravel()[:3]
        angle = float(np.linalg.norm(error)) + 1e-12
        axis = error / angle
        stopping = MAX_TORQUE_N_M / np.linalg.norm(diagonal * axis)
        fastest = min(0.85 * MAX_RATE_RAD_S / np.abs(axis).max(),
                      float(np.sqrt(1.2 * stopping * angle)), 0.5 * angle)
        wanted = 0.8 * diagonal * (-fastest * axis - x[4:7]) / STEP_S
        torques.append(np.clip(wanted, -0.9 * MAX_TORQUE_N_M, 0.9 * MAX_TORQUE_N_M))
        x = np.array(model.step(x, torques[-1])).ravel()
        states.append(x)
    return np.array(states), np.array(torques)


def cost_on_the_group(config: AttitudeMpcConfig, P: Array, state: Array, torques: Array) -> float:
    """Return the cost that torques (N, 3) have on our model, the LGVI, from a state (7,).

    The one yardstick for the torques of solvers with different models; a limit that is kept in
    one model can be exceeded in the other by their difference.
    """
    R, omega = so3.rotation_from_quaternion(state[:4]), np.asarray(state[4:7], dtype=float)
    attitudes, rates = [R], [omega]
    for torque in torques:
        R, omega = lgvi_step(R, omega, torque, inertia_kg_m2=config.inertia_kg_m2,
                             step_s=config.step_s)
        attitudes.append(R)
        rates.append(omega)
    stages = stage_costs(config, np.array(attitudes[:-1]), np.array(rates[:-1]), torques)
    return float(stages.sum()) + _terminal_cost(config, P, R, omega)


def _terminal_cost(config: AttitudeMpcConfig, P: Array, R: Array, omega: Array) -> float:
    """Return ``xi^T P xi / 2`` with ``xi = (Log g, Log f / h)``, f the step of the rate."""
    f = lgvi_step(np.eye(3), omega, np.zeros(3), inertia_kg_m2=config.inertia_kg_m2,
                  step_s=config.step_s)[0]
    xi = np.concatenate([so3.log(R), so3.log(f) / config.step_s])
    return float(xi @ P @ xi) / 2
