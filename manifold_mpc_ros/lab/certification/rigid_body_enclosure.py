# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rigid body's implicit step in jets of ball arithmetic, shared by attitude and pointing.

From the free step ``f = exp(h hat(omega))`` and the torque the body goes on by docs/theory.md (3)
or (4); all of it is explicit in Cayley parameters c but the step ``m -> c``, which is enclosed by
Krawczyk's test: a box C around an approximate root is mapped by

    K(C) = c0 - Y r(c0, M) + (I - Y r'(C, M)) (C - c0),     r = m + m x c + (c.m) c - 2 J c,

and K(C) inside C proves that for every m in M there is one root in C. With |c| < 1 and |m| below
the guard it is the root that the plant takes. Derivatives are those of the inverse of (5).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import arb, arb_mat

from manifold_mpc_ros.config.cones import Cone, alone
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics import scalar_form
from manifold_mpc_ros.lab.certification.enclosure import (
    MeanValueForms,
    exact,
    is_positive_definite,
    midpoints,
)
from manifold_mpc_ros.lab.certification.even_functions import (
    double_arctangent,
    half_cosine,
    half_sine,
)
from manifold_mpc_ros.lab.certification.jets import Jet, coordinates, root, squared_norm
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.cone_cut import target_margins_rad

# Times the box C is widened to hold K(C) before the step counts as not enclosed.
_WIDENINGS = 6
_NEWTON_STEPS = 6


@dataclass(frozen=True)
class Motion:
    """The Cayley parameter of the turn, the next ``Log f+ / h``, and what must be below 1."""

    turn: list[Jet]
    rate: list[Jet]
    ratios: dict[str, arb]


class RigidBodyEnclosure:
    """The rotational motion of one configuration under ``tau = K xi``."""

    def __init__(self, config: AttitudeMpcConfig, gain: Array) -> None:
        """Keep the constants as exact balls."""
        self.h = arb(config.step_s)
        self.symmetric = config.forcing == 'symmetric'
        self.gain = np.asarray(gain, dtype=float)
        self.inertia = _rows(config.inertia_kg_m2)
        self._plain = triple(map(triple, np.asarray(config.inertia_kg_m2).tolist()))
        mean = (self.inertia[0][0] + self.inertia[1][1] + self.inertia[2][2]) / 3
        self._deviator = triple(
            triple(entry - mean if i == j else entry for j, entry in enumerate(row))
            for i, row in enumerate(self.inertia))
        self._guard = lowest_eigenvalue(config.inertia_kg_m2)
        self._limits = config.planned.rate_limits
        weights = [config.rate_weight, config.torque_weight]
        self.rate_hessian, self.torque_hessian = map(trace_hessian, weights)

    def advance(self, xi: list[Jet], rate: list[Jet], forms: MeanValueForms) -> Motion:
        """Map the coordinates and their rate part over one step."""
        torque = [sum((float(g) * x for g, x in zip(row, xi)), start=0.0) for row in self.gain]
        impulse = [self.h * self.h * t for t in torque]
        phi = [self.h * entry for entry in rate]
        s = squared_norm(phi)
        [w], half = [half_cosine(s)], half_sine(s)
        v = [half * entry for entry in phi]
        free = forms.refine('free', self._momentum(w, v))
        quarter = arb.pi() / 2
        ratios = {'free step': self._load(free), **self._rates(free),
                  'branch of the free step': root(s.value) / quarter}
        pushed, after = free, impulse
        if self.symmetric:
            after = [i / 2 for i in impulse]
            pushed = forms.refine('pushed', [m + i for m, i in zip(free, after)])
            ratios['forced step'] = self._load(pushed)
        turn = self._step(pushed, 'turn', forms)
        lost = self._gyroscopic(turn)
        following = forms.refine('next', [m + i - g for m, i, g in zip(pushed, after, lost)])
        ratios['next step'] = self._load(following)
        c = self._step(following, 'next step', forms)
        factor = double_arctangent(squared_norm(c)) / self.h
        for name, cayley in (('turn', turn), ('next step', c)):
            ratios[f'branch of the {name}'] = root(squared_norm(cayley).value)
        return Motion(turn, [factor * entry for entry in c], ratios)

    def check_cost(self) -> str | None:
        """Return why the motion's part of L is not proved to be below its Hessian's form."""
        for name, hessian in (('Qf', self.rate_hessian), ('R', self.torque_hessian)):
            if not is_positive_definite(hessian):
                return f'tr({name}) I - {name} is not provably positive definite'
        return None

    def _momentum(self, w: Jet, v: list[Jet]) -> list[Jet]:
        """Return ``m = 2 (w J v + v x J v)`` of a quaternion."""
        turned = scalar_form.apply(self.inertia, triple(v))
        across = scalar_form.cross(triple(v), turned)
        return [2 * (w * a + b) for a, b in zip(turned, across)]

    def _gyroscopic(self, c: list[Jet]) -> list[Jet]:
        """Return ``m - f^T m = 4 c x J c / (1 + |c|^2)``, from docs/theory.md (5).

        J may be taken less any multiple of I, which leaves a small term and a tight enclosure.
        """
        bent = scalar_form.apply(self._deviator, triple(c))
        scale = 4 / (1 + squared_norm(c))
        return [scale * entry for entry in scalar_form.cross(triple(c), bent)]

    def _load(self, m: list[Jet]) -> arb:
        """Return ``|m| / lambda_min(J)``."""
        return root(squared_norm(m).value) / self._guard

    def _rates(self, m: list[Jet]) -> dict[str, arb]:
        """Return what each rate limit says of the body rate, at most 1 inside."""
        omega = [entry.value / self.h for entry in scalar_form.solve(self.inertia, triple(m))]
        return {name: ratio for limit in self._limits
                for name, ratio in limit.ratios(omega).items()}

    def _step(self, m: list[Jet], name: str, forms: MeanValueForms) -> list[Jet]:
        """Map m to the Cayley parameter of its step, with derivatives of the inverse of (5).

        With l(c) = m: ``Dl dc = dm`` and ``Dl d2c = d2m - D2l(dc, dc)``.
        """
        box, slopes = self._root([jet.value for jet in m]), [jet.gradient.entries() for jet in m]
        # Once more with the box that the first pass has narrowed down.
        for _ in range(1 if forms.offsets is None else 2):
            inner = scalar_form.momentum_from_cayley(
                triple(coordinates(box, m[0].second)), self.inertia)
            inverse = _inverse(arb_mat([row.gradient.entries() for row in inner]))
            first = inverse * arb_mat(slopes)
            known = forms.refine(name, [
                Jet(c, arb_mat([row]), None, False) for c, row in zip(box, first.tolist())])
            box = [jet.value for jet in known]
        if not m[0].second:
            return known
        first, rests = arb_mat([jet.gradient.entries() for jet in known]), []
        for jet, row in zip(m, inner):
            rests.append(jet.curvature() - first.transpose() * row.curvature() * first)
        hessians = [sum((rests[j] * inverse[i, j] for j in (1, 2)), start=rests[0] * inverse[i, 0])
                    for i in range(3)]
        return forms.refine(name, [
            Jet(jet.value, jet.gradient, hessian) for jet, hessian in zip(known, hessians)])

    def _root(self, m: list[arb]) -> list[arb]:
        """Return a box that holds the root of every m in a box, NaN where none is proved.

        Beyond the guard none is looked for.
        """
        if not root(scalar_form.dot(triple(m), triple(m))) < self._guard:
            return [arb.nan()] * 3
        centre = [float(entry.mid()) for entry in m]
        c0 = [arb(value) for value in _newton(centre, self._plain)]
        slope = _jacobian(c0, list(map(arb, centre)), self.inertia)
        y = exact(np.asarray(np.linalg.inv(midpoints(slope)), dtype=float))
        residual = scalar_form.cayley_residual(triple(c0), triple(m), self.inertia)
        shift = y * arb_mat(3, 1, list(residual))
        radius = [float(abs(entry).upper()) * 1.1 + 1e-15 for entry in shift.entries()]
        for _ in range(_WIDENINGS):
            box = [c + arb(0, r) for c, r in zip(c0, radius)]
            spread = arb_mat(3, 1, [arb(0, r) for r in radius])
            slope = _jacobian(box, m, self.inertia)
            image = (arb_mat(3, 3, [int(i == j) for i in range(3) for j in range(3)])
                     - y * slope) * spread - shift
            if not all(entry.is_finite() for entry in image.entries()):
                break
            if all(abs(entry) < r for entry, r in zip(image.entries(), radius)):
                return [c + entry for c, entry in zip(c0, image.entries())]
            radius = [max(r, float(abs(entry).upper())) * 1.2
                      for entry, r in zip(image.entries(), radius)]
        return [arb.nan()] * 3


def block_weight(position: arb_mat, body: RigidBodyEnclosure) -> arb_mat:
    """Return ``lambda W = diag(Q, tr(Qf) I - Qf) + K^T (tr(R) I - R) K``; N is zero."""
    first, gain = position.nrows(), exact(body.gain)
    weight = (gain.transpose() * body.torque_hessian * gain).tolist()
    for start, block in ((0, position), (first, body.rate_hessian)):
        for i, row in enumerate(block.tolist()):
            for j, entry in enumerate(row):
                weight[start + i][start + j] += entry
    return arb_mat(weight)


def trace_hessian(weight: Array) -> arb_mat:
    """Map Q (3, 3) to ``tr(Q) I - Q``, enclosed."""
    q = exact(weight)
    eye = arb_mat(3, 3, [int(i == j) for i in range(3) for j in range(3)])
    return eye * q.trace() - q


def lowest_eigenvalue(matrix: Array) -> arb:
    """Return a number that is provably not above the least eigenvalue of a symmetric matrix."""
    guess = float(np.linalg.eigvalsh(matrix)[0])
    for margin in (1e-13, 1e-11, 1e-9, 1e-6):
        low = guess * (1 - margin)
        if is_positive_definite(exact(matrix) - exact(low * np.eye(len(matrix)))):
            return arb(low)
    return arb(0)


def triple(entries: Iterable[Any]) -> scalar_form.Vector:
    """Return three entries as `scalar_form` takes them."""
    x, y, z = entries
    return x, y, z


def _rows(matrix: Array) -> scalar_form.Matrix:
    """Return a float matrix as rows of exact balls."""
    return triple(triple(map(arb, row)) for row in np.asarray(matrix).tolist())


def _inverse(matrix: arb_mat) -> arb_mat:
    """Return an enclosure of the inverses, by a float preconditioner."""
    return matrix.solve(arb_mat(3, 3, [int(i == j) for i in range(3) for j in range(3)]),
                        nonstop=True, algorithm='precond')


def _jacobian(c: list[arb], m: list[arb], inertia: scalar_form.Matrix) -> arb_mat:
    """Return ``dr/dc = hat(m) + (c.m) I + c m^T - 2 J``."""
    along = c[0] * m[0] + c[1] * m[1] + c[2] * m[2]
    skew: list[list[Any]] = [[0, -m[2], m[1]], [m[2], 0, -m[0]], [-m[1], m[0], 0]]
    return arb_mat([[skew[i][j] + c[i] * m[j] - 2 * inertia[i][j] + (along if i == j else 0)
                     for j in range(3)] for i in range(3)])


def _newton(m: list[float], inertia: scalar_form.Matrix) -> scalar_form.Vector:
    """Return an approximate root in floats."""
    c: scalar_form.Vector = (0.0, 0.0, 0.0)
    for _ in range(_NEWTON_STEPS):
        c = scalar_form.add(c, scalar_form.newton_step(c, (m[0], m[1], m[2]), inertia))
    return c


def cone_radii(config: AttitudeMpcConfig) -> dict[str, arb]:
    """Return the angle by which the identity keeps each cone or group that counts, as balls.

    A group has that of the member that keeps most, by itself. Cones are those that nodes keep.
    """
    if not config.cones:
        return {}
    kept, found = alone(config.kept_cones), {}
    for name, margin in target_margins_rad(config, config.kept_cones).items():
        members = [each for each in kept if name in (each.name, each.group)]
        best = max(members, key=lambda each: float(each.margins_rad(np.eye(3))))
        if np.isfinite(margin):
            found[f'cone {name}'] = _cone_radius(best)
    return found


def _cone_radius(cone: Cone) -> arb:
    """Return the angle between axis and direction less the half angle, or the reverse."""
    axis, s = (list(map(arb, values.tolist())) for values in (cone.axis_B, cone.direction_N))
    cosine = sum((a * b for a, b in zip(axis, s)), start=arb(0)) / (
        sum((a * a for a in axis), start=arb(0)) * sum((b * b for b in s), start=arb(0))).sqrt()
    return arb(cone.sign) * (cosine.acos() - arb(cone.half_angle_rad))
