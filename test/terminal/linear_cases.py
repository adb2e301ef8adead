# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Linear-quadratic problems on R^n, given by their matrices."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from strategies import generator

from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.linearisation import Linearisation
from manifold_mpc_ros.terminal.manifold import Euclidean
from manifold_mpc_ros.terminal.problem import ManifoldProblem


def linear_problem(A: Array, B: Array, hessian: Array, **changes: Any) -> ManifoldProblem:
    """Return x+ = A x + B u at the stage cost ``[x, u]^T H [x, u] / 2``, lambda = 0.5."""
    n, m = np.shape(B)
    values: dict[str, Any] = {
        'name': 'linear', 'states': Euclidean(n), 'controls': Euclidean(m),
        'step': lambda x, u: ca.DM(A) @ x + ca.DM(B) @ u,
        'stage_cost': lambda x, u: ca.bilin(ca.DM(hessian), ca.vertcat(x, u)) / 2,
        'terminal_scale': 0.5, 'state_units': np.ones(n), 'control_units': np.ones(m)}
    return ManifoldProblem(**{**values, **changes})


def linearisation(A: Array, B: Array, hessian: Array) -> Linearisation:
    """Return the linear-quadratic problem with these matrices as its linearisation."""
    n, m = np.shape(B)
    A, B, H = (np.asarray(matrix, dtype=float) for matrix in (A, B, hessian))
    return Linearisation(A, B, H[:n, :n], H[n:, n:], H[:n, n:], np.ones(n), np.ones(m), 0.0)


def random_cases(count: int) -> list[tuple[Array, Array, Array]]:
    """Return A (n, n), B (n, m) and definite Hessians whose cross term is not small.

    Spectral radii of A are between 0.8 and 1.6, so that some are unstable.
    """
    cases = []
    for index in range(count):
        rng = generator('linear', index)
        n, m = int(rng.integers(1, 7)), int(rng.integers(1, 4))
        A, B = rng.standard_normal((n, n)), rng.standard_normal((n, m))
        A *= rng.uniform(0.8, 1.6) / np.abs(np.linalg.eigvals(A)).max()
        root = rng.standard_normal((n + m, n + m))
        cases.append((A, B, root @ root.T + 0.05 * np.eye(n + m)))
    return cases
