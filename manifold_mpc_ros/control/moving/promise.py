# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a plan about a target that moves promises for the next tick, checked at each tick.

The next tick may follow the plan, shifted, and then the local law for one step, from the last
node's error xi_N to xi_{N+1} about the reference there. As long as the limits and the next
terminal set let it, that bounds the next value (docs/theory.md, section 16):

    V+ <= V - L + max(0, e),    e = F(xi_{N+1}) + L(xi_N, K xi_N) - F(xi_N).

e is not positive for a target that is fixed. A target that moves need not be a motion of the
model: by how much it is none is what e says.
"""

from __future__ import annotations

from typing import cast

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.decrease_record import Allowance
from manifold_mpc_ros.dynamics.lgvi import Forcing, lgvi_step, step_rotation
from manifold_mpc_ros.errors import StepExistenceError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.reference import LEAST_SHARE, Reference, used_by
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution
from manifold_mpc_ros.terminal.design import TerminalDesign
from manifold_mpc_ros.terminal.rigid_body import trace_hessian

_TOO_FAST = 'the target needs more than the limits give'
_LEAVES = 'the target leaves the local law no room at the end of the horizon'


class MovingPromise:
    """Judges what plans of a control law (attitude, P, K, c) may promise about moving targets."""

    def __init__(self, config: AttitudeMpcConfig, terminal: TerminalDesign) -> None:
        """Keep the terminal design."""
        self._config, self._terminal = config, terminal
        self._effort = trace_hessian(config.torque_weight)

    def allowance(self, solution: AttitudeMpcSolution, end: Reference, disturbance_B_n_m: Array
                  ) -> Allowance:
        """Return what the promise of a plan allows for; ``end`` are nodes N and N + 1."""
        if solution.limits_used > 1.0 - LEAST_SHARE:
            return Allowance(why_none=_TOO_FAST)
        try:
            return self._allowance(solution, end, disturbance_B_n_m)
        except StepExistenceError:
            return Allowance(why_none=_LEAVES)

    def _allowance(self, solution: AttitudeMpcSolution, end: Reference, disturbance_B_n_m: Array
                   ) -> Allowance:
        """Return it where every step exists."""
        config, design = self._config, self._terminal
        R_NB, omega = solution.R_NB[-1], solution.omega_BN_B[-1]
        xi, cost = self._error(R_NB, omega, end, 0)
        torque_D, used = used_by(end, config, disturbance_B_n_m)
        eta = design.K @ xi
        R_NB, omega = self._step(R_NB, omega, torque_D + eta)
        after, _ = self._error(R_NB, omega, end, 1)
        left = 1.0 - (max(used, solution.limits_used) if end.omega_DN_D.any() else used)
        if left < LEAST_SHARE or after @ design.P @ after > left ** 2 * design.c:
            return Allowance(why_none=_LEAVES)
        cost += float(eta @ self._effort @ eta) / 2.0
        excess = float(after @ design.P @ after - xi @ design.P @ xi) / 2.0 + cost
        return Allowance(max(0.0, excess), self._model_error(solution, disturbance_B_n_m))

    def _error(self, R_NB: Array, omega: Array, end: Reference, node: int) -> tuple[Array, float]:
        """Return xi (6,) of a state about a node, and the state's part of L."""
        config = self._config
        h = config.step_s
        g = end.R_ND[node].T @ R_NB
        f = so3.exp(h * end.omega_DN_D[node]).T @ step_rotation(omega, config.inertia_kg_m2, h)
        cost = (np.sum(config.attitude_weight * (np.eye(3) - g))
                + np.sum(config.rate_weight * (np.eye(3) - f)) / h ** 2)
        return np.concatenate([so3.log(g), so3.log(f) / h]), float(cost)

    def _step(self, R_NB: Array, omega: Array, torque: Array) -> tuple[Array, Array]:
        """Return the state after a step of the model."""
        config = self._config
        return lgvi_step(R_NB, omega, torque, inertia_kg_m2=config.inertia_kg_m2,
                         step_s=config.step_s, forcing=cast('Forcing', config.forcing))

    def _model_error(self, solution: AttitudeMpcSolution, disturbance_B_n_m: Array) -> float:
        """Return F of the error of the model's first step against a rigid body in continuous time.

        By step doubling: two half steps have a quarter of the error of a whole one.
        """
        torque = solution.torque_B_n_m + disturbance_B_n_m
        R_NB, omega = solution.R_NB[0], solution.omega_BN_B[0]
        R_1, omega_1 = self._step(R_NB, omega, torque)
        for _ in range(2):
            R_NB, omega = lgvi_step(R_NB, omega, torque, step_s=self._config.step_s / 2.0,
                                    inertia_kg_m2=self._config.inertia_kg_m2)
        error = np.concatenate([so3.log(R_1.T @ R_NB), omega - omega_1]) * 4.0 / 3.0
        return float(error @ self._terminal.P @ error) / 2.0


def moving_promise_for(config: AttitudeMpcConfig, terminal: TerminalDesign
                       ) -> MovingPromise | None:
    """Return what judges plans of a control law, None for pointing, whose chart is another."""
    return MovingPromise(config, terminal) if config.target == 'attitude' else None
