# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Prove the conditions of paper eq. (8) on a whole terminal set, in ball arithmetic.

For every xi with ``xi^T P xi <= c``: the cost bound, ``P > 0``, the control box
``c K_i P^-1 K_i^T <= eta_max,i^2`` and the chart ``r^2 I - c (P^-1)_factor > 0`` by themselves;
the decrease, the implicit steps and the state limits by a covering (:mod:`.box_test`). Every
inequality is checked on balls that hold the exact numbers, so rounding is part of the proof.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from flint import arb, arb_mat

from manifold_mpc_ros.lab.certification.box_test import BoxTest
from manifold_mpc_ros.lab.certification.covering import Cover, Progress, cover
from manifold_mpc_ros.lab.certification.enclosure import ClosedLoop, exact, is_positive_definite
from manifold_mpc_ros.lie.arrays import Array

LoopMaker = Callable[[], ClosedLoop]
# Parts of the level that are tried, from below as small sets are cheap, when all of it cannot be
# proved, and geometric halvings after the first that fails.
_CUTS, _HALVINGS = (1e-4, 1e-3, 4e-3, 0.016, 0.064, 0.25, 0.5), 2


@dataclass(frozen=True)
class Proof:
    """What is proved: all conditions up to ``level`` (0: nothing), with ``margin`` to spare.

    ``limits`` are the levels up to which each closed form holds, ``reason`` says why the level
    that was asked for is not proved (empty when it is), ``cover`` is the last successful search,
    or the failed one when nothing is proved. ``boxes`` counts those of every attempt.
    """

    asked: float
    level: float
    margin: float
    reason: str
    limits: dict[str, float]
    linear_bound: float
    cover: Cover
    boxes: int

    @property
    def complete(self) -> bool:
        """Whether the level that was asked for is proved."""
        return self.level >= self.asked


def make_test(make_loop: LoopMaker, P: Array, level: float, margin: float) -> BoxTest:
    """Build the test of the boxes of a level set; importable, for processes."""
    return BoxTest(make_loop(), P, level, margin)


def prove(make_loop: LoopMaker, P: Array, K: Array, level: float, *, margin: float = 0.1,
          budget: int = 200_000, workers: int = 1, smaller: bool = True,
          progress: Progress | None = None) -> Proof:
    """Prove the terminal set of a level, or of the largest smaller one that can be.

    ``F(xi+) - F(xi) <= -(1 + margin) L(xi, K xi)`` is what is shown of the decrease. With
    ``smaller`` False only the level itself is tried. ``make_loop`` is called in each process.
    """
    P, K = np.asarray(P, dtype=float), np.asarray(K, dtype=float)
    loop = make_loop()
    nothing = partial(Proof, level, 0.0, margin, cover=Cover(), boxes=0)
    if not np.array_equal(P, P.T) or not is_positive_definite(exact(P)):
        return nothing(reason='P is not provably symmetric positive definite', limits={},
                       linear_bound=float('nan'))
    why = loop.check_cost()
    test = make_test(make_loop, P, level, margin)
    bound = test.linear_bound()
    limits = closed_form_limits(loop, P, K, level)
    if why is None and not test.at_equilibrium:
        why = 'the origin is not provably a fixed point of the closed loop'
    if why is None and not bound < 0:
        why = ('decrease at the equilibrium: A_K^T P A_K - P + (1 + margin) (Q + K^T R K) is not '
               f'provably negative definite (greatest eigenvalue over the weight: {bound:.4g})')
    if why is not None:
        return nothing(reason=why, limits=limits, linear_bound=bound)
    top = min(level, *limits.values()) if limits else level
    below = [name for name, limit in limits.items() if limit < level]
    reason = f'{below[0]} holds up to {limits[below[0]]:.6g} only' if below else ''
    if reason and not smaller:
        return nothing(reason=reason, limits=limits, linear_bound=bound)
    search = partial(_cover_level, make_loop, P, margin=margin, workers=workers,
                     progress=progress)
    found, proved, failed, boxes = _largest(search, top, budget, smaller)
    return Proof(level, proved, margin, reason or (failed if proved < level else ''), limits,
                 bound, found, boxes)


def _cover_level(make_loop: LoopMaker, P: Array, level: float, budget: int, *, margin: float,
                 workers: int, progress: Progress | None) -> Cover:
    """Cover the level set."""
    make = partial(make_test, make_loop, P, level, margin)
    reach = bounding_box(P, level)
    return cover(make, -reach, reach, budget=budget, workers=workers, progress=progress)


def _largest(search: Callable[[float, int], Cover], top: float, budget: int, smaller: bool
             ) -> tuple[Cover, float, str, int]:
    """Return the search that succeeded, its level, why a larger one failed, and all boxes."""
    found = search(top, budget)
    boxes, reason = found.boxes, found.reason
    if found.complete or not smaller:
        return found, top if found.complete else 0.0, reason, boxes
    good, bad = 0.0, top
    levels = [top * part for part in _CUTS]
    for _ in range(len(_CUTS) + _HALVINGS):
        level = levels.pop(0) if levels else math.sqrt(good * bad)
        tried = search(level, budget)
        boxes += tried.boxes
        if tried.complete:
            found, good = tried, level
        elif not good:
            break
        else:
            bad, levels = level, []
    return found, good, reason, boxes


def bounding_box(P: Array, level: float) -> Array:
    """Return half widths (n,) of a box that holds ``{xi^T P xi <= level}``, rigorous.

    ``|xi_i| <= sqrt(level (P^-1)_ii)``.
    """
    inverse = _inverse(P)
    return np.array([np.nextafter(float((arb(level) * inverse[i, i]).sqrt().upper()), np.inf)
                     for i in range(len(P))])


def closed_form_limits(loop: ClosedLoop, P: Array, K: Array, level: float) -> dict[str, float]:
    """Return the levels, up to the one asked for, that control box and chart provably allow."""
    inverse, gain = _inverse(P), exact(K)
    limits = {}
    spread = gain * inverse * gain.transpose()
    if loop.control_facets is not None:
        limits['control polytope'] = min(
            _below(arb(bound) * arb(bound) / (exact(normal[None]) * spread
                                              * exact(normal[:, None]))[0, 0])
            for normal, bound in zip(loop.control_facets.normals,
                                     loop.control_facets.bounds.tolist()))
    if loop.control_limits is not None:
        each = [arb(bound) * arb(bound) / spread[i, i]
                for i, bound in enumerate(np.asarray(loop.control_limits).tolist())
                if np.isfinite(bound)]
        limits['control limit'] = min(_below(entry) for entry in each)
    errors = loop.chart_radii[0][0]
    block = arb_mat([[inverse[i, j] for j in range(errors)] for i in range(errors)])
    for name, radius in loop.cone_radii.items():
        limits[name] = _chart_limit(block, radius, level) if radius > 0 else 0.0
    start, charts = 0, []
    for size, radius in loop.chart_radii:
        if radius.is_finite():
            block = arb_mat([[inverse[start + i, start + j] for j in range(size)]
                             for i in range(size)])
            charts.append(_chart_limit(block, radius, level))
        start += size
    if charts:
        limits['chart'] = min(charts)
    return limits


def _chart_limit(block: arb_mat, radius: arb, level: float) -> float:
    """Return a level with ``radius^2 I - level block > 0``: the one asked for, or one below."""
    size = block.nrows()
    middle = np.array([[float(entry.mid()) for entry in row] for row in block.tolist()])
    most = float((radius * radius).mid()) / float(np.linalg.eigvalsh(middle)[-1])
    for candidate in (level, 0.9999 * most, 0.99 * most):
        square = arb_mat(size, size, [radius * radius if i == j else 0
                                      for i in range(size) for j in range(size)])
        if candidate <= most and is_positive_definite(square - block * arb(candidate)):
            return candidate
    return 0.0


def _inverse(P: Array) -> arb_mat:
    """Return an enclosure of P^-1."""
    n = len(P)
    return exact(P).solve(exact(np.eye(n)), nonstop=True, algorithm='precond')


def _below(x: arb) -> float:
    """Return a float that is not above the ball."""
    return float(np.nextafter(float(x.lower()), -np.inf)) if x.is_finite() else 0.0
