# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The terminal cost and local law: the Riccati equation with cross term (paper section 3).

    P = A^T P A + Q - (A^T P B + N) (B^T P B + R)^-1 (A^T P B + N)^T
    K = -(B^T P B + R)^-1 (A^T P B + N)^T,       eta = K xi

The paper prints ``(B P B^T + R)^-1`` in both, which has another size than R unless m = n.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.existence import Existence, check_existence
from manifold_mpc_ros.terminal.linearisation import Linearisation

_NEWTON_STEPS = 2


@dataclass(frozen=True, eq=False)
class RiccatiSolution:
    """P (n, n), K (m, n) with ``eta = K xi``, and the figures that support them.

    ``residual`` is the equation's, relative to P; ``closed_loop_radius`` is the spectral radius
    of ``A + B K``.
    """

    P: Array
    K: Array
    residual: float
    closed_loop_radius: float
    existence: Existence


def solve_riccati(linear: Linearisation) -> RiccatiSolution:
    """Map a linearisation to its terminal cost and local law, solved in the problem's units.

    Raises DesignError naming the existence condition that fails, or when the solution found is not
    positive definite or not stabilising.
    """
    existence = check_existence(linear)
    a, b, q, r, n = linear.balanced()
    scale = float(np.abs(linear.hessian()).max())
    try:
        balanced = scale * _refined(a, b, q / scale, r / scale, n / scale)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise DesignError(f'the terminal Riccati equation has no stabilising solution: {error}'
                          ) from error
    values = np.linalg.eigvalsh((balanced + balanced.T) / 2)
    if not values[0] > 0:
        raise DesignError('the terminal Riccati solution P is not positive definite (smallest '
                          f'eigenvalue {values[0]:.3g} of {values[-1]:.3g})')
    p = balanced / np.outer(linear.state_units, linear.state_units)
    p = (p + p.T) / 2
    k = riccati_gain(linear, p)
    radius = float(np.abs(np.linalg.eigvals(linear.A + linear.B @ k)).max())
    if not radius < 1:
        raise DesignError('the terminal Riccati solution does not stabilise: the spectral radius '
                          f'of A + B K is {radius:.9g}')
    residual = float(np.abs(riccati_residual(linear, p)).max() / np.abs(p).max())
    return RiccatiSolution(p, k, residual, radius,
                           replace(existence, P_definiteness=float(values[0] / values[-1])))


def _refined(a: Array, b: Array, q: Array, r: Array, n: Array) -> Array:
    """Return P of the equation, as SciPy has it and then by Newton's method (Kleinman's).

    Each step solves the Lyapunov equation of the law before. What the ordered QZ loses where the
    closed loop is slow, poles near one, comes back: gains scale to 1e-9 (test_units.py).
    """
    p = solve_discrete_are(a, b, q, r, s=n)
    for _ in range(_NEWTON_STEPS):
        k = -np.linalg.solve(b.T @ p @ b + r, (a.T @ p @ b + n).T)
        closed = a + b @ k
        p = solve_discrete_lyapunov(closed.T, q + n @ k + k.T @ n.T + k.T @ r @ k)
        p = (p + p.T) / 2
    return np.asarray(p)


def riccati_gain(linear: Linearisation, p: Array) -> Array:
    """Return ``K = -(B^T P B + R)^-1 (A^T P B + N)^T`` (m, n)."""
    a, b = linear.A, linear.B
    return -np.asarray(np.linalg.solve(b.T @ p @ b + linear.R, (a.T @ p @ b + linear.N).T))


def riccati_residual(linear: Linearisation, p: Array) -> Array:
    """Return right side minus left side of the equation (n, n)."""
    cross = linear.A.T @ p @ linear.B + linear.N
    following = linear.A.T @ p @ linear.A + linear.Q + cross @ riccati_gain(linear, p)
    return np.asarray(following - p)
