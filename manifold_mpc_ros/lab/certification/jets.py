# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Second-order jets in ball arithmetic: a value, its gradient and its Hessian, all enclosed.

A `Jet` is a scalar function of the n coordinates of a box. It has + - * / like a float, so the
formulas of the model that accept any scalar accept it, and what comes out encloses the value,
the first and the second derivatives at every point of the box.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias, Union

from flint import arb, arb_mat

Number: TypeAlias = Union['Jet', arb, float, int]


class Jet:
    """Enclosures of f (arb), grad f (1, n) and Hess f (n, n); None stands for zero.

    With ``order`` 1 (``hessian`` None throughout) the second derivatives are not carried.
    """

    __slots__ = ('gradient', 'hessian', 'second', 'value')

    def __init__(self, value: arb, gradient: arb_mat, hessian: arb_mat | None,
                 second: bool = True) -> None:
        """Hold the enclosures; ``second`` says whether second derivatives are carried."""
        self.value, self.gradient, self.hessian = value, gradient, hessian
        self.second = second

    def __add__(self, other: Number) -> Jet:
        if not isinstance(other, Jet):
            return Jet(self.value + other, self.gradient, self.hessian, self.second)
        return Jet(self.value + other.value, self.gradient + other.gradient,
                   _sum(self.hessian, other.hessian), self.second)

    __radd__ = __add__

    def __neg__(self) -> Jet:
        return self * -1

    def __sub__(self, other: Number) -> Jet:
        return self + -other

    def __rsub__(self, other: Number) -> Jet:
        return -self + other

    def __mul__(self, other: Number) -> Jet:
        if not isinstance(other, Jet):
            return Jet(self.value * other, self.gradient * other,
                       None if self.hessian is None else self.hessian * other, self.second)
        gradient = self.gradient * other.value + other.gradient * self.value
        if not self.second:
            return Jet(self.value * other.value, gradient, None, False)
        outer = self.gradient.transpose() * other.gradient
        hessian = outer + outer.transpose()
        if other.hessian is not None:
            hessian = hessian + other.hessian * self.value
        if self.hessian is not None:
            hessian = hessian + self.hessian * other.value
        return Jet(self.value * other.value, gradient, hessian)

    __rmul__ = __mul__

    def __truediv__(self, other: Number) -> Jet:
        if not isinstance(other, Jet):
            return self * (arb(1) / other)
        return self * other.compose(*_reciprocal(other.value))

    def __rtruediv__(self, other: Number) -> Jet:
        return self.compose(*_reciprocal(self.value)) * other

    def compose(self, value: arb, first: arb, second: arb) -> Jet:
        """Return the jet of phi(f) from enclosures of phi, phi' and phi'' on f's range."""
        if not self.second:
            return Jet(value, self.gradient * first, None, False)
        hessian = self.gradient.transpose() * self.gradient * second
        if self.hessian is not None:
            hessian = hessian + self.hessian * first
        return Jet(value, self.gradient * first, hessian)

    def curvature(self) -> arb_mat:
        """Return the Hessian, zeros where nothing is stored."""
        n = self.gradient.ncols()
        return arb_mat(n, n) if self.hessian is None else self.hessian

    def square(self) -> Jet:
        """Return f^2, whose value is not negative."""
        product = self * self
        return Jet(square(self.value), product.gradient, product.hessian, self.second)


def coordinates(box: Sequence[arb], second: bool = True) -> list[Jet]:
    """Return the coordinates of a box as jets."""
    n = len(box)
    return [Jet(entry, arb_mat(1, n, [int(i == j) for j in range(n)]), None, second)
            for i, entry in enumerate(box)]


def chain(outer: Jet, inner: Sequence[Jet]) -> Jet:
    """Return ``phi(f_1, ..., f_k)`` from the jets of phi in k variables and of the f_i.

    Enclosing phi's derivatives in its own few variables keeps what cancels in them together.
    """
    jacobian = arb_mat([jet.gradient.entries() for jet in inner])
    gradient = outer.gradient * jacobian
    if not outer.second:
        return Jet(outer.value, gradient, None, False)
    hessian = None
    if outer.hessian is not None:
        hessian = jacobian.transpose() * outer.hessian * jacobian
    for i, jet in enumerate(inner):
        if jet.hessian is not None:
            hessian = _sum(hessian, jet.hessian * outer.gradient[0, i])
    return Jet(outer.value, gradient, hessian)


def square(x: arb) -> arb:
    """Return the square of a ball, cut at zero where the ball holds zero."""
    return (x * x).nonnegative_part()


def squared_norm(v: Sequence[Jet]) -> Jet:
    """Return the sum of squares."""
    total = v[0].square()
    for entry in v[1:]:
        total = total + entry.square()
    return total


def root(x: arb) -> arb:
    """Return the root of a number that is not negative, though its ball may reach below zero."""
    return x.sqrt() if x > 0 else between(arb(0), x.upper().sqrt())


def between(low: arb, high: arb) -> arb:
    """Return a ball that holds both arguments and all that is between."""
    return low.union(high)


def _reciprocal(x: arb) -> tuple[arb, arb, arb]:
    """Return 1/x and its two derivatives."""
    inverse = 1 / x
    squared = inverse * inverse
    return inverse, -squared, 2 * squared * inverse


def _sum(a: arb_mat | None, b: arb_mat | None) -> arb_mat | None:
    """Return the sum where None is zero."""
    if a is None or b is None:
        return b if a is None else a
    return a + b
