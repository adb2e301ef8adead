# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a rigorous certificate asks of a problem, and the helpers that clients share.

A client encloses one thing: the closed loop in the chart, ``xi+ = phi^-1(f(phi(xi), K xi))``, with
its first and second derivatives on a box (`ClosedLoop.advance`, in jets), together with the
quantities that must stay below 1 there (guards of implicit steps, rates over their limits, the end
of the chart). Everything else, `W`, limits and chart radii, are constants.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from flint import arb, arb_mat

from manifold_mpc_ros.config.wheels import Zonotope
from manifold_mpc_ros.lab.certification.jets import Jet
from manifold_mpc_ros.lie.arrays import Array


@dataclass(frozen=True)
class Loop:
    """The next coordinates as jets, and named numbers that must be below 1 on the box."""

    following: list[Jet]
    ratios: dict[str, arb]


@dataclass(frozen=True)
class BoxVerdict:
    """What a test says of a box: the axis to halve it along, why it is not verified, bounds met.

    ``outside``: no point of it is in the set; ``verified``: all is proved for every point of it;
    ``refuted``: a condition is provably wrong at a point of it that is in the set.
    """

    kind: Literal['outside', 'verified', 'undecided', 'refuted']
    axis: int = 0
    reason: str = ''
    ratios: dict[str, float] = field(default_factory=dict)


class ClosedLoop(Protocol):
    """A closed loop ``u = K xi`` that can be enclosed.

    ``weight`` is ``lambda W = Q + N K + K^T N^T + K^T R K`` (n, n) of the stage cost L itself,
    which the client promises to dominate it: ``L(xi, K xi) <= xi^T (lambda W) xi / 2`` on all of
    the chart, after `check_cost` has returned nothing.
    """

    @property
    def dimension(self) -> int:
        """The dimension n."""

    @property
    def weight(self) -> arb_mat:
        """``lambda W`` (n, n)."""

    @property
    def control_limits(self) -> Array | None:
        """Half widths (m,) of the box on K xi."""

    @property
    def control_facets(self) -> Zonotope | None:
        """The polytope that K xi is limited to as well, None for none."""

    @property
    def chart_radii(self) -> Sequence[tuple[int, arb]]:
        """(dimension, radius) of each factor's chart, in order; radius inf where it has no end."""

    @property
    def cone_radii(self) -> Mapping[str, arb]:
        """By name, the angle that the first factor may turn without violating a cone."""

    def check_cost(self) -> str | None:
        """Return why the bound of L by W is not proved, None when it is."""

    def advance(self, xi: list[Jet], forms: MeanValueForms) -> Loop:
        """Map the coordinates of a box to the enclosed closed loop."""


class MeanValueForms:
    """Mean value enclosures of what a closed loop computes on its way.

    The first evaluation, at the centre of a box (``offsets`` None), records values and gradients;
    the second, on the box ``centre + offsets``, intersects what it finds with

        f(xi) in f(centre) + grad f(box) (xi - centre),    the same for grad f with Hess f,

    which is tighter by an order in the size of the box. Both enclosures hold, so does their
    intersection.
    """

    def __init__(self) -> None:
        """Start empty, at the centre."""
        self.offsets: arb_mat | None = None
        self._known: dict[str, list[Jet]] = {}

    def refine(self, name: str, jets: list[Jet]) -> list[Jet]:
        """Record jets at the centre; intersect them with their mean value forms on the box."""
        if self.offsets is None:
            self._known[name] = jets
            return jets
        return [self._refined(jet, centre) for jet, centre in zip(jets, self._known[name])]

    def _refined(self, jet: Jet, centre: Jet) -> Jet:
        """Return the intersection for one jet."""
        assert self.offsets is not None
        value = centre.value + (jet.gradient * self.offsets)[0, 0]
        value = meet(jet.value, value)
        if not jet.second:
            return Jet(value, jet.gradient, None, False)
        gradient = centre.gradient
        if jet.hessian is not None:
            gradient = gradient + (jet.hessian * self.offsets).transpose()
        n = gradient.ncols()
        return Jet(value, arb_mat(1, n, [
            meet(jet.gradient[0, j], gradient[0, j]) for j in range(n)]), jet.hessian)


def meet(a: arb, b: arb) -> arb:
    """Return the intersection of two enclosures of one number; the finite one if one is not."""
    if not a.is_finite():
        return b
    return a.intersection(b) if b.is_finite() else a


def exact(matrix: Array) -> arb_mat:
    """Return a matrix of floats as one of exact balls."""
    rows = np.atleast_2d(np.asarray(matrix, dtype=float))
    return arb_mat(rows.shape[0], rows.shape[1], [arb(value) for value in rows.ravel().tolist()])


def midpoints(matrix: arb_mat) -> Array:
    """Return the midpoints of a ball matrix as floats (not rigorous, for preconditioning)."""
    return np.array([float(entry.mid()) for entry in matrix.entries()]).reshape(
        matrix.nrows(), matrix.ncols())


def upper(x: arb) -> float:
    """Return a float that is not below the ball; NaN when the ball is not finite."""
    return float(np.nextafter(float(x.upper()), np.inf)) if x.is_finite() else float('nan')


def is_positive_definite(matrix: arb_mat) -> bool:
    """Say whether every symmetric matrix enclosed is provably positive definite."""
    return definiteness(matrix) > 0


def definiteness(matrix: arb_mat, frame: Array | None = None) -> float:
    """Return a lower bound of the eigenvalues of ``T^T M T`` for all symmetric M enclosed.

    T is ``frame``, or eigenvectors of the midpoint scaled so that positive definite midpoints
    become the identity; congruence keeps the sign. Gershgorin's discs then bound the spectrum:
    ``min_i (M'_ii - sum_j |M'_ij|)``. NaN or negative says nothing.
    """
    if frame is None:
        values, vectors = np.linalg.eigh(midpoints(matrix))
        frame = vectors / np.sqrt(np.maximum(np.abs(values), 1e-300))
    turn = exact(frame)
    turned = turn.transpose() * matrix * turn
    n = turned.nrows()
    discs = [turned[i, i] - sum((abs(turned[i, j]) for j in range(n) if j != i), arb(0))
             for i in range(n)]
    if not all(disc.is_finite() for disc in discs):
        return float('nan')
    return float(np.nextafter(min(float(disc.lower()) for disc in discs), -np.inf))


def ratios_exceeded(ratios: Mapping[str, arb]) -> list[str]:
    """Return the names of the ratios that are not provably below 1."""
    return [name for name, ratio in ratios.items() if not ratio < 1]
