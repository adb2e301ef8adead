# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of single configuration values: each returns a clean value or raises."""

from __future__ import annotations

import difflib
import itertools
import numbers
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array

#: Maps the name and the value of a field to a clean value, or raises ConfigurationError.
Check = Callable[[str, Any], object]

#: Corners (8, 3) of the cube [-1, 1]^3.
CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
#: Relative tolerance on symmetry, and relative margin that 'positive definite' asks for.
SYMMETRY_TOLERANCE = 1e-9
DEFINITENESS_MARGIN = 1e-12
# Beyond this size, or its inverse, products of a few numbers are no numbers any more.
LARGEST = 1e60


def number(key: str, value: object, valid: str = 'a finite number') -> float:
    """Return ``value`` as a finite float; booleans and text are not numbers."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Real):
        raise ConfigurationError(key, value, valid)
    size: Any = abs(value)  # an integer may be too large for a float
    if not size <= LARGEST:  # no NaN either
        raise ConfigurationError(key, value, valid)
    return float(value)


def positive(key: str, value: object) -> float:
    """Return ``value`` as a finite float above zero."""
    result = _number_above(key, value, 0.0, strict=True)
    if result < 1.0 / LARGEST:
        raise ConfigurationError(key, value, 'a number above 0')
    return result


def non_negative(key: str, value: object) -> float:
    """Return ``value`` as a finite float that is zero or more."""
    return _number_above(key, value, 0.0, strict=False)


def fraction(key: str, value: object) -> float:
    """Return ``value`` as a float above 0 and below 1."""
    valid = 'a number above 0 and below 1'
    result = number(key, value, valid)
    if not 0.0 < result < 1.0:
        raise ConfigurationError(key, value, valid)
    return result


def integer(key: str, value: object, low: int) -> int:
    """Return ``value`` as an int that is at least ``low``."""
    valid = f'an integer of at least {low}'
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Integral):
        raise ConfigurationError(key, value, valid)
    if int(value) < low:
        raise ConfigurationError(key, value, valid)
    return int(value)


def boolean(key: str, value: object) -> bool:
    """Return ``value`` as a bool; 0, 1 and text are refused."""
    if not isinstance(value, (bool, np.bool_)):
        quoted = ' without quotes' if str(value) in ('true', 'false') else ''
        raise ConfigurationError(key, value, f'true or false{quoted}')
    return bool(value)


def choice(key: str, value: object, choices: Sequence[str]) -> str:
    """Return ``value`` when it is one of ``choices``."""
    if not isinstance(value, str) or value not in choices:
        raise ConfigurationError(key, value, 'one of ' + ', '.join(map(repr, choices)))
    return value


def nearest(given: object, known: Sequence[str]) -> str:
    """Return the known key that looks most like one that was given, as a whole or at its end."""
    def likeness(key: str) -> float:
        return max(difflib.SequenceMatcher(None, one, another).ratio() for one, another in (
            (str(given), key), (str(given).rpartition('.')[2], key.rpartition('.')[2])))

    return max(known, key=likeness)


def array(key: str, value: object, valid: str, *, infinite: bool = False) -> Array:
    """Return ``value`` as a new float array without NaN, and without inf unless allowed."""
    try:
        raw = np.asarray(value)
    except ValueError:
        raise ConfigurationError(key, value, valid) from None
    if raw.dtype.kind not in 'iuf':
        raise ConfigurationError(key, value, valid)
    result = raw.astype(np.float64)
    too_large = np.abs(result) > LARGEST
    if np.isnan(result).any() or (too_large & ~(infinite & np.isinf(result))).any():
        raise ConfigurationError(key, value, valid + ', all of them finite')
    return result


def vector(key: str, value: object, size: int = 3) -> Array:
    """Return ``value`` as a read-only vector of ``size`` finite numbers."""
    valid = f'{size} numbers'
    result = array(key, value, valid)
    if result.shape != (size,):
        raise ConfigurationError(key, value, valid)
    return frozen(result)


def limit(key: str, value: Any) -> Array | None:
    """Return a (3,) box of positive limits, or None when no axis is limited.

    A single number limits every axis; ``inf`` leaves its axis free; ``None`` leaves all free.
    """
    if value is None:
        return None
    valid = 'one positive number or three (.inf: no limit on that axis)'
    result = array(key, value, valid, infinite=True)
    if result.shape not in ((), (1,), (3,)) or not (result > 0.0).all():
        raise ConfigurationError(key, value, valid)
    box = np.array(np.broadcast_to(result, (3,)))
    return None if np.isinf(box).all() else frozen(box)


def bound(key: str, value: Any) -> float | None:
    """Return a positive limit, or None for None and ``inf``; a list of one number is that one."""
    given = value[0] if isinstance(value, (list, tuple)) and len(value) == 1 else value
    if given is None or (isinstance(given, float) and given == np.inf):
        return None
    return positive(key, given)


def ellipsoids(key: str, value: Any) -> Array | None:
    """Return E (n, 3, 3) of ellipsoids ``x^T E x <= 1``: one E (3 or 3x3) or several, or None."""
    if value is None:
        return None
    given = np.asarray(value)
    several = [symmetric(key, each) for each in (given if given.ndim == 3 else [value])]
    for each in several:
        values = np.linalg.eigvalsh(each)
        if values[0] <= DEFINITENESS_MARGIN * abs(values[-1]):
            raise ConfigurationError(key, value, 'a positive definite matrix (eigenvalues are '
                                     + _numbers(values) + ')')
    return frozen(np.array(several))


def symmetric(key: str, value: object) -> Array:
    """Return a symmetric 3x3 from 3 diagonal numbers, 9 in row order, or a 3x3."""
    valid = '3 numbers (the diagonal), 9 numbers (row by row) or a 3x3 matrix'
    given = array(key, value, valid)
    if given.shape == (3,):
        return frozen(np.diag(given))
    if given.shape not in ((9,), (3, 3)):
        raise ConfigurationError(key, value, valid)
    full = given.reshape(3, 3)
    if np.abs(full - full.T).max() > SYMMETRY_TOLERANCE * np.abs(full).max():
        raise ConfigurationError(key, value, 'a symmetric matrix (row order, 3x3)')
    return frozen((full + full.T) / 2.0)


def inertia(key: str, value: object) -> Array:
    """Return the inertia tensor J [kg m^2] of a body that can exist, as a symmetric 3x3.

    Its principal moments are positive and obey ``J_1 + J_2 > J_3`` strictly, which says that the
    nonstandard inertia ``J_d = tr(J)/2 I - J`` is positive definite.
    """
    tensor = symmetric(key, value)
    moments = np.linalg.eigvalsh(tensor)
    if moments[0] <= DEFINITENESS_MARGIN * abs(moments[-1]):
        raise ConfigurationError(
            key, value, 'positive principal moments of inertia (these are '
            + _numbers(moments) + ')')
    if moments[0] + moments[1] - moments[2] <= DEFINITENESS_MARGIN * moments[2]:
        raise ConfigurationError(
            key, value, 'principal moments of inertia with J_1 + J_2 > J_3 (these are '
            + _numbers(moments) + ')')
    return tensor


def trace_weight(key: str, value: object, *, definite: bool) -> Array:
    """Return a weight Q of a trace cost ``tr(Q (I - g))`` as a symmetric 3x3.

    The cost is positive away from the identity exactly when ``tr(Q) I - Q`` is positive definite;
    Q itself has to be positive semidefinite, or positive definite when ``definite``.
    """
    weight = symmetric(key, value)
    values = np.linalg.eigvalsh(weight)
    margin = DEFINITENESS_MARGIN * max(abs(values[0]), abs(values[-1]))
    if definite and values[0] <= margin:
        raise ConfigurationError(
            key, value, 'a positive definite matrix (eigenvalues are ' + _numbers(values) + ')')
    if values[0] < -margin:
        raise ConfigurationError(
            key, value, 'a positive semidefinite matrix (eigenvalues are '
            + _numbers(values) + ')')
    if values[0] + values[1] <= margin:
        raise ConfigurationError(
            key, value, 'a matrix Q with tr(Q) I - Q positive definite (eigenvalues of Q are '
            + _numbers(values) + ')')
    return weight


def unit_quaternion(key: str, value: object) -> Array:
    """Return ``value`` as a unit quaternion in the order given; the norm may be off by 1e-2."""
    given = vector(key, value, 4)
    norm = float(np.linalg.norm(given))
    if abs(norm - 1.0) > 1e-2:
        raise ConfigurationError(key, value, f'a unit quaternion x, y, z, w (norm is {norm:.6g})')
    return frozen(given / norm)


def direction(key: str, value: object) -> Array:
    """Return ``value``, three numbers that are not all zero, as a unit vector."""
    given = vector(key, value)
    norm = float(np.linalg.norm(given))
    if not 1e-9 < norm < 1e9:
        raise ConfigurationError(key, value, 'a direction: 3 numbers, not all zero')
    return frozen(given / norm)


def fields(config: object, table: Mapping[str, Check]) -> None:
    """Put clean values into fields of a frozen configuration that is being built."""
    for name, check in table.items():
        object.__setattr__(config, name, check(name, getattr(config, name)))


def frozen(values: Array) -> Array:
    """Return ``values`` after making them read-only."""
    values.setflags(write=False)
    return values


def _number_above(key: str, value: object, low: float, *, strict: bool) -> float:
    """Return ``value`` as a finite float above (or at) ``low``."""
    valid = f'a finite number {"above" if strict else "of at least"} {low:g}'
    result = number(key, value, valid)
    if result < low or (strict and result == low):
        raise ConfigurationError(key, value, valid)
    return result


def _numbers(values: npt.NDArray[Any]) -> str:
    """Return ``values`` as short text."""
    return ', '.join(f'{value:.6g}' for value in values)


def each_positive(key: str, value: object, n: int, *, infinite: bool = False) -> Array:
    """Return (n,) positive numbers from as many, or from one."""
    valid = f'one positive number, or {n}'
    given = array(key, value, valid, infinite=infinite)
    if given.shape not in ((), (1,), (n,)) or not (given > 0.0).all():
        raise ConfigurationError(key, value, valid)
    return frozen(np.array(np.broadcast_to(given, (n,))))
