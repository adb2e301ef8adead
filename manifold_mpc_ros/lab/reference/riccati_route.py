# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's route through the implicit LGVI equation: an algebraic Riccati equation."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import schur

from manifold_mpc_ros.dynamics.inertia import nonstandard_inertia, principal_moments
from manifold_mpc_ros.dynamics.lgvi import cayley_step
from manifold_mpc_ros.errors import StepExistenceError
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.lie.so3 import hat

# The route divides by J_d: its smallest eigenvalue must be above this part of the trace.
FLAT_BODY = 1e-6


def solve_riccati(m: Array, J: Array) -> Array:
    """Map m = h Pi (3,) and J (3, 3) to f (3, 3) with f J_d - J_d f^T = m^x.

    f = (M/2 + S) J_d^-1, where M = m^x and S is the stabilising solution of
    -(M/2)^T S - S M/2 - S^2 + (J_d^2 + M^2/4) = 0, so that the closed loop -M/2 - S = -f J_d is
    stable. S = U2 U1^-1 for the stable invariant subspace [U1; U2] of the Hamiltonian matrix.

    Two departures from the paper. The condition J_d^2 + M^2/4 >= 0 printed there is sufficient
    only: the subspace exists while det(s^2 I + s M - J_d^2) has no imaginary root, which is
    more. And S need not be positive definite: on the branch of small steps it is
    J_d^(1/2) f J_d^(1/2) that has a positive definite symmetric part, not S = sym(f J_d).

    The equation is solved for m and J_d divided by tr(J_d), so units do not matter. The error
    is about 1e-15 tr(J_d) / lambda_min(J_d) (test_lgvi_implicit.py).

    Raises StepExistenceError for a flat body (J_d singular) or an impossible one (J_d
    indefinite), where the route does not exist; the Cayley route has no such limit.
    """
    J_d = nonstandard_inertia(J)
    scale = np.trace(J_d)
    smallest = principal_moments(J_d)[0]
    if smallest <= FLAT_BODY * scale:
        raise StepExistenceError(
            f'the Riccati route needs a positive definite J_d = tr(J)/2 I - J (no flat body); '
            f'its smallest eigenvalue is {smallest:.6g} kg m^2'
        )
    J_d, half = J_d / scale, 0.5 / scale * hat(m)
    hamiltonian = np.block([[-half, -np.eye(3)], [-(J_d @ J_d + half @ half), -half]])
    _, basis, stable = schur(hamiltonian, sort='lhp')
    if stable != 3:
        raise StepExistenceError(
            f'the Riccati route found {stable} stable directions instead of 3: the momentum is '
            'too close to the existence bound'
        )
    S = np.linalg.solve(basis[:3, :3].T, basis[3:, :3].T)
    f_T = np.linalg.solve(J_d, 0.5 * (S + S.T) - half)
    return f_T.T


def riccati_step(m: ArrayLike, J: ArrayLike) -> Array:
    """Map m = h Pi (..., 3) to f (..., 3, 3) by `solve_riccati`.

    It takes one Schur form an item, so batches are slow. Agrees with `cayley_step` to 1e-12 up to
    0.99 of the bound (test_lgvi_implicit.py).

    Raises StepExistenceError like `cayley_step`, and for a flat body (J_d singular).
    """
    m = np.asarray(m, dtype=np.float64)
    J = np.asarray(J, dtype=np.float64)
    cayley_step(m, J)  # raises where a step need not exist
    shape = np.broadcast_shapes(m.shape[:-1], J.shape[:-2])
    momenta = np.broadcast_to(m, (*shape, 3)).reshape(-1, 3)
    inertias = np.broadcast_to(J, (*shape, 3, 3)).reshape(-1, 3, 3)
    steps = [solve_riccati(*one) for one in zip(momenta, inertias, strict=True)]
    return np.reshape(steps, (*shape, 3, 3))
