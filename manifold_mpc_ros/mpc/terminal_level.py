# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The largest terminal level c, checked against the three conditions of paper eq. (8).

For every xi with ``xi^T P xi <= c`` the local law must (8a) respect the torque limits, (8b)
stay in the set, and (8c) satisfy ``F(xi+) - F(xi) <= -L(xi, K xi)``; the state limits must hold
and the chart and the implicit step must exist. (8c) implies (8b). The torque limit and the
chart have closed forms; the others are searched along many directions and then refined, so
their figures are *sampled*, not certified.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np
from scipy.optimize import minimize

from manifold_mpc_ros.config import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.lgvi import cayley_step, legendre, lgvi_step, step_rotation
from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.scaling import Array

# Directions searched, radii per direction, best directions refined.
_DIRECTIONS, _RADII, _REFINED = 4000, 40, 6
# The level used is this fraction of the largest one found.
_SAFETY = 0.99
# Chart and step stay this fraction inside their ends (pi, and the existence guard).
_INSIDE = 0.999
_SEED = 20180301


@dataclass(frozen=True)
class LevelReport:
    """The chosen level, the level at which each condition would first break, and the margin.

    ``worst_decrease`` is the largest ``(F(xi+) - F(xi) + L) / L`` met inside the set, negative
    when (8c) holds with margin; ``samples`` counts the states where it was evaluated.
    """

    level: float
    limits: dict[str, float]
    limiting: str
    worst_decrease: float
    samples: int


class LocalLoop:
    """The plant under ``tau = K xi`` in the chart, vectorised over states (n, 6)."""

    def __init__(self, config: AttitudeMpcConfig, p: Array, k: Array) -> None:
        """Keep the configuration and the candidate P (6, 6), K (3, 6)."""
        self.config, self.p, self.k = config, p, k
        self.inertia = np.asarray(config.inertia_kg_m2)
        self.guard = float(np.linalg.eigvalsh(self.inertia)[0])

    def rate(self, xi: Array) -> Array:
        """Return omega_BN_B (n, 3) of chart states."""
        h = self.config.step_s
        angle = np.linalg.norm(xi[:, 3:], axis=1, keepdims=True) * h
        half = np.tan(angle / 2) / np.where(angle > 1e-12, angle, 1) * h
        cayley = np.where(angle > 1e-12, half, h / 2) * xi[:, 3:]
        momentum = legendre(cayley, self.inertia) / h
        return np.asarray(np.linalg.solve(self.inertia, momentum.T).T, dtype=float)

    def step_load(self, xi: Array) -> Array:
        """Return the largest ``|m|`` over the smallest inertia (n,) of this and the next step.

        Below 1 both implicit steps are guaranteed to exist (design guard, docs/theory.md).
        """
        h = self.config.step_s
        momentum = h * self.rate(xi) @ self.inertia
        impulse = h * h * xi @ self.k.T
        if self.config.forcing == 'paper':
            turned = np.einsum('nji,nj->ni', so3.exp(h * xi[:, 3:]), momentum)
            return self._load(momentum, turned + impulse)
        pushed = momentum + impulse / 2
        inside = np.linalg.norm(pushed, axis=1) < _INSIDE * self.guard
        following = np.where(inside[:, None], pushed, 0.0)
        step = so3.cayley(cayley_step(following, self.inertia))
        turned = np.einsum('nji,nj->ni', step, following)
        following = np.where(inside[:, None], turned + impulse / 2, pushed)
        return self._load(momentum, pushed, following)

    def _load(self, *momenta: Array) -> Array:
        """Return the largest norm over the smallest inertia, row by row."""
        return np.max([np.linalg.norm(m, axis=1) for m in momenta], axis=0) / self.guard

    def advance(self, xi: Array) -> Array:
        """Return the chart states (n, 6) after one step of the local law."""
        h = self.config.step_s
        attitude, omega = lgvi_step(
            so3.exp(xi[:, :3]), self.rate(xi), xi @ self.k.T, inertia_kg_m2=self.inertia,
            step_s=h, forcing=cast(Literal['symmetric', 'paper'], self.config.forcing))
        step = step_rotation(omega, self.inertia, h)
        return np.hstack([so3.log(attitude), so3.log(step) / h])

    def stage_cost(self, xi: Array) -> Array:
        """Return L (n,) of chart states under the local law."""
        config, h = self.config, self.config.step_s
        torque = xi @ self.k.T
        weight = np.trace(config.torque_weight) * np.eye(3) - config.torque_weight
        return (_trace_cost(config.attitude_weight, so3.exp(xi[:, :3]))
                + _trace_cost(config.rate_weight, so3.exp(h * xi[:, 3:])) / h ** 2
                + np.einsum('ni,ij,nj->n', torque, weight, torque) / 2)

    def decrease(self, xi: Array) -> Array:
        """Return ``(F(xi+) - F(xi) + L) / L`` (n,), paper eq. (8c) when not positive."""
        def form(x: Array) -> Array:
            return np.einsum('ni,ij,nj->n', x, self.p, x) / 2
        cost = self.stage_cost(xi)
        return (form(self.advance(xi)) - form(xi) + cost) / cost


def _trace_cost(weight: Array, rotation: Array) -> Array:
    """Return ``tr(Q (I - R))`` (n,), accurate near R = I: ``-sum(Q * (R - I))``."""
    return -np.einsum('ij,nij->n', weight, rotation - np.eye(3))


def largest_level(config: AttitudeMpcConfig, p: Array, k: Array) -> LevelReport:
    """Map a configuration and its P, K to the largest level that meets every condition.

    Raises
    ------
    DesignError
        When the decrease condition fails arbitrarily close to the origin.

    """
    loop = LocalLoop(config, p, k)
    covariance = np.linalg.inv(p)
    limits = {'chart': (_INSIDE * np.pi) ** 2 / float(np.linalg.eigvalsh(covariance[:3, :3])[-1])}
    if config.max_torque_n_m is not None:
        spread = np.einsum('ij,jk,ik->i', k, covariance, k)
        limits['torque'] = float(np.min(np.square(config.max_torque_n_m) / spread))
    roots = np.linalg.cholesky(covariance)
    rng = np.random.default_rng(_SEED)
    directions = rng.normal(size=(_DIRECTIONS, 6))
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True) @ roots.T
    # The step has to exist wherever the later conditions are evaluated.
    limits['step'] = _first_level(lambda xi: loop.step_load(xi) - _INSIDE, directions, roots,
                                  min(limits.values()))
    if config.max_rate_rad_s is not None:
        box = np.asarray(config.max_rate_rad_s)
        limits['rate'] = _first_level(
            lambda xi: np.max(np.abs(loop.rate(xi)) / box, axis=1) - 1, directions, roots,
            min(limits.values()))
    limits['decrease'] = _first_level(loop.decrease, directions, roots, min(limits.values()))
    limiting = min(limits, key=lambda name: limits[name])
    level = _SAFETY * limits[limiting]
    if level < 1e-9 * limits['chart']:
        raise DesignError('no terminal level meets F(xi+) - F(xi) <= -L near the equilibrium')
    worst, samples = _worst_decrease(loop, roots, level, rng)
    return LevelReport(level, limits, limiting, worst, samples)


def _first_level(violation: Callable[[Array], Array], directions: Array, roots: Array,
                 top: float) -> float:
    """Return the smallest level up to ``top`` where ``violation(xi) > 0``, or inf.

    Scans radii along the directions, then moves the worst directions downhill. A violation at
    the smallest radius counts as one at the origin: 0.
    """
    radii = np.sqrt(top) * np.linspace(1e-3, 1.0, _RADII)
    first = np.full(len(directions), np.inf)
    for radius in radii[::-1]:
        first[violation(radius * directions) > 0] = radius
    order = np.argsort(first)[:_REFINED]
    best = float(first[order[0]])
    if not np.isfinite(best):
        return float('inf')
    if best <= radii[0]:
        return 0.0

    def radius_at(free: Array) -> float:
        unit = roots @ (free / np.linalg.norm(free))
        values = violation(radii[:, None] * unit)
        broken = np.flatnonzero(values > 0)
        if broken.size == 0:
            return float(radii[-1] * (1 - values[-1]))
        at = int(broken[0])
        if at == 0:
            return 0.0
        low, high = values[at - 1], values[at]
        return float(radii[at - 1] + (radii[at] - radii[at - 1]) * low / (low - high))

    whiten = np.linalg.inv(roots)
    for index in order:
        if np.isfinite(first[index]):
            found = minimize(radius_at, whiten @ directions[index], method='Nelder-Mead',
                             options={'maxfev': 400, 'xatol': 1e-6, 'fatol': 1e-9})
            best = min(best, float(found.fun))
    return best ** 2


def _worst_decrease(loop: LocalLoop, roots: Array, level: float, rng: np.random.Generator
                    ) -> tuple[float, int]:
    """Return the largest decrease ratio over fresh states filling the set, and their number."""
    unit = rng.normal(size=(4 * _DIRECTIONS, 6))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    radius = np.maximum(rng.uniform(size=(len(unit), 1)) ** (1 / 6), 1e-3)
    radius[: len(unit) // 2] = 1.0
    states = np.sqrt(level) * radius * unit @ roots.T
    return float(loop.decrease(states).max()), len(states)
