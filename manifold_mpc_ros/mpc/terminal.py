# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Terminal cost, local law and terminal set of the attitude controller (paper section 3 and 5).

Chart ``xi = (Log g, Log f / h)`` in R^6. With L' = L / lambda and the Hessians
``tr(Q) I - Q`` of the trace costs, P solves (corrected, see docs/theory.md)

    P = A^T P A + Q - (A^T P B + N) (B^T P B + R)^-1 (A^T P B + N)^T,

``tau = K xi`` is the local law, ``F = xi^T P xi / 2`` the terminal cost and
``X_T = {xi^T P xi <= c}`` the terminal set.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are

from manifold_mpc_ros.config import AttitudeMpcConfig
from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.mpc.scaling import Array
from manifold_mpc_ros.mpc.terminal_level import LevelReport, largest_level


@dataclass(frozen=True)
class TerminalDesign:
    """P (6, 6), K (3, 6) with ``tau = K xi``, c, and the figures that support them.

    ``report`` says what limits c and how the three conditions of paper eq. (8) were checked;
    ``riccati_residual`` is relative, ``closed_loop_radius`` the spectral radius of A + B K.
    """

    A: Array
    B: Array
    Q: Array
    R: Array
    P: Array
    K: Array
    c: float
    riccati_residual: float
    closed_loop_radius: float
    report: LevelReport


def linearisation(config: AttitudeMpcConfig) -> tuple[Array, Array]:
    """Return A (6, 6) and B (6, 3) of the LGVI in the chart at rest at the identity.

    ``B = [0; h J^-1]`` for the paper's forcing (J the true inertia), ``[h^2/2 J^-1; h J^-1]``
    for the symmetric one; test_terminal.py compares both with the derivative of the step.
    """
    h, inverse = config.step_s, np.linalg.inv(config.inertia_kg_m2)
    eye, zero = np.eye(3), np.zeros((3, 3))
    top = h * h / 2 * inverse if config.forcing == 'symmetric' else zero
    return np.block([[eye, h * eye], [zero, eye]]), np.vstack([top, h * inverse])


def trace_hessian(weight: Array) -> Array:
    """Map Q (3, 3) to ``tr(Q) I - Q``, the Hessian of ``tr(Q (I - exp(hat x)))`` at zero."""
    return np.trace(weight) * np.eye(3) - weight


def stage_hessian(config: AttitudeMpcConfig) -> tuple[Array, Array]:
    """Return Q (6, 6) and R (3, 3), the Hessian of L' = L / lambda at the equilibrium (N = 0)."""
    zero = np.zeros((3, 3))
    state = np.block([[trace_hessian(config.attitude_weight), zero],
                      [zero, trace_hessian(config.rate_weight)]])
    return (state / config.terminal_scale,
            trace_hessian(config.torque_weight) / config.terminal_scale)


def design_terminal(config: AttitudeMpcConfig) -> TerminalDesign:
    """Map a configuration to its terminal design.

    Raises
    ------
    DesignError
        When the Riccati equation has no positive definite stabilising solution, or no level
        c > 0 meets the conditions of paper eq. (8).

    """
    a, b = linearisation(config)
    q, r = stage_hessian(config)
    # Balanced units (h, tr(J)/3) keep the Riccati solver accurate for any spacecraft.
    units = np.diag([1.0] * 3 + [1 / config.step_s] * 3)
    torque = np.trace(config.inertia_kg_m2) / 3 / config.step_s ** 2
    inverse = np.linalg.inv(units)
    try:
        balanced = solve_discrete_are(inverse @ a @ units, inverse @ b * torque,
                                      units @ q @ units, r * torque ** 2)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise DesignError(f'the terminal Riccati equation has no stabilising solution: {error}'
                          ) from error
    p = inverse @ balanced @ inverse
    p = (p + p.T) / 2
    if np.linalg.eigvalsh(balanced)[0] <= 0:
        raise DesignError('the terminal Riccati solution P is not positive definite; '
                          'attitude_weight must weigh every axis')
    gain_matrix = b.T @ p @ b + r
    k = -np.linalg.solve(gain_matrix, b.T @ p @ a)
    residual = a.T @ p @ a - p + q - (a.T @ p @ b) @ np.linalg.solve(gain_matrix, b.T @ p @ a)
    report = largest_level(config, p, k)
    return TerminalDesign(
        a, b, q, r, p, k, report.level, float(np.abs(residual).max() / np.abs(p).max()),
        float(np.abs(np.linalg.eigvals(a + b @ k)).max()), report)
