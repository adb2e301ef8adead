# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Proof, on one box, that the terminal cost decreases by more than the stage cost.

With ``lambda W = Q + N K + K^T N^T + K^T R K`` (of L itself), ``V = (1 + margin) lambda W`` and

    D(xi) = (xi+^T P xi+ - xi^T P xi + xi^T V xi) / 2

``D <= 0`` and ``L(xi, K xi) <= xi^T (lambda W) xi / 2`` give paper (8c), ``F(xi+) - F(xi) <= -L``,
with room to spare. Two tests prove D <= 0, both on enclosures of G = D xi+ / D xi and its
derivatives.

*Boxes that hold the origin.* If ``G(y)^T P G(y) - P + V < 0`` for every y of a box (convex, with
0 in it), then ``xi+ = (int_0^1 G(t xi) dt) xi`` and, as ``G -> G^T P G`` is convex, Jensen's
inequality gives ``xi+^T P xi+ <= xi^T (int_0^1 G^T P G dt) xi <= xi^T (P - V) xi``.

*Other boxes.* With y = xi+(m), G = G(m) at the centre m and rho_i = d^T Hess xi+_i d / 2 the
Lagrange remainder, ``xi+ = y + G d + rho`` and

    D(m + d) = D(m) + grad D(m) d + d^T M d / 2 + (G d)^T P rho + rho^T P rho / 2,
    M = G^T P G + sum_i (P y)_i Hess xi+_i - P + V,

``Hess xi+`` enclosed on the box, the rest at m. The midpoint of M makes a concave function (or
else ``H0 = A_K^T P A_K - P + V < 0``, the M of the equilibrium, does), whose greatest value on a
box is bounded by any of its tangent planes; what is left of M and the terms in rho are bounded by
absolute values. The error is of second order in the box over its distance from 0, so the box may
be large.
"""

from __future__ import annotations

import numpy as np
from flint import arb, arb_mat

from manifold_mpc_ros.lab.certification.enclosure import (
    BoxVerdict,
    ClosedLoop,
    Loop,
    MeanValueForms,
    definiteness,
    exact,
    is_positive_definite,
    midpoints,
    ratios_exceeded,
    upper,
)
from manifold_mpc_ros.lab.certification.jets import coordinates
from manifold_mpc_ros.lie.arrays import Array

# Sweeps of coordinate ascent for the point of a box where a tangent plane is tightest.
_SWEEPS = 12
# Covers the rounding of a few hundred float operations on numbers that are not negative.
_ROUNDING = 1 + 1e-12


class BoxTest:
    """The test of every box of ``{xi^T P xi <= level}`` for one closed loop."""

    def __init__(self, loop: ClosedLoop, P: Array, level: float, margin: float) -> None:
        """Keep the constants; `linear_bound` says whether the test can succeed at all."""
        self.loop, self.n, self.level = loop, loop.dimension, level
        self.P = np.asarray(P, dtype=float)
        self._P = exact(self.P)
        self._V = loop.weight * (1 + arb(margin))
        self._S = self._P - self._V
        centre = self._at([0.0] * self.n, MeanValueForms())
        self._at_rest = _gradients(centre).transpose() * self._P * _gradients(centre) - self._S
        middle = midpoints(self._at_rest)
        self._H0 = (middle + middle.T) / 2
        self.at_equilibrium = all(
            jet.value.contains(0) and abs(jet.value) < 1e-9 for jet in centre.following)
        self.half_widths = np.sqrt(level * np.diag(np.linalg.inv(self.P)))
        scale = np.linalg.inv(np.linalg.cholesky(midpoints(self._V)))
        self._whiten = scale.T

    def linear_bound(self) -> float:
        """Return a bound of the eigenvalues of ``A_K^T P A_K - P + V`` relative to V, rigorous."""
        values, vectors = np.linalg.eigh(self._whiten.T @ self._H0 @ self._whiten)
        frame = self._whiten @ vectors
        same = definiteness(exact(-self._H0)) > 0 and values[-1] < 0
        bound = -definiteness(-self._at_rest, frame)
        return bound if same else float('inf')

    def judge(self, low: Array, high: Array) -> BoxVerdict:
        """Test the box between two corners."""
        centre, radius = _ball_of(low, high)
        widest = int(np.argmax(radius / self.half_widths))
        if self._is_outside(centre, radius):
            return BoxVerdict('outside')
        forms = MeanValueForms()
        middle = self._at(centre.tolist(), forms)
        wrong = self._refutation(centre, middle)
        if wrong:
            return BoxVerdict('refuted', reason=wrong)
        forms.offsets = arb_mat(self.n, 1, [arb(0, r) for r in radius.tolist()])
        loop = self.loop.advance(coordinates(
            [arb(m, r) for m, r in zip(centre.tolist(), radius.tolist())]), forms)
        exceeded = ratios_exceeded(loop.ratios)
        if exceeded:
            return BoxVerdict(
                'undecided', widest, f'{exceeded[0]} is not provably below its limit')
        if not all(entry.is_finite()
                   for jet in loop.following for entry in jet.curvature().entries()):
            return BoxVerdict('undecided', widest, 'the closed loop is not enclosed')
        ratios = {name: upper(ratio) for name, ratio in loop.ratios.items()}
        if np.all(low <= 0) and np.all(high >= 0):
            return self._judge_about_zero(radius, middle, loop, forms, ratios)
        return self._judge_by_taylor(centre, radius, middle, loop, ratios)

    def _at(self, point: list[float], forms: MeanValueForms) -> Loop:
        """Evaluate the closed loop at one point."""
        loop = self.loop.advance(coordinates([arb(x) for x in point], second=False), forms)
        forms.refine('following', loop.following)
        return loop

    def _is_outside(self, centre: Array, radius: Array) -> bool:
        """Say whether ``xi^T P xi > level`` on all of a box."""
        point = arb_mat(self.n, 1, [arb(x) for x in centre.tolist()])
        slope = self._P * point * -2
        value = arb(self.level) - (point.transpose() * self._P * point)[0, 0]
        return concave_bound(value, slope, -2 * self.P, radius) < 0

    def _refutation(self, centre: Array, loop: Loop) -> str:
        """Return what is provably wrong at the centre of a box, when that is in the set."""
        point = arb_mat(self.n, 1, [arb(x) for x in centre.tolist()])
        if not (point.transpose() * self._P * point)[0, 0] <= self.level:
            return ''
        where = f'at xi = ({", ".join(f"{x:.4g}" for x in centre)})'
        for name, ratio in loop.ratios.items():
            if ratio > 1:
                return f'{name} is above its limit {where}'
        if self._decrease(point, loop) > 0:
            return f'F(xi+) - F(xi) is above -(1 + margin) L {where}'
        return ''

    def _decrease(self, point: arb_mat, loop: Loop) -> arb:
        """Return D at a point."""
        following = arb_mat(self.n, 1, [jet.value for jet in loop.following])
        return (_form(self._P, following) - _form(self._S, point)) / 2

    def _judge_about_zero(self, radius: Array, middle: Loop, loop: Loop, forms: MeanValueForms,
                          ratios: dict[str, float]) -> BoxVerdict:
        """Test ``G^T P G - P + V < 0`` on a box with the origin in it, by its mean value form."""
        following = forms.refine('following', loop.following)
        slope, start = arb_mat([jet.gradient.entries() for jet in following]), _gradients(middle)
        form = start.transpose() * self._P * start - self._S
        centre = midpoints(form)
        _, vectors = np.linalg.eigh(self._whiten.T @ (centre + centre.T) @ self._whiten)
        frame = exact(self._whiten @ vectors)
        total = frame.transpose() * form * frame
        left = (slope * frame).transpose() * self._P
        bends = [jet.curvature() for jet in loop.following]
        sizes = np.zeros(self.n)
        for k in range(self.n):
            column = arb_mat([[bend[i, k] for i in range(self.n)] for bend in bends])
            change = left * (column * frame) * arb(0, float(radius[k]))
            change = change + change.transpose()
            sizes[k] = max(float(entry.rad()) for entry in change.entries())
            total = total + change
        if definiteness(-total, np.eye(self.n)) > 0:
            return BoxVerdict('verified', ratios=ratios)
        return BoxVerdict('undecided', int(np.argmax(sizes)), 'G^T P G - P + V < 0 is not proved',
                       ratios)

    def _judge_by_taylor(self, centre: Array, radius: Array, middle: Loop, loop: Loop,
                         ratios: dict[str, float]) -> BoxVerdict:
        """Test D < 0 by Taylor's formula."""
        point = arb_mat(self.n, 1, [arb(x) for x in centre.tolist()])
        start = _gradients(middle)
        reached = self._P * arb_mat(self.n, 1, [jet.value for jet in middle.following])
        gradient = start.transpose() * reached - self._S * point
        quadratic = start.transpose() * self._P * start - self._S
        bends = [jet.curvature() for jet in loop.following]
        quadratic = quadratic + _combined(reached.transpose(), bends)[0]
        concave = midpoints(quadratic)
        concave = (concave + concave.T) / 2
        if not is_positive_definite(exact(-concave)):
            concave = self._H0
        parts = _sizes(quadratic - exact(concave)) @ radius / 2
        for k, bend in enumerate(_combined(start.transpose() * self._P, bends)):
            parts += radius[k] * (_sizes(bend) @ radius) / 2
        moved = np.array([radius @ _sizes(bend) @ radius for bend in bends]) / 2
        rest = (radius @ parts + moved @ np.abs(self.P) @ moved / 2) * _ROUNDING
        bound = concave_bound(self._decrease(point, middle), gradient, concave, radius)
        if bound + arb(rest) < 0:
            return BoxVerdict('verified', ratios=ratios)
        return BoxVerdict(
            'undecided', int(np.argmax(radius * parts)), 'D < 0 is not proved', ratios)


def concave_bound(value: arb, gradient: arb_mat, hessian: Array, radius: Array) -> arb:
    """Return a bound of ``value + g d + d^T H d / 2`` over the box ``|d_i| <= r_i``.

    H (floats, exact) must be negative semidefinite: then the tangent plane at any z is above, and
    its greatest value is at a corner, ``phi(z) - phi'(z) z + sum |phi'(z)_i| r_i``.
    """
    at = np.array([float(entry.mid()) for entry in gradient.entries()])
    z = np.zeros(len(radius))
    slope = at.copy()
    for _ in range(_SWEEPS):
        for i, r in enumerate(radius):
            moved = min(max(z[i] - slope[i] / hessian[i, i], -r), r)
            slope += hessian[i] * (moved - z[i])
            z[i] = moved
    n = len(radius)
    point = arb_mat(n, 1, [arb(x) for x in z.tolist()])
    bent = exact(hessian) * point
    total = value + (gradient.transpose() * point + bent.transpose() * point / 2)[0, 0]
    steep = gradient + bent
    for entry, x, r in zip(steep.entries(), z.tolist(), radius.tolist()):
        total = total - entry * arb(x) + abs(entry) * arb(r)
    return total


def _combined(weights: arb_mat, matrices: list[arb_mat]) -> list[arb_mat]:
    """Return ``sum_i w_ki M_i`` for each row k of the weights."""
    rows = []
    for weight in weights.tolist():
        total = matrices[0] * weight[0]
        for entry, matrix in zip(weight[1:], matrices[1:]):
            total = total + matrix * entry
        rows.append(total)
    return rows


def _sizes(matrix: arb_mat) -> Array:
    """Return bounds of the absolute values of the entries."""
    return np.array([upper(abs(entry)) for entry in matrix.entries()]).reshape(
        matrix.nrows(), matrix.ncols())


def _gradients(loop: Loop) -> arb_mat:
    """Return G (n, n)."""
    return arb_mat([jet.gradient.entries() for jet in loop.following])


def _form(matrix: arb_mat, v: arb_mat) -> arb:
    """Return ``v^T M v``."""
    return (v.transpose() * matrix * v)[0, 0]


def _ball_of(low: Array, high: Array) -> tuple[Array, Array]:
    """Return centre and radius of a box, the radius rounded up so that the ball holds it."""
    centre = (low + high) / 2
    radius = np.nextafter(np.maximum(high - centre, centre - low), np.inf)
    return centre, np.asarray(radius)
