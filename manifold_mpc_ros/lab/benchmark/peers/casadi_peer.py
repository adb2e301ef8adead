# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CasADi's NLP solvers as compared ones: ipopt, fatrop and sqpmethod with a QP plugin.

One NLP in multiple shooting, its variables in the order x0, tau0, x1, ... that fatrop needs. The
stages are one mapped function, so that generated code stays small. Compiled: all functions of
the NLP and their derivatives as C, by gcc -O3 -march=native.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.benchmark.peers import problem
from manifold_mpc_ros.lab.benchmark.peers.solver import Answer
from manifold_mpc_ros.lie.arrays import Array

TOLERANCE = 1e-6
_STAGE = problem.STATE + problem.TORQUE
_COMPILE = ('cc', '-march=native', '-fPIC', '-shared')
_QUIET: dict[str, Any] = {'print_time': False, 'record_time': True, 'error_on_fail': False}
_IPOPT = {'print_level': 0, 'sb': 'yes', 'tol': TOLERANCE}
#: From a plan that is nearly optimal: a small barrier, and hardly pushed off the bounds.
_IPOPT_WARM = {**_IPOPT, 'warm_start_init_point': 'yes', 'mu_init': 1e-4,
               'warm_start_bound_push': 1e-6, 'warm_start_mult_bound_push': 1e-6}
_FATROP = {'print_level': 0, 'tol': TOLERANCE}
_QP_OPTIONS: dict[str, dict[str, Any]] = {
    'qrqp': {'print_iter': False, 'print_header': False, 'print_info': False},
    'hpipm': {},
}


class CasadiPeer:
    """The quaternion form as one NLP for ``casadi.nlpsol``."""

    def __init__(self, horizon: int, *, solver: str, qp: str = '', compiled: bool = True) -> None:
        """Build, and compile where asked for; raises what CasADi or the compiler says."""
        self._horizon, self._model = horizon, problem.quaternion_model()
        self._folder = tempfile.TemporaryDirectory(prefix='casadi_')
        nlp = _nlp(self._model, horizon)
        cold, warm = _options(solver, qp, horizon)
        if solver == 'sqpmethod':
            cold['hess_lag'] = _gauss_newton(self._model, nlp, horizon)
        source: Any = nlp
        if compiled:
            source = library_of(ca.nlpsol('nlp', solver, nlp, cold), Path(self._folder.name))
        self._cold = ca.nlpsol('cold', solver, source, cold)
        self._warm = self._cold if warm == cold else ca.nlpsol('warm', solver, source, warm)
        stage = np.concatenate([_state_limits(), np.full(3, problem.MAX_TORQUE_N_M)])
        limits = np.concatenate([np.tile(stage, horizon), _state_limits()])
        limits[:problem.STATE] = np.inf  # the measured state is what it is
        self._bounds = {'lbx': -limits, 'ubx': limits, 'lbg': 0, 'ubg': 0}
        self._last: dict[str, Any] = {}

    def cold(self, state: Array) -> Answer:
        """Solve from the slew guess."""
        states, torques = problem.slew(self._model, state, self._horizon)
        begin = time.perf_counter()
        return self._solve(self._cold, state, _packed(states, torques), begin)

    def warm(self, state: Array) -> Answer:
        """Solve from the shifted plan, with the multipliers of the last solve."""
        begin = time.perf_counter()
        states, torques = self._unpacked(self._last['x'])
        last = np.array(self._model.step(states[-1], torques[-1])).ravel()
        guess = _packed(np.vstack([states[1:], last]), np.vstack([torques[1:], torques[-1:]]))
        return self._solve(self._warm, state, guess, begin,
                           lam_x0=self._last['lam_x'], lam_g0=self._last['lam_g'])

    def improve(self, state: Array, torques_n_m: Array) -> float:
        """Return the cost of the local optimum that starts from torques; inf without one."""
        guess = _packed(self._model.roll_out(state, torques_n_m), torques_n_m)
        answer = self._solve(self._cold, state, guess, time.perf_counter())
        return answer.cost if answer.converged else np.inf

    def advance(self, state: Array, torque_n_m: Array) -> Array:
        """Return the state after one Runge-Kutta step."""
        return np.array(self._model.step(state, torque_n_m)).ravel()

    def _solve(self, solver: ca.Function, state: Array, guess: Array, begin: float,
               **multipliers: ca.DM) -> Answer:
        """Solve and read the clocks."""
        self._last = solver(x0=guess, p=state, **self._bounds, **multipliers)
        plan = np.array(self._last['x'])
        call_s = time.perf_counter() - begin
        states, torques = self._unpacked(plan)
        stats = solver.stats()
        return Answer(stats['t_wall_total'], call_s, torques, self._model.cost(states, torques),
                      int(stats['iter_count']), bool(stats['success']))

    def _unpacked(self, plan: Any) -> tuple[Array, Array]:
        """Return states (N + 1, 7) and torques (N, 3) of the NLP's variables."""
        flat = np.array(plan).ravel()
        stages = flat[:-problem.STATE].reshape(self._horizon, _STAGE)
        states = np.vstack([stages[:, :problem.STATE], flat[-problem.STATE:]])
        return states, stages[:, problem.STATE:].copy()


def _state_limits() -> Array:
    """Return the upper limits of a state: none on the quaternion."""
    return np.array([np.inf] * 4 + [problem.MAX_RATE_RAD_S] * 3)


def _packed(states: Array, torques: Array) -> Array:
    """Return states and torques as the NLP's variables."""
    return np.concatenate([np.hstack([states[:-1], torques]).ravel(), states[-1]])


def _nlp(model: problem.Model, horizon: int) -> dict[str, ca.MX]:
    """Return cost and constraints; the first rows after a gap fix the initial state."""
    x, tau = ca.SX.sym('x', problem.STATE), ca.SX.sym('tau', problem.TORQUE)
    residuals, xi = model.stage(x, tau), model.end(x)
    stage = ca.Function('stage', [x, tau], [
        ca.dot(problem.RESIDUAL_WEIGHTS * residuals, residuals) / 2])
    end = ca.Function('end', [x], [ca.dot(xi, ca.DM(model.terminal_weight) @ xi) / 2])
    plan, state = ca.MX.sym('plan', _STAGE * horizon + problem.STATE), ca.MX.sym('state', 7)
    stages = ca.reshape(plan[:_STAGE * horizon], _STAGE, horizon)
    states, torques = stages[:problem.STATE, :], stages[problem.STATE:, :]
    last = plan[_STAGE * horizon:]
    gaps = ca.vec(ca.horzcat(states[:, 1:], last) - model.step.map(horizon)(states, torques))
    constraints = ca.vertcat(gaps[:problem.STATE], states[:, 0] - state, gaps[problem.STATE:])
    cost = ca.sum2(stage.map(horizon)(states, torques)) + end(last)
    return {'x': plan, 'p': state, 'f': cost, 'g': constraints}


def _options(solver: str, qp: str, horizon: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the options of a cold and of a warm solve."""
    if solver == 'ipopt':
        return {**_QUIET, 'ipopt': _IPOPT}, {**_QUIET, 'ipopt': _IPOPT_WARM}
    if solver == 'fatrop':
        rows = problem.STATE * (horizon + 1)
        options = {**_QUIET, 'structure_detection': 'auto', 'equality': [True] * rows,
                   'fatrop': _FATROP}
        return options, options
    options = {
        **_QUIET, 'print_header': False, 'print_iteration': False, 'print_status': False,
        'tol_pr': TOLERANCE, 'tol_du': TOLERANCE, 'qpsol': qp,
        'qpsol_options': {'error_on_fail': False, **_QP_OPTIONS[qp]}}
    return options, options


def _gauss_newton(model: problem.Model, nlp: dict[str, ca.MX], horizon: int) -> ca.Function:
    """Return the Gauss-Newton Hessian; with the exact one sqpmethod did not converge here."""
    x = ca.SX.sym('x', problem.STATE)
    jacobian = ca.jacobian(model.end(x), x)
    end = ca.Function('end_hessian', [x], [
        ca.densify(jacobian.T @ ca.DM(model.terminal_weight) @ jacobian)])
    stages = ca.DM(ca.diag(np.tile([0.0, *problem.RESIDUAL_WEIGHTS], horizon)))
    factor, multipliers = ca.MX.sym('factor'), ca.MX.sym('multipliers', nlp['g'].shape[0])
    hessian = factor * ca.diagcat(ca.sparsify(stages), end(nlp['x'][_STAGE * horizon:]))
    return ca.Function('nlp_hess_l', [nlp['x'], nlp['p'], factor, multipliers], [hessian],
                       ['x', 'p', 'lam_f', 'lam_g'], ['hess_gamma_x_x'])


def library_of(solver: ca.Function, folder: Path, level: str = '-O3') -> str:
    """Return the library of everything that a solver evaluates, optimised to a level."""
    source, library = folder / 'nlp.c', folder / 'nlp.so'
    before = Path.cwd()
    os.chdir(folder)  # CasADi writes into the current folder only
    try:
        solver.generate_dependencies(source.name)
    finally:
        os.chdir(before)
    done = subprocess.run([*_COMPILE, level, str(source), '-o', str(library), '-lm'], text=True,
                          capture_output=True, check=False)
    if done.returncode != 0:
        raise ManifoldMpcError(f'cc failed on a peer: {done.stderr.strip()[:200]}')
    return str(library)
