# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the terminal Riccati equation needs to have a positive definite stabilising solution.

Paper section 3: P > 0 exists if (A, B) is stabilisable and the symplectic pencil has no
eigenvalue on the unit circle, for which Hess L' > 0 suffices. Each condition is checked in the
problem's units and has its own error, which names the mode or direction that breaks it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eig

from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.linearisation import Linearisation

# Modes of A with a modulus above 1 less this count as not stable; an eigenvalue of the pencil
# this near to the unit circle as on it (a double one is found to the root of rounding).
_CIRCLE = 1e-6
# An eigenvalue of the Hessian below this part of the largest counts as zero.
_ZERO = 1e-13


@dataclass(frozen=True)
class Existence:
    """How far each existence condition is from breaking, in the problem's units.

    ``unstable_modes`` is the number of eigenvalues of A on or outside the unit circle and
    ``reachability`` the smallest singular value of ``[A - mu I, B]`` over them (PBH test, inf
    when there is none); ``pencil_distance`` is the least ``||z| - 1|`` of the symplectic pencil;
    ``hessian_definiteness`` and ``P_definiteness`` are smallest over largest eigenvalue;
    ``equilibrium`` the residual of the equilibrium.
    """

    equilibrium: float
    unstable_modes: int
    reachability: float
    pencil_distance: float
    hessian_definiteness: float
    P_definiteness: float = float('nan')


def check_existence(linear: Linearisation) -> Existence:
    """Map a linearisation to its margins.

    Raises DesignError when (A, B) is not stabilisable, when the symplectic pencil has an
    eigenvalue on the unit circle, or when ``[[Q, N], [N^T, R]]`` is not positive definite on all
    (xi, eta).
    """
    modes, reachability = _check_stabilisable(linear)
    definiteness = _definiteness(linear)
    if definiteness < -_ZERO:
        raise _not_definite(linear)
    distance = _check_pencil(linear)
    if not definiteness > _ZERO:
        raise _not_definite(linear)
    return Existence(linear.drift, modes, reachability, distance, definiteness)


def symplectic_pencil(linear: Linearisation) -> tuple[Array, Array]:
    """Return M, L (2 n + m, 2 n + m) of the pencil ``M - z L`` in the problem's units.

    The optimality conditions ``x+ = A x + B u``, ``p = Q x + N u + A^T p+``,
    ``0 = N^T x + R u + B^T p+`` are ``L v+ = M v`` for v = (x, p, u).
    """
    a, b, q, r, n = linear.balanced()
    (states, controls), scale = b.shape, np.abs(linear.hessian()).max()
    q, r, n = q / scale, r / scale, n / scale
    eye, wide = np.eye(states), np.zeros((states, controls))
    zero, corner = np.zeros_like(a), np.zeros((controls, controls))
    return (np.block([[a, zero, b], [q, -eye, n], [n.T, wide.T, r]]),
            np.block([[eye, zero, wide], [zero, -a.T, wide], [wide.T, -b.T, corner]]))


def _check_stabilisable(linear: Linearisation) -> tuple[int, float]:
    """Return the number of modes that are not stable and how well the inputs reach them."""
    a, b, *_ = linear.balanced()
    size = max(np.linalg.norm(a, 2), np.linalg.norm(b, 2))
    modes = [mu for mu in np.linalg.eigvals(a) if abs(mu) > 1 - _CIRCLE]
    least = float('inf')
    for mu in modes:
        left, singular, _ = np.linalg.svd(np.hstack([a - mu * np.eye(len(a)), b]))
        least = min(least, float(singular[-1]))
        # Repeated modes are found to the root of rounding only.
        if singular[-1] < 1e-7 * size:
            raise DesignError(
                f'(A, B) is not stabilisable: no input reaches the mode with eigenvalue '
                f'{_number(mu)} along xi = {_direction(left[:, -1])} (PBH test: smallest '
                f'singular value of [A - mu I, B] {singular[-1]:.2g})')
    return len(modes), least


def _check_pencil(linear: Linearisation) -> float:
    """Return the least distance of the pencil's eigenvalues from the unit circle."""
    pairs, vectors = eig(*symplectic_pencil(linear), homogeneous_eigvals=True)
    alpha, beta = np.abs(pairs)
    distance = np.abs(alpha - beta) / np.maximum(beta, 1e-300)
    at = int(np.argmin(distance))
    if not distance[at] > _CIRCLE:
        n = len(linear.A)
        raise DesignError(
            'the Riccati equation has no stabilising solution: the symplectic pencil has an '
            f'eigenvalue on the unit circle, {_number(pairs[0, at] / pairs[1, at])} '
            f'(distance {distance[at]:.2g}), along xi = {_direction(vectors[:n, at])}; '
            'L must see every mode of A of modulus one, and a free direction (one that L does '
            'not see at all) must not be part of the state')
    return float(distance[at])


def _definiteness(linear: Linearisation) -> float:
    """Return smallest over largest eigenvalue of the Hessian of L'.

    The whole Hessian, on all (xi, eta), in the chart of M: paper (3b) asks L > 0 for each state
    but x_e. A problem with a free direction satisfies it on the manifold with that direction
    divided out, as pointing does on S^2 with the roll gone, and on no other.
    """
    values = np.linalg.eigvalsh(linear.hessian())
    return float(values[0] / max(abs(values[0]), abs(values[-1]), 1e-300))


def _not_definite(linear: Linearisation) -> DesignError:
    """Return the error that names the direction in which the Hessian is not positive."""
    n = len(linear.A)
    values, vectors = np.linalg.eigh(linear.hessian())
    worst = _turned(vectors[:, 0])
    along = f'along xi = {_text(worst[:n])}, eta = {_text(worst[n:])}'
    if values[0] > 0:
        return DesignError(
            'the weights are out of proportion: in units that suit the problem the Hessian of L '
            f'at the equilibrium has eigenvalues from {values[0]:.3g} to {values[-1]:.3g}, more '
            f'apart than rounding allows; what weighs too little is {along}')
    return DesignError(
        'the Hessian [[Q, N], [N^T, R]] of L at the equilibrium is not positive definite: '
        f'its smallest eigenvalue is {values[0]:.3g} (the largest is {values[-1]:.3g}), '
        f'{along}; the Riccati equation needs a stage cost that weighs every state and every '
        'input')


def _number(value: complex) -> str:
    """Return a number as text, real when it is."""
    real = abs(value.imag) < 1e-9 * max(abs(value), 1.0)
    return f'{value.real:.6g}' if real else f'{value.real:.6g}{value.imag:+.6g}j'


def _turned(vector: Array) -> Array:
    """Return a (complex) direction with its largest entry real and positive, real parts only."""
    largest = vector[int(np.argmax(np.round(np.abs(vector), 9)))]
    return np.asarray(np.real(vector * np.conj(largest) / max(abs(largest), 1e-300)))


def _text(vector: Array) -> str:
    """Return a vector as text."""
    return '(' + ', '.join(f'{value:.3g}' for value in np.round(vector, 6) + 0.0) + ')'


def _direction(vector: Array) -> str:
    """Return a (complex) direction as text."""
    return _text(_turned(vector))
