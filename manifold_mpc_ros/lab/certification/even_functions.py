# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rigorous enclosures of the coefficient functions of rotations, removable singularities included.

    S(s) = sin(t/2)/t,  s = t^2           = 0F1(3/2; -s/16)/2
    C(s) = cos(t/2)                       = 0F1(1/2; -s/16)
    g(w) = 2 acos(w)/sqrt(1 - w^2)        = 2 2F1(1, 1; 3/2; (1-w)/2)
    a(q) = 2 atan(sqrt q)/sqrt q          = 2 2F1(1/2, 1; 3/2; -q)

so ``exp(hat x)`` is the quaternion ``(C, S x)``, the logarithm of ``(w, v)`` is ``g(w) v``
and that of ``cay(c)`` is ``a(|c|^2) c``. With w below zero g goes on past 180 degrees: the
logarithm is continued, not wrapped.

Each of S, C, g and its first two derivatives is monotone, so the values at the two ends of the
argument enclose it: d/dz 0F1(b; z) = 0F1(b+1; z)/b, and 0F1(b; -y^2/4) is positive up to the first
zero of the Bessel function J_{b-1}(y), so all are monotone for t/2 below the first zero of
J_{1/2}, pi (the least of those met, for C'). The coefficients of 2F1(1, 1; 3/2; z) are
positive, so g decreases in w and so do all its derivatives in absolute value, for w > -1. And
``a(q) = int_0^1 2 / (1 + q u^2) du``, whose derivatives alternate in sign and fall in size.
The ends are evaluated by Arb's hypergeometric functions, which know no singularity there.
"""

from __future__ import annotations

from collections.abc import Callable

from flint import arb

from manifold_mpc_ros.lab.certification.jets import Jet, between

_HALF = arb(1) / 2


def half_sine(s: Jet) -> Jet:
    """Map s = t^2 to ``sin(t/2)/t``."""
    low, high = _ends(s.value)
    return s.compose(
        *(between(_bessel(low, b, k), _bessel(high, b, k))
          for b, k in ((3 * _HALF, _HALF), (5 * _HALF, -_HALF / 24), (7 * _HALF, _HALF / 960))))


def half_cosine(s: Jet) -> Jet:
    """Map s = t^2 to ``cos(t/2)``."""
    low, high = _ends(s.value)
    return s.compose(
        *(between(_bessel(low, b, k), _bessel(high, b, k))
          for b, k in ((_HALF, arb(1)), (3 * _HALF, -_HALF / 4), (5 * _HALF, _HALF / 96))))


def angle_over_sine(w: Jet) -> Jet:
    """Map w = cos(t/2) to ``t / sin(t/2)``, for w > -1; a w beyond 1 is read as 1."""
    low, high = w.value.lower(), w.value.upper()
    high = high if high < 1 else arb(1)
    low = low if low < 1 else arb(1)
    if not low > -1:
        return w.compose(arb.nan(), arb.nan(), arb.nan())
    z_low, z_high = (1 - low) / 2, (1 - high) / 2
    return w.compose(
        *(between(k * z_low.hypgeom_2f1(a, a, b), k * z_high.hypgeom_2f1(a, a, b))
          for a, b, k in ((1, 3 * _HALF, arb(2)), (2, 5 * _HALF, arb(-2) / 3),
                          (3, 7 * _HALF, arb(8) / 15))))


def inverse_root(q: Jet) -> Jet:
    """Map q > -1 to ``1 / sqrt(1 + q)``."""
    return _monotone(q, lambda x: (1 + x).rsqrt(), lambda x: -(1 + x).rsqrt() / (1 + x) / 2,
                     lambda x: (1 + x).rsqrt() / ((1 + x) * (1 + x)) * 3 / 4)


def double_arctangent(q: Jet) -> Jet:
    """Map q = |c|^2 >= 0 to ``2 atan(sqrt q) / sqrt q``: ``Log cay(c)`` is it times c."""
    low, high = q.value.lower(), q.value.upper()
    low = low if low > 0 else arb(0)

    rows = ((_HALF, 1, arb(2)), (3 * _HALF, 2, arb(-2) / 3), (5 * _HALF, 3, arb(4) / 5))
    return q.compose(*(between(*(k * (-end).hypgeom_2f1(a, b, b + _HALF) for end in (low, high)))
                       for a, b, k in rows))


def root_of_half(u: Jet) -> Jet:
    """Map u in (-1, 1] to ``sqrt((1 + u)/2)``, the cosine of half the angle of cosine u."""
    return _monotone(u, lambda x: ((1 + x) / 2).sqrt(), lambda x: ((1 + x) * 2).rsqrt() / 2,
                     lambda x: -((1 + x) * 2).rsqrt() / (1 + x) / 4)


def _monotone(x: Jet, *functions: Callable[[arb], arb]) -> Jet:
    """Compose with a function and its two derivatives, each monotone."""
    low, high = x.value.lower(), x.value.upper()
    return x.compose(*(between(function(low), function(high)) for function in functions))


def _ends(s: arb) -> tuple[arb, arb]:
    """Return the ends of a range of t^2 >= 0; NaN above where monotonicity is not known."""
    low, high = s.lower(), s.upper()
    low = low if low > 0 else arb(0)
    return (low, high) if high < 4 * arb.pi() ** 2 else (arb.nan(), arb.nan())


def _bessel(s: arb, b: arb, factor: arb) -> arb:
    """Return ``factor 0F1(b; -s/16)`` at one point."""
    return factor * (-s / 16).hypgeom_0f1(b)
