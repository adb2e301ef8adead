# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A control loop whose solver says what it is told to; no ROS needed."""

from __future__ import annotations

import dataclasses

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.command import Law
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.input_gate import StateGate, StateSample
from manifold_mpc_ros.control.solver_thread import DirectSolver, solve_with
from manifold_mpc_ros.errors import StepExistenceError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus

CONFIG = AttitudeMpcConfig(
    inertia_kg_m2=np.diag([1.0, 0.9, 0.6]), step_s=0.5, horizon=2, attitude_weight=np.eye(3),
    rate_weight=np.diag([0.25, 0.35, 0.65]), torque_weight=2.0 * np.eye(3),
    max_torque_n_m=np.array([0.3, 0.2, 0.1]))
FREE = dataclasses.replace(CONFIG, max_torque_n_m=None)
LONG = dataclasses.replace(CONFIG, horizon=20)
STEP_NS = round(CONFIG.step_s * 1e9)
TIMEOUT_S = 2.5
R_NB = so3.exp([0.3, -0.2, 0.1])
OMEGA = np.array([0.1, 0.2, -0.3])
SAMPLE = StateSample(10 * 10**9, R_NB, OMEGA)


class Script:
    """A solver whose answer the test writes."""

    def __init__(self, horizon: int = 2) -> None:
        self.horizon, self.cost = horizon, 1.0
        self.repair()
        self.resets = 0
        self.setpoints: list[np.ndarray | None] = []
        self.states: list[tuple[np.ndarray, np.ndarray]] = []

    def repair(self) -> None:
        self.torque = np.array([0.1, -0.1, 0.05])
        self.status = SolveStatus.CONVERGED
        self.error: Exception | None = None

    def reset(self) -> None:
        self.resets += 1

    def solve(
        self, R_NB: np.ndarray, omega_BN_B: np.ndarray, R_ND: np.ndarray | None = None, *,
        disturbance_B_n_m: np.ndarray | None = None, max_solve_time_s: float | None = None,
        wheel_momentum_n_m_s: np.ndarray | None = None,
        directions_N: dict[str, np.ndarray] | None = None,
    ) -> AttitudeMpcSolution:
        self.budget_s, self.directions_N = max_solve_time_s, directions_N
        self.disturbance, self.momentum = disturbance_B_n_m, wheel_momentum_n_m_s
        if self.error is not None:
            raise self.error
        self.setpoints.append(R_ND)
        self.states.append((R_NB, omega_BN_B))
        n = self.horizon
        plan = (1.0 - 0.01 * np.arange(n))[:, None] * self.torque  # no two alike
        return AttitudeMpcSolution(
            self.torque, plan, np.tile(R_NB, (n + 1, 1, 1)), np.tile(omega_BN_B, (n + 1, 1)),
            self.cost, 3, 1e-4, self.status, 0.0, 0.0, False, 0.9, 0.5)


def gate() -> StateGate:
    return StateGate('inertial', 'base_link', step_s=CONFIG.step_s, timeout_s=TIMEOUT_S,
                     timed=False)


def loop_with(
    solver: Script | AttitudeMpc, config: AttitudeMpcConfig = CONFIG, setpoint: str = 'identity',
) -> ControlLoop:
    return ControlLoop(
        Law(config, DirectSolver(solve_with(solver)), TIMEOUT_S), gate(),
        initial_setpoint=setpoint)


def failed(solver: Script) -> None:
    solver.status = SolveStatus.FAILED


def not_finite(solver: Script) -> None:
    solver.torque = np.array([0.1, np.nan, 0.0])


def raising(solver: Script) -> None:
    solver.error = StepExistenceError('too fast')
