# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scalar coefficients of the maps on SO(3), accurate to rounding for every angle in their range.

Each is an even function of the angle. Where the closed form subtracts nearly equal numbers, or
divides 0 by 0, a power series takes its place, and the closed form is evaluated at a harmless
angle instead, so that no branch ever divides by zero.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial.polynomial import polyval

from manifold_mpc_ros.lie.arrays import Array

# Below this angle [rad] the series are used; seven and eight terms reach 1e-17 of the value.
SERIES_ANGLE = 0.5

_SINE_DEFECT = tuple((-1.0) ** k / math.factorial(2 * k + 3) for k in range(7))
# |B_2k| / (2k)! for k = 1 to 8, B the Bernoulli numbers.
_COTANGENT_DEFECT = (
    1 / 12, 1 / 720, 1 / 30240, 1 / 1209600, 1 / 47900160, 691 / 1307674368000,
    1 / 74724249600, 3617 / 10670622842880000,
)  # fmt: skip


def sinc(theta: Array) -> Array:
    """Return sin(theta)/theta, 1 at 0."""
    zero = theta == 0.0
    return np.where(zero, 1.0, np.sin(theta) / np.where(zero, 1.0, theta))


def sine_defect(theta: Array) -> Array:
    """Return (theta - sin theta)/theta^3, 1/6 at 0."""
    small = theta < SERIES_ANGLE
    series = polyval(np.where(small, theta, 0.0) ** 2, _SINE_DEFECT)
    safe = np.where(small, 1.0, theta)
    return np.where(small, series, (safe - np.sin(safe)) / safe**3)


def cotangent_defect(theta: Array) -> Array:
    """Return (1 - (theta/2) cot(theta/2))/theta^2, 1/12 at 0, for theta < 2 pi."""
    small = theta < SERIES_ANGLE
    series = polyval(np.where(small, theta, 0.0) ** 2, _COTANGENT_DEFECT)
    half = 0.5 * np.where(small, 1.0, theta)
    return np.where(small, series, (1.0 - half / np.tan(half)) / (4.0 * (half * half)))
