# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The largest terminal level c, checked against the three conditions of paper eq. (8).

For every xi with ``xi^T P xi <= c`` the local law ``eta = K xi`` must (8a) be in the control box,
(8b) stay in the set, and (8c) satisfy ``F(xi+) - F(xi) <= -L(xi, K xi)``; the state limits must
hold, and chart and step must exist. (8c) implies (8b). The control box and the chart have closed
forms; the others are searched along many directions and then refined, so their figures are
*sampled*, not certified.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.optimize import minimize

from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.batched_evaluation import Batch
from manifold_mpc_ros.terminal.problem import ManifoldProblem

# Directions searched, radii per direction, best directions refined.
_DIRECTIONS, _RADII, _REFINED = 4000, 40, 6
# Scans, each below the first violation of the one before it.
_SCANS = 3
# The level used is this fraction of the largest one found.
SAFETY = 0.99
# Chart and step stay this fraction inside their ends (the chart's radius, and existence).
_INSIDE = 0.999
# Where neither chart nor control box ends the set, no coordinate exceeds so many of its units.
_FAR = 100.0
_SEED = 20180301

# Maps chart states (k, n) to numbers (k,), positive where something is violated.
Condition = Callable[[Array], Array]


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
    """The closed loop of a problem under ``eta = K xi``, on chart states (k, n).

    ``decrease`` is ``(F(xi+) - F(xi) + L) / L`` with ``F = xi^T P xi / 2``, paper eq. (8c) when
    not positive; ``limits`` are the state limits by name, violated when positive; ``existence`` is
    the problem's load of the step less the part of it that may be used, None when it always
    exists.
    """

    def __init__(self, problem: ManifoldProblem, p: Array, k: Array) -> None:
        """Build the functions for the candidate P (n, n), K (m, n)."""
        xi = ca.SX.sym('xi', problem.states.dimension)
        x, u = problem.states.point(xi), problem.controls.point(ca.DM(k) @ xi)
        following = problem.states.coordinates(problem.step(x, u))
        cost = problem.stage_cost(x, u)
        change = (ca.dot(following, ca.DM(p) @ following) - ca.dot(xi, ca.DM(p) @ xi)) / 2
        self.decrease = Batch(xi, (change + cost) / cost)
        self.limits = {name: Batch(xi, ca.mmax(limit(x)))
                       for name, limit in problem.state_limits.items()}
        self.existence = (None if problem.existence is None else
                          Batch(xi, problem.existence(x, u) - _INSIDE))


def largest_level(problem: ManifoldProblem, p: Array, k: Array) -> LevelReport:
    """Map a problem and its P (n, n), K (m, n) to the largest level that meets every condition.

    Raises DesignError when the decrease condition fails arbitrarily close to the origin.
    """
    loop, covariance = LocalLoop(problem, p, k), np.asarray(np.linalg.inv(p), dtype=float)
    limits = closed_form_limits(problem, covariance, k)
    roots = np.linalg.cholesky(covariance)
    rng = np.random.default_rng(_SEED)
    directions = rng.normal(size=(_DIRECTIONS, len(p)))
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True) @ roots.T
    largest = min(limits.values())
    # The step has to exist wherever the later conditions are evaluated.
    if loop.existence is not None:
        limits['step'] = _first_level(loop.existence, directions, roots, min(limits.values()))
    for name, violation in (*loop.limits.items(), ('decrease', loop.decrease)):
        limits[name] = _first_level(violation, directions, roots, min(limits.values()))
    limiting = min(limits, key=lambda name: limits[name])
    level = SAFETY * limits[limiting]
    if level < 1e-9 * largest:
        raise DesignError(f"no terminal level meets the condition '{limiting}' near the "
                          'equilibrium' + (': F(xi+) - F(xi) <= -L fails there'
                                           if limiting == 'decrease' else ''))
    worst, samples = _worst_decrease(loop, roots, level, rng)
    return LevelReport(level, limits, limiting, worst, samples)


def closed_form_limits(problem: ManifoldProblem, covariance: Array, k: Array
                       ) -> dict[str, float]:
    """Return the levels at which the chart and the control box end, from P^-1 and K.

    The largest ``|xi_i|`` of a factor over ``xi^T P xi = c`` is ``sqrt(c lambda_max((P^-1)_ii))``,
    the largest ``|K_j xi|`` is ``sqrt(c K_j P^-1 K_j^T)``. The control chart's end counts as well.
    """
    spread = k @ covariance @ k.T
    ends = np.concatenate([_chart_levels(problem.states.chart_radii, covariance),
                           _chart_levels(problem.controls.chart_radii, spread)])
    limits = {'chart': float(ends.min())}
    if problem.control_limits is not None:
        with np.errstate(divide='ignore'):  # a control that the law leaves alone has no end
            limits[problem.control_name] = float(
                np.min(np.square(problem.control_limits) / np.diag(spread)))
    if problem.control_facets is not None:
        normals, bounds = problem.control_facets
        limits[f'{problem.control_name} polytope'] = float(np.min(
            np.square(bounds) / np.einsum('fi,ij,fj->f', normals, spread, normals)))
    if not np.isfinite(min(limits.values())):
        size = np.max(np.diag(covariance) / np.square(problem.state_units))
        limits['search'] = _FAR ** 2 / float(size)
    return limits


def _chart_levels(radii: tuple[tuple[int, float], ...], covariance: Array) -> list[float]:
    """Return the level at which each factor of a manifold leaves its chart."""
    levels, start = [], 0
    for dimension, radius in radii:
        block = covariance[start:start + dimension, start:start + dimension]
        levels.append((_INSIDE * radius) ** 2 / float(np.linalg.eigvalsh(block)[-1]))
        start += dimension
    return levels


def _first_level(violation: Condition, directions: Array, roots: Array, top: float) -> float:
    """Return the smallest level up to ``top`` where ``violation(xi) > 0``, or inf.

    Scans radii along the directions, again below the first violation while that is near the
    origin, then moves the worst directions downhill and bisects along them. A violation at the
    smallest radius of the last scan counts as one at the origin: 0. A value that is not a number
    is one.
    """
    largest = float(np.sqrt(top))
    for _ in range(_SCANS):
        radii = largest * np.linspace(1e-3, 1.0, _RADII)
        first = np.full(len(directions), np.inf)
        for radius in radii[::-1]:
            first[~(violation(radius * directions) <= 0)] = radius
        if not np.isfinite(first.min()):
            return float('inf')
        if first.min() > radii[_RADII // 4]:
            break
        # Not quite where the violation was met, so that rounding cannot hide it.
        largest = float(first.min()) * (1 + 1e-9)
    if first.min() <= radii[0]:
        return 0.0

    def radius_at(free: Array) -> float:
        return _first_radius(violation, radii, roots @ (free / np.linalg.norm(free)))

    whiten, best = np.linalg.inv(roots), float('inf')
    for index in np.argsort(first)[:_REFINED]:
        if np.isfinite(first[index]):
            start = whiten @ directions[index]
            found = minimize(radius_at, start, method='Nelder-Mead',
                             options={'maxfev': 400, 'xatol': 1e-6, 'fatol': 1e-9})
            best = min(best, *(_crossing(violation, radii, roots @ (free / np.linalg.norm(free)))
                               for free in (start, found.x)))
    return best ** 2


def _first_radius(violation: Condition, radii: Array, unit: Array) -> float:
    """Return about the radius along a direction (n,) at which the violation turns positive.

    Interpolated between the radii; where it does not, the last radius and more, by how far it
    is from it.
    """
    values = violation(radii[:, None] * unit)
    broken = np.flatnonzero(~(values <= 0))
    if broken.size == 0:
        return float(radii[-1] * (1 - values[-1]))
    at = int(broken[0])
    if at == 0:
        return 0.0
    low, high = values[at - 1], values[at]
    if not np.isfinite(high):
        return float(radii[at - 1])
    return float(radii[at - 1] + (radii[at] - radii[at - 1]) * low / (low - high))


def _crossing(violation: Condition, radii: Array, unit: Array) -> float:
    """Return the largest radius below the first violation on the radii, by bisection; or inf."""
    broken = np.flatnonzero(~(violation(radii[:, None] * unit) <= 0))
    if broken.size == 0:
        return float('inf')
    if broken[0] == 0:
        return 0.0
    low, high = float(radii[broken[0] - 1]), float(radii[broken[0]])
    while high - low > 1e-13 * high:
        middle = (low + high) / 2
        if violation(middle * unit[None])[0] <= 0:
            low = middle
        else:
            high = middle
    return low


def _worst_decrease(loop: LocalLoop, roots: Array, level: float, rng: np.random.Generator
                    ) -> tuple[float, int]:
    """Return the largest decrease ratio over fresh states filling the set, and their number."""
    unit = rng.normal(size=(4 * _DIRECTIONS, len(roots)))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    radius = np.maximum(rng.uniform(size=(len(unit), 1)) ** (1 / len(roots)), 1e-3)
    radius[: len(unit) // 2] = 1.0
    states = np.sqrt(level) * radius * unit @ roots.T
    return float(loop.decrease(states).max()), len(states)
