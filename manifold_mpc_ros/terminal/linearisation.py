# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The linear-quadratic problem of a manifold problem at its equilibrium (paper section 3).

    f' = phi^-1 o f o (phi x psi),       [A, B] = df'(0, 0)
    L' = L o (phi x psi) / lambda,       [[Q, N], [N^T, R]] = Hess L'(0, 0)

so that ``L' = [xi, eta] Hess [xi, eta]^T / 2`` to second order. The derivatives are those of the
CasADi expressions, exact to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.problem import ManifoldProblem

# The equilibrium is one up to this, in the problem's units and relative to the Hessian of L.
_EQUILIBRIUM = 1e-9


@dataclass(frozen=True, eq=False)
class Linearisation:
    """A (n, n), B (n, m) of the dynamics, Q (n, n), R (m, m), N (n, m) of L / lambda.

    ``state_units``, ``control_units`` are the problem's, by which numerics are balanced;
    ``drift`` is the largest of ``|f'(0, 0)|``, ``|L'(0, 0)|`` and ``|grad L'(0, 0)|`` in them,
    the last two relative to the largest entry of the Hessian.
    """

    A: Array
    B: Array
    Q: Array
    R: Array
    N: Array
    state_units: Array
    control_units: Array
    drift: float

    def balanced(self) -> tuple[Array, Array, Array, Array, Array]:
        """Return A, B, Q, R, N in the problem's units: of order one for any size of system."""
        x, u = self.state_units, self.control_units
        return (self.A * x / x[:, None], self.B * u / x[:, None], self.Q * np.outer(x, x),
                self.R * np.outer(u, u), self.N * np.outer(x, u))

    def hessian(self) -> Array:
        """Return ``[[Q, N], [N^T, R]]`` (n + m, n + m) in the problem's units."""
        _, _, q, r, n = self.balanced()
        return np.block([[q, n], [n.T, r]])


def linearise(problem: ManifoldProblem) -> Linearisation:
    """Map a problem to its linearisation and Hessian at the equilibrium.

    Raises DesignError when a derivative does not exist there, ``f(x_e, u_e)`` is not x_e, or ``L``
    or its gradient is not zero (paper (3a), (3b): the equilibrium is the minimum of L).
    """
    n, m = problem.states.dimension, problem.controls.dimension
    z = ca.SX.sym('z', n + m)
    x, u = problem.states.point(z[:n]), problem.controls.point(z[n:])
    following = problem.states.coordinates(problem.step(x, u))
    cost = problem.stage_cost(x, u) / problem.terminal_scale
    hessian, gradient = ca.hessian(cost, z)
    values = ca.Function('linearisation', [z], [
        following, ca.jacobian(following, z), cost, gradient, hessian])(np.zeros(n + m))
    drift, jacobian, at_rest, slope, curvature = (np.array(value) for value in values)
    if not all(np.isfinite(value).all() for value in (drift, jacobian, slope, curvature)):
        raise DesignError(f'{problem.name}: f or L is not differentiable in the charts at the '
                          'equilibrium (a derivative is not finite)')
    curvature = (curvature + curvature.T) / 2
    units = np.concatenate([problem.state_units, problem.control_units])
    scale = float(np.abs(curvature * np.outer(units, units)).max()) or 1.0
    residuals = {
        'f(x_e, u_e) is not x_e': np.abs(drift[:, 0] / problem.state_units).max(),
        'L(x_e, u_e) is not 0': abs(at_rest.item()) / scale,
        'the gradient of L at (x_e, u_e) is not 0': np.abs(slope[:, 0] * units).max() / scale}
    for what, residual in residuals.items():
        if residual > _EQUILIBRIUM:
            raise DesignError(f'{problem.name}: the origin is not an equilibrium: {what} '
                              f"(off by {residual:.3g} in the problem's units)")
    return Linearisation(
        jacobian[:, :n], jacobian[:, n:], curvature[:n, :n], curvature[n:, n:],
        curvature[:n, n:], np.asarray(problem.state_units, dtype=float),
        np.asarray(problem.control_units, dtype=float), float(max(residuals.values())))
