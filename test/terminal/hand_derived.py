# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The terminal design of the attitude controller derived by hand, in plain numpy.

Chart ``xi = (Log g, Log f / h)`` in R^6. Nothing of the general layer is used, and nothing of
CasADi: formulas and dynamics are written out for SO(3). The search has the same seed and steps.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are
from scipy.optimize import minimize

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.lgvi import cayley_step, legendre, lgvi_step, step_rotation
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

DIRECTIONS, RADII, REFINED, SAFETY, INSIDE, SEED = 4000, 40, 6, 0.99, 0.999, 20180301


class HandDerived(NamedTuple):
    """What the general layer has to find."""

    A: Array
    B: Array
    Q: Array
    R: Array
    N: Array
    P: Array
    K: Array
    c: float
    limits: dict[str, float]


def linearisation(config: AttitudeMpcConfig) -> tuple[Array, Array]:
    """Return A (6, 6) and B (6, 3): ``B = [0; h J^-1]`` or ``[h^2/2 J^-1; h J^-1]``."""
    h, inverse = config.step_s, np.linalg.inv(config.inertia_kg_m2)
    eye, zero = np.eye(3), np.zeros((3, 3))
    top = h * h / 2 * inverse if config.forcing == 'symmetric' else zero
    return np.block([[eye, h * eye], [zero, eye]]), np.vstack([top, h * inverse])


def trace_hessian(weight: Array) -> Array:
    """Map Q (3, 3) to ``tr(Q) I - Q``, the Hessian of ``tr(Q (I - exp(hat x)))`` at zero."""
    return np.trace(weight) * np.eye(3) - weight


def stage_hessian(config: AttitudeMpcConfig) -> tuple[Array, Array]:
    """Return Q (6, 6) and R (3, 3), the Hessian of L' = L / lambda at the equilibrium (N = 0)."""
    zero = np.zeros((3, 3))
    state = np.block([[trace_hessian(config.attitude_weight), zero],
                      [zero, trace_hessian(config.rate_weight)]])
    return (state / config.terminal_scale,
            trace_hessian(config.torque_weight) / config.terminal_scale)


def hand_derived(config: AttitudeMpcConfig) -> HandDerived:
    """Map a configuration to its terminal design."""
    a, b = linearisation(config)
    q, r = stage_hessian(config)
    units = np.diag([1.0] * 3 + [1 / config.step_s] * 3)
    torque = np.trace(config.inertia_kg_m2) / 3 / config.step_s ** 2
    inverse = np.linalg.inv(units)
    p = inverse @ solve_discrete_are(inverse @ a @ units, inverse @ b * torque,
                                     units @ q @ units, r * torque ** 2) @ inverse
    p = (p + p.T) / 2
    k = -np.linalg.solve(b.T @ p @ b + r, b.T @ p @ a)
    limits = level_limits(config, p, k)
    return HandDerived(a, b, q, r, np.zeros((6, 3)), p, k, SAFETY * min(limits.values()), limits)


class Loop:
    """The body under ``tau = K xi`` in the chart, on states (n, 6)."""

    def __init__(self, config: AttitudeMpcConfig, p: Array, k: Array) -> None:
        self.config, self.p, self.k = config, p, k
        self.inertia = np.asarray(config.inertia_kg_m2)
        self.guard = float(np.linalg.eigvalsh(self.inertia)[0])

    def rate(self, xi: Array) -> Array:
        """Return omega_BN_B (n, 3)."""
        h = self.config.step_s
        angle = np.linalg.norm(xi[:, 3:], axis=1, keepdims=True) * h
        half = np.tan(angle / 2) / np.where(angle > 1e-12, angle, 1) * h
        cayley = np.where(angle > 1e-12, half, h / 2) * xi[:, 3:]
        momentum = legendre(cayley, self.inertia) / h
        return np.asarray(np.linalg.solve(self.inertia, momentum.T).T, dtype=float)

    def step_load(self, xi: Array) -> Array:
        """Return the largest ``|m|`` over the guard (n,) of this and the next step."""
        h = self.config.step_s
        momentum = h * self.rate(xi) @ self.inertia
        impulse = h * h * xi @ self.k.T
        if self.config.forcing == 'paper':
            turned = np.einsum('nji,nj->ni', so3.exp(h * xi[:, 3:]), momentum)
            return self._load(momentum, turned + impulse)
        pushed = momentum + impulse / 2
        inside = np.linalg.norm(pushed, axis=1) < INSIDE * self.guard
        following = np.where(inside[:, None], pushed, 0.0)
        step = so3.cayley(cayley_step(following, self.inertia))
        turned = np.einsum('nji,nj->ni', step, following)
        following = np.where(inside[:, None], turned + impulse / 2, pushed)
        return self._load(momentum, pushed, following)

    def _load(self, *momenta: Array) -> Array:
        return np.max([np.linalg.norm(m, axis=1) for m in momenta], axis=0) / self.guard

    def decrease(self, xi: Array) -> Array:
        """Return ``(F(xi+) - F(xi) + L) / L`` (n,)."""
        def form(x: Array) -> Array:
            return np.einsum('ni,ij,nj->n', x, self.p, x) / 2
        config, h, torque = self.config, self.config.step_s, xi @ self.k.T
        attitude, omega = lgvi_step(
            so3.exp(xi[:, :3]), self.rate(xi), torque, inertia_kg_m2=self.inertia, step_s=h,
            forcing='paper' if config.forcing == 'paper' else 'symmetric')
        step = step_rotation(omega, self.inertia, h)
        cost = (_trace_cost(config.attitude_weight, so3.exp(xi[:, :3]))
                + _trace_cost(config.rate_weight, so3.exp(h * xi[:, 3:])) / h ** 2
                + np.einsum('ni,ij,nj->n', torque, trace_hessian(config.torque_weight),
                            torque) / 2)
        return (form(np.hstack([so3.log(attitude), so3.log(step) / h])) - form(xi) + cost) / cost


def _trace_cost(weight: Array, rotation: Array) -> Array:
    """Return ``tr(Q (I - R))`` (n,), accurate near R = I."""
    return -np.einsum('ij,nij->n', weight, rotation - np.eye(3))


def level_limits(config: AttitudeMpcConfig, p: Array, k: Array) -> dict[str, float]:
    """Return the level at which each condition breaks first."""
    loop, covariance = Loop(config, p, k), np.linalg.inv(p)
    limits = {'chart': (INSIDE * np.pi) ** 2 / float(np.linalg.eigvalsh(covariance[:3, :3])[-1])}
    if config.max_torque_n_m is not None:
        spread = np.einsum('ij,jk,ik->i', k, covariance, k)
        limits['torque'] = float(np.min(np.square(config.max_torque_n_m) / spread))
    roots = np.linalg.cholesky(covariance)
    directions = np.random.default_rng(SEED).normal(size=(DIRECTIONS, 6))
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True) @ roots.T
    conditions: dict[str, Callable[[Array], Array]] = {
        'step': lambda xi: loop.step_load(xi) - INSIDE}
    if config.max_rate_rad_s is not None:
        box = np.asarray(config.max_rate_rad_s)
        conditions['rate'] = lambda xi: np.max(np.abs(loop.rate(xi)) / box, axis=1) - 1
    conditions['decrease'] = loop.decrease
    for name, violation in conditions.items():
        limits[name] = _first_level(violation, directions, roots, min(limits.values()))
    return limits


def _first_level(violation: Callable[[Array], Array], directions: Array, roots: Array,
                 top: float) -> float:
    """Return the smallest level up to ``top`` where ``violation(xi) > 0``, or inf."""
    largest = np.sqrt(top)
    for _ in range(3):
        radii = largest * np.linspace(1e-3, 1.0, RADII)
        first = np.full(len(directions), np.inf)
        for radius in radii[::-1]:
            first[violation(radius * directions) > 0] = radius
        if first.min() > radii[RADII // 4]:
            break
        largest = first.min() * (1 + 1e-9)
    if first.min() <= radii[0] or np.isinf(first.min()):
        return 0.0 if first.min() <= radii[0] else float('inf')

    def radius_at(free: Array) -> float:
        values = violation(radii[:, None] * (roots @ (free / np.linalg.norm(free))))
        broken = np.flatnonzero(values > 0)
        if broken.size == 0:
            return float(radii[-1] * (1 - values[-1]))
        at = max(int(broken[0]), 1)
        low, high = values[at - 1], values[at]
        return float(radii[at - 1] + (radii[at] - radii[at - 1]) * low / (low - high))

    def crossing(free: Array) -> float:
        unit = roots @ (free / np.linalg.norm(free))
        broken = np.flatnonzero(violation(radii[:, None] * unit) > 0)
        if broken.size == 0:
            return float('inf')
        low, high = radii[broken[0] - 1], radii[broken[0]]
        for _ in range(60):
            middle = (low + high) / 2
            inside = violation(middle * unit[None])[0] <= 0
            low, high = (middle, high) if inside else (low, middle)
        return float(low)

    whiten, order, best = np.linalg.inv(roots), np.argsort(first)[:REFINED], float('inf')
    for index in order[np.isfinite(first[order])]:
        start = whiten @ directions[index]
        found = minimize(radius_at, start, method='Nelder-Mead',
                         options={'maxfev': 400, 'xatol': 1e-6, 'fatol': 1e-9})
        best = min(best, crossing(start), crossing(found.x))
    return best ** 2
