# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a solve returns: a plan and how far it can be trusted."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.lie.arrays import Array


class SolveStatus(str, Enum):
    """How a solve ended.

    CONVERGED: the optimality conditions hold. FEASIBLE: every limit holds, the budget ran out
    or no better plan than the kept one was found. INFEASIBLE: no plan meets the state limits
    and the terminal set, or none did when the budget ran out; the plan violates them as little
    as an exact penalty says, and keeps the torque limits. FAILED: the state cannot be predicted
    from; the torque is zero.
    """

    CONVERGED = 'converged'
    FEASIBLE = 'feasible'
    INFEASIBLE = 'infeasible'
    FAILED = 'failed'

    def __str__(self) -> str:
        """Return the bare word."""
        return self.value


class AttitudeMpcSolution(NamedTuple):
    """The plan of one solve, SI units, body torques and rates.

    ``cost`` is the value of the plan; ``kkt_residual`` is dimensionless; ``violation`` is the
    largest relative violation of a state limit or of the terminal set (0 when none);
    ``searched`` says whether the global search ran. ``promised_cost`` is ``V - L(x0, u0)``, the
    bound that the theory puts on the next tick's cost; ``terminal_ratio`` is ``xi^T P xi / c`` of
    the measured state, at most 1 inside the terminal set. ``solve_time_s`` is the whole call,
    ``local_time_s`` the part of it that the local solver took, without the Python around it.
    ``wheel_torque_n_m`` (n,) are the motor torques of the first step, where momenta were given.
    ``target_momentum`` is what wheels have to store at rest at the target, in parts of what they
    can: above 1 they cannot hold it.
    ``limits_used`` is the largest part of a torque or rate limit that reference and disturbance
    use over the horizon.
    """

    torque_B_n_m: Array
    torques_B_n_m: Array
    R_NB: Array
    omega_BN_B: Array
    cost: float
    iterations: int
    solve_time_s: float
    status: SolveStatus
    kkt_residual: float
    violation: float
    searched: bool
    promised_cost: float
    terminal_ratio: float
    local_time_s: float = float('nan')
    wheel_torque_n_m: Array | None = None
    limits_used: float = 0.0
    target_momentum: float = 0.0


def failed(R_NB: ArrayLike, omega_BN_B: ArrayLike, horizon: int, elapsed_s: float,
           limits_used: float = 0.0) -> AttitudeMpcSolution:
    """Return the zero plan for a state that cannot be predicted from."""
    return AttitudeMpcSolution(
        np.zeros(3), np.zeros((horizon, 3)),
        np.tile(np.asarray(R_NB, dtype=float), (horizon + 1, 1, 1)),
        np.tile(np.asarray(omega_BN_B, dtype=float), (horizon + 1, 1)), float('nan'), 0, elapsed_s,
        SolveStatus.FAILED, float('inf'), float('inf'), False, float('nan'), float('nan'),
        limits_used=limits_used)
