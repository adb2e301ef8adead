# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""acados as one of the compared solvers: SQP to 1e-6, or one real-time iteration.

Settings found best of some sixty on this problem: discrete dynamics (the generated C of one
Runge-Kutta step and its Jacobian; faster than acados' own integrator), Gauss-Newton, full steps,
hot-started HPIPM in its mode SPEED on blocks of four stages, or full condensing with
warm-started DAQP, Anderson acceleration where the version offers it. The real-time iteration:
HPIPM's mode SPEED_ABS without condensing, its QP solved to 1e-2 only.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.benchmark.peers import problem
from manifold_mpc_ros.lab.benchmark.peers.acados_install import Acados, find_acados
from manifold_mpc_ros.lab.benchmark.peers.solver import Answer
from manifold_mpc_ros.lie.arrays import Array

TOLERANCE = 1e-6
_MOST_ITERATIONS = 100
_FLAGS = '-O3 -march=native'
_STAGES_PER_BLOCK = 4
_RTI_QP_TOLERANCE = 1e-2
_SETTLED = 0
_QP = {'hpipm': 'PARTIAL_CONDENSING_HPIPM', 'daqp': 'FULL_CONDENSING_DAQP'}


class AcadosPeer:
    """The quaternion form through acados' Python interface."""

    def __init__(self, horizon: int, *, qp: str, real_time_iteration: bool = False) -> None:
        """Generate and compile; raises ManifoldMpcError for what this acados does not have."""
        self._folder = tempfile.TemporaryDirectory(prefix='acados_')
        folder = Path(self._folder.name)
        acados = find_acados(folder / 'root')
        self.version = acados.version
        if qp == 'daqp' and not acados.has_daqp:
            raise ManifoldMpcError(f'this acados has no DAQP ({acados.version})')
        self._horizon, self._model = horizon, problem.quaternion_model()
        self._rti = real_time_iteration
        ocp = _ocp(acados, self._model, horizon, qp, real_time_iteration)
        ocp.code_export_directory = str(folder / 'generated')
        self._solver = acados.template.AcadosOcpSolver(
            ocp, json_file=str(folder / 'ocp.json'), verbose=False)

    def cold(self, state: Array) -> Answer:
        """Solve from the slew guess with all memory cleared."""
        guess = problem.slew(self._model, state, self._horizon)
        begin = time.perf_counter()
        self._solver.reset()
        self._guess(*guess)
        return self._solve(state, begin)

    def warm(self, state: Array) -> Answer:
        """Solve from the shifted iterate; the last torque is repeated."""
        begin = time.perf_counter()
        states, torques = self._iterate()
        last = np.array(self._model.step(states[-1], torques[-1])).ravel()
        self._guess(np.vstack([states[1:], last]), np.vstack([torques[1:], torques[-1:]]))
        return self._solve(state, begin)

    def advance(self, state: Array, torque_n_m: Array) -> Array:
        """Return the state after one Runge-Kutta step."""
        return np.array(self._model.step(state, torque_n_m)).ravel()

    def _guess(self, states: Array, torques: Array) -> None:
        """Set the starting iterate."""
        for stage, x in enumerate(states):
            self._solver.set(stage, 'x', x)
        for stage, u in enumerate(torques):
            self._solver.set(stage, 'u', u)

    def _iterate(self) -> tuple[Array, Array]:
        """Return states (N + 1, 7) and torques (N, 3) of the present iterate."""
        get, n = self._solver.get, self._horizon
        return (np.array([get(stage, 'x') for stage in range(n + 1)]),
                np.array([get(stage, 'u') for stage in range(n)]))

    def _solve(self, state: Array, begin: float) -> Answer:
        """Solve from the iterate that is set."""
        solver = self._solver
        solver.set(0, 'lbx', state)
        solver.set(0, 'ubx', state)
        status = solver.solve()
        solver.get(0, 'u')
        call_s = time.perf_counter() - begin
        solver_s = float(np.ravel(solver.get_stats('time_tot'))[0])
        iterations = 1 if self._rti else int(np.ravel(solver.get_stats('sqp_iter'))[0])
        states, torques = self._iterate()
        return Answer(solver_s, call_s, torques, self._model.cost(states, torques), iterations,
                      status == _SETTLED)


def _ocp(acados: Acados, model: problem.Model, horizon: int, qp: str, rti: bool) -> Any:
    """Write the problem in acados' terms; its stage costs are multiplied by the step."""
    ocp, symbols = acados.template.AcadosOcp(), acados.template.AcadosModel()
    x, tau = ca.SX.sym('x', problem.STATE), ca.SX.sym('tau', problem.TORQUE)
    symbols.name, symbols.x, symbols.u = f'slew_{horizon}', x, tau
    symbols.disc_dyn_expr = problem.runge_kutta(x, tau)
    symbols.cost_y_expr_e = problem.terminal_coordinates(x)
    ocp.model, cost, limits = symbols, ocp.cost, ocp.constraints
    cost.cost_type, cost.cost_type_e = 'LINEAR_LS', 'NONLINEAR_LS'
    cost.Vx = np.vstack([np.eye(problem.STATE)[1:], np.zeros((problem.TORQUE, problem.STATE))])
    cost.Vu = np.vstack([np.zeros((problem.STATE - 1, problem.TORQUE)), np.eye(problem.TORQUE)])
    cost.W, cost.yref = np.diag(problem.RESIDUAL_WEIGHTS) / problem.STEP_S, np.zeros(9)
    cost.W_e, cost.yref_e = model.terminal_weight, np.zeros(6)
    limits.x0, limits.idxbu = np.eye(problem.STATE)[0], np.arange(problem.TORQUE)
    limits.ubu = np.full(3, problem.MAX_TORQUE_N_M)
    limits.lbu = -limits.ubu
    limits.idxbx = limits.idxbx_e = np.arange(4, problem.STATE)
    limits.ubx = limits.ubx_e = np.full(3, problem.MAX_RATE_RAD_S)
    limits.lbx = limits.lbx_e = -limits.ubx
    _set_options(acados, ocp, horizon, qp, rti)
    return ocp


def _set_options(acados: Acados, ocp: Any, horizon: int, qp: str, rti: bool) -> None:
    """Set what was found fastest; names changed between acados' versions."""
    options = ocp.solver_options
    if hasattr(options, 'N_horizon'):
        options.N_horizon = horizon
    else:
        ocp.dims.N = horizon
    options.tf = horizon * problem.STEP_S
    options.integrator_type, options.hessian_approx = 'DISCRETE', 'GAUSS_NEWTON'
    options.nlp_solver_type = 'SQP_RTI' if rti else 'SQP'
    options.nlp_solver_max_iter = _MOST_ITERATIONS
    for residual in ('stat', 'eq', 'ineq', 'comp'):
        setattr(options, f'nlp_solver_tol_{residual}', TOLERANCE)
    options.qp_solver, options.qp_solver_warm_start = _QP[qp], 1
    if qp == 'hpipm':
        options.qp_solver_warm_start = 2
        options.hpipm_mode = 'SPEED_ABS' if rti else 'SPEED'
        options.qp_solver_cond_N = horizon if rti else max(1, horizon // _STAGES_PER_BLOCK)
    if rti:
        for residual in ('stat', 'eq', 'ineq', 'comp'):
            setattr(options, f'qp_solver_tol_{residual}', _RTI_QP_TOLERANCE)
    if acados.has_anderson and not rti:
        options.with_anderson_acceleration = True
    getattr(ocp, 'code_gen_opts', options).ext_fun_compile_flags = _FLAGS
