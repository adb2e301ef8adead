# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Terminal cost, local law and terminal set of a manifold problem (paper section 3).

With ``f'`` and ``L'`` in the chart (:mod:`.linearisation`), P and K solve the Riccati equation
with cross term (:mod:`.riccati`); ``eta = K xi`` is the local law, ``F = xi^T P xi / 2`` the
terminal cost and ``X_T = {xi^T P xi <= c}`` the terminal set, c as large as the conditions of
paper eq. (8) allow (:mod:`.level`).
"""

from __future__ import annotations

from dataclasses import dataclass

from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.existence import Existence
from manifold_mpc_ros.terminal.level import LevelReport, largest_level
from manifold_mpc_ros.terminal.linearisation import linearise
from manifold_mpc_ros.terminal.problem import ManifoldProblem
from manifold_mpc_ros.terminal.riccati import solve_riccati


@dataclass(frozen=True, eq=False)
class TerminalDesign:
    """P (n, n), K (m, n) with ``eta = K xi``, c, and the figures that support them.

    ``report`` says what limits c and how the three conditions of paper eq. (8) were checked;
    ``riccati_residual`` is relative, ``closed_loop_radius`` the spectral radius of A + B K;
    N (n, m) is the cross term of the Hessian [[Q, N], [N^T, R]] of L / lambda, and ``existence``
    how far the conditions for P are from breaking.
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
    N: Array
    existence: Existence


def design_terminal(problem: ManifoldProblem) -> TerminalDesign:
    """Map a problem to its terminal design.

    Raises DesignError when the origin is not an equilibrium, the Riccati equation has no positive
    definite stabilising solution (the message names the condition that fails), or no level c > 0
    meets the conditions of paper eq. (8).
    """
    linear = linearise(problem)
    riccati = solve_riccati(linear)
    report = largest_level(problem, riccati.P, riccati.K)
    return TerminalDesign(
        linear.A, linear.B, linear.Q, linear.R, riccati.P, riccati.K, report.level,
        riccati.residual, riccati.closed_loop_radius, report, linear.N, riccati.existence)
