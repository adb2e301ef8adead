# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's route through the implicit LGVI equation: an algebraic Riccati equation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, schur

from manifold_mpc_ros.errors import StepExistenceError
from manifold_mpc_ros.lie.so3 import hat


def solve_riccati(m: NDArray[np.float64], J_d: NDArray[np.float64]) -> NDArray[np.float64]:
    """Map m = h Pi (3,) and J_d (3, 3) to f (3, 3) with f J_d - J_d f^T = m^x.

    f = (M/2 + S) J_d^-1, where M = m^x and S = sym(f J_d) is the stabilising solution of
    -(M/2)^T S - S M/2 - S^2 + (J_d^2 + M^2/4) = 0 (closed loop -M/2 - S = -f J_d), read from
    the stable invariant subspace [U1; U2] of the Hamiltonian matrix: S = U2 U1^-1.

    The printed condition J_d^2 + M^2/4 >= 0 is sufficient only: the stable subspace exists as
    long as det(s^2 I + s M - J_d^2) has no imaginary root, which holds beyond it.

    Raises StepExistenceError when there is no three-dimensional stable subspace, as for a flat
    body (J_d singular); the Cayley route has no such limit.
    """
    half = 0.5 * hat(m)
    hamiltonian = np.block([[-half, -np.eye(3)], [-(J_d @ J_d + half @ half), -half]])
    try:
        _, basis, stable = schur(hamiltonian, sort='lhp')
    except LinAlgError as error:
        raise StepExistenceError('the Schur form of the Riccati route failed') from error
    if stable != 3:
        raise StepExistenceError(
            f'the Riccati route found {stable} stable directions instead of 3: J_d must be '
            'positive definite (no flat body)'
        )
    S = np.linalg.solve(basis[:3, :3].T, basis[3:, :3].T).T
    return np.asarray(np.linalg.solve(J_d.T, (half + 0.5 * (S + S.T)).T).T)
