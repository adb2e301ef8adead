# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The same optimal control problem in another formulation, solved by IPOPT: the oracle.

Written from the paper and the design page and sharing nothing with the solver under test: the
unknowns are Cayley parameters of rotations over steps, the implicit equation of the LGVI gives
the torques explicitly, and the attitude is a product of quaternions. SI units throughout. With

    m+-(c) = 2 (J c +- c x J c) / (1 + |c|^2),     f = cay(c),

``f J_d - J_d f^T = m+(c)^x`` and ``f^T m+(c) = m-(c)``. Let d_k belong to the measured rate,
``m+(d_k) = h J omega_k``. Paper's forcing: g_{k+1} = g_k cay(d_k) and
``h^2 tau_k = m+(d_{k+1}) - m-(d_k)``. Symmetric forcing: g_{k+1} = g_k cay(c_k),
``h^2 tau_k / 2 = m+(c_k) - m+(d_k) = m+(d_{k+1}) - m-(c_k)``. |c| < 1 is the principal branch.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import casadi as ca
import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics import lgvi
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

# Largest |c|^2 of a step: 1 is 90 degrees, the end of the principal branch.
LARGEST_STEP = 0.999
IPOPT = {'print_level': 0, 'sb': 'yes', 'tol': 1e-9, 'max_iter': 300, 'bound_relax_factor': 0.0}
# From a plan that is optimal already: stay near it.
POLISH = {'mu_init': 1e-8, 'bound_push': 1e-9, 'bound_frac': 1e-9, 'slack_bound_push': 1e-9,
          'slack_bound_frac': 1e-9}


class Steps(NamedTuple):
    """Cayley parameters of a trajectory: of the rotations (N, 3) and of the rates (N + 1, 3)."""

    turns: Array
    rates: Array


class Optimum(NamedTuple):
    """What IPOPT found from one start; ``cost`` is inf when it found nothing."""

    cost: float
    torques: Array


def steps_of(R_NB: Array, omega_BN_B: Array, config: AttitudeMpcConfig) -> Steps:
    """Map attitudes (N + 1, 3, 3) and rates (N + 1, 3) to the oracle's unknowns."""
    turned = np.swapaxes(R_NB[:-1], 1, 2) @ R_NB[1:]
    momenta = config.step_s * omega_BN_B @ config.inertia_kg_m2
    return Steps(so3.cayley_inverse(turned), lgvi.cayley_step(momenta, config.inertia_kg_m2))


def momentum(c: ca.SX, J: ca.DM, sign: int) -> ca.SX:
    """Return m+(c), the h Pi before a step, or m-(c), the one after it in turned axes."""
    return 2 * (J @ c + sign * ca.cross(c, J @ c)) / (1 + ca.dot(c, c))


def turned(q: ca.SX, c: ca.SX) -> ca.SX:
    """Return the quaternion of ``R(q) cay(c)``."""
    w, v = q[0], q[1:4]
    product = ca.vertcat(w - ca.dot(v, c), v + w * c + ca.cross(v, c))
    return product / ca.sqrt(1 + ca.dot(c, c))


def trace_cost(weight: Array, q: ca.SX) -> ca.SX:
    """Return ``tr(Q (I - R(q)))`` through ``R(q) = I + 2 w v^x + 2 v^x v^x``, Q symmetric."""
    v = q[1:4]
    return 2 * ca.dot(v, ca.DM(np.trace(weight) * np.eye(3) - weight) @ v)


def log(q: ca.SX) -> ca.SX:
    """Return ``2 atan2(|v|, |w|) v/|v|``, of length pi at 180 degrees, towards identity."""
    length = ca.sqrt(ca.dot(q[1:4], q[1:4]) + 1e-24)
    return ca.if_else(q[0] >= 0, 2, -2) * ca.atan2(length, ca.fabs(q[0])) / length * q[1:4]


@dataclass
class _Problem:
    """Cost, unknowns and constraints of an NLP while it is being written down."""

    cost: ca.SX = field(default_factory=lambda: ca.SX(0))
    unknowns: list[ca.SX] = field(default_factory=list)
    constraints: list[ca.SX] = field(default_factory=list)
    low: list[Array] = field(default_factory=list)
    high: list[Array] = field(default_factory=list)

    def unknown(self, name: str) -> ca.SX:
        """Return a new step of the trajectory, on the principal branch."""
        self.unknowns.append(ca.SX.sym(name, 3))
        c = self.unknowns[-1]
        self.require(ca.dot(c, c), np.array([-np.inf]), np.array([LARGEST_STEP]))
        return c

    def require(self, value: ca.SX, low: Array, high: Array) -> None:
        """Add ``low <= value <= high``, without the rows that have no bound."""
        for i in np.flatnonzero(np.isfinite(low) | np.isfinite(high)):
            self.constraints.append(value[int(i)])
            self.low.append(low[i])
            self.high.append(high[i])


class Oracle:
    """IPOPT on one configuration; P (6, 6) and c are those of its terminal design."""

    def __init__(self, config: AttitudeMpcConfig, P: Array, c: float) -> None:
        """Write the problem down with the initial state as parameter."""
        self.config, self._P, self._c = config, P, c
        problem, state = _Problem(), ca.SX.sym('state', 7)
        torques = self._write(problem, state)
        nlp = {'x': ca.vertcat(*problem.unknowns), 'p': state, 'f': problem.cost,
               'g': ca.vertcat(*problem.constraints)}
        self._bounds = {'lbg': problem.low, 'ubg': problem.high}
        self._torques = ca.Function('torques', [nlp['x'], state], [ca.horzcat(*torques)])
        quiet = {'print_time': False, 'error_on_fail': False}
        self._cold = ca.nlpsol('cold', 'ipopt', nlp, {**quiet, 'ipopt': IPOPT})
        self._near = ca.nlpsol('near', 'ipopt', nlp, {**quiet, 'ipopt': {**IPOPT, **POLISH}})

    def solve(self, R_NB: Array, omega_BN_B: Array, start: Steps, *, polish: bool = False
              ) -> Optimum:
        """Return the local optimum that IPOPT reaches from a starting trajectory."""
        q0 = so3.quaternion_from_rotation(R_NB)
        before = self.config.step_s * self.config.inertia_kg_m2 @ omega_BN_B
        state = np.concatenate([q0, lgvi.cayley_step(before, self.config.inertia_kg_m2)])
        rows = [start.rates[1:]] if self.config.forcing == 'paper' else [
            start.turns, start.rates[1:]]
        guess = np.stack(rows, axis=1).ravel()
        solver = self._near if polish else self._cold
        result = solver(x0=guess, p=state, **self._bounds)
        torques = np.array(self._torques(result['x'], state)).T
        return Optimum(float(result['f']) if solver.stats()['success'] else np.inf, torques)

    def _write(self, problem: _Problem, state: ca.SX) -> list[ca.SX]:
        """Write all stages and the end; return the torques."""
        config, h = self.config, self.config.step_s
        q, rate, torques = state[0:4], state[4:7], []
        weight = ca.DM(np.trace(config.torque_weight) * np.eye(3) - config.torque_weight)
        for k in range(config.horizon):
            problem.cost += trace_cost(config.attitude_weight, q)
            problem.cost += trace_cost(config.rate_weight, quaternion(rate)) / h**2
            q, rate, torque = self._advance(problem, k, q, rate)
            problem.cost += ca.dot(torque, weight @ torque) / 2
            if config.max_torque_n_m is not None:
                problem.require(torque, -config.max_torque_n_m, config.max_torque_n_m)
            if config.max_rate_rad_s is not None:
                reached = momentum(rate, ca.DM(config.inertia_kg_m2), 1)
                omega = ca.DM(np.linalg.inv(config.inertia_kg_m2)) @ reached / h
                problem.require(omega, -config.max_rate_rad_s, config.max_rate_rad_s)
            torques.append(torque)
        xi = ca.vertcat(log(q), log(quaternion(rate)) / h)
        form = ca.dot(xi, ca.DM(self._P) @ xi)
        problem.cost += form / 2
        if config.terminal_constraint:
            problem.require(form, np.array([-np.inf]), np.array([self._c]))
        return torques

    def _advance(self, problem: _Problem, k: int, q: ca.SX, rate: ca.SX
                 ) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Return attitude, rate parameter and torque of the next step k + 1."""
        J, h = ca.DM(self.config.inertia_kg_m2), self.config.step_s
        if self.config.forcing == 'paper':
            after = problem.unknown(f'd{k + 1}')
            impulse = momentum(after, J, 1) - momentum(rate, J, -1)
            return turned(q, rate), after, impulse / h**2
        turn, after = problem.unknown(f'c{k}'), problem.unknown(f'd{k + 1}')
        half = momentum(turn, J, 1) - momentum(rate, J, 1)
        problem.require(momentum(turn, J, -1) + half - momentum(after, J, 1),
                        np.zeros(3), np.zeros(3))
        return turned(q, turn), after, 2 * half / h**2


def quaternion(c: ca.SX) -> ca.SX:
    """Return the unit quaternion of ``cay(c)``."""
    return ca.vertcat(1, c) / ca.sqrt(1 + ca.dot(c, c))
