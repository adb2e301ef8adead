# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A pointing slew with cones in quaternion form, for IPOPT and fatrop by CasADi and for acados.

What their users would write: q and omega as state, one Runge-Kutta step of order 4 an interval,
``w (1 - b . gamma) + tr(Qf) / 2 |omega|^2 + ...`` as our stage cost tends to for small steps, our
terminal cost, the torque box, and at every node the ellipsoid of the rates and the cones, hard.
Time in steps, torque in its limit. Of the compiled functions all is C, as in `casadi_peer`, but by
-O1: with -O3 the compiler takes minutes for them.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lab.benchmark.peers.acados_install import Acados, find_acados
from manifold_mpc_ros.lab.benchmark.peers.casadi_peer import library_of
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.manifold import tangent_basis
from manifold_mpc_ros.terminal.problem_of import terminal_design

TOLERANCE, MOST_ITERATIONS = 1e-6, 200
_QUIET: dict[str, Any] = {
    'print_time': False, 'record_time': True, 'error_on_fail': False}


class Answer(NamedTuple):
    """One solve: the solver's own time, whether it converged, cost and passes."""

    solver_s: float
    converged: bool
    cost: float
    iterations: int


class Form:
    """Step, stage cost, end cost and node limits (at most 0) as CasADi functions of x and u."""

    def __init__(self, config: AttitudeMpcConfig, R_ND: Array) -> None:
        """Write them down; a pointing target of the config's cones, in inertial axes."""
        assert config.max_torque_n_m is not None
        self.config, h = config, config.step_s
        J, limit = ca.DM(config.inertia_kg_m2), ca.DM(config.max_torque_n_m)
        x, u = ca.SX.sym('x', 7), ca.SX.sym('u', 3)
        w, v, rate = x[0], x[1:4], x[4:7]

        def turned(b: Array) -> ca.SX:
            return ca.DM(b) + 2 * ca.cross(v, w * ca.DM(b) + ca.cross(v, ca.DM(b)))

        def derivative(x: ca.SX) -> ca.SX:
            w, v, rate = x[0], x[1:4], x[4:7]
            torque = h ** 2 * limit * u - ca.cross(rate, J @ rate)
            return ca.vertcat(-ca.dot(v, rate) / 2, (w * rate + ca.cross(v, rate)) / 2,
                              ca.DM(np.linalg.inv(config.inertia_kg_m2)) @ torque)
        a = derivative(x)
        b = derivative(x + a / 2)
        c = derivative(x + b / 2)
        d = derivative(x + c)
        axis = config.pointing_axis_B
        aim = ca.DM(R_ND @ axis)
        rates = ca.DM(np.trace(config.rate_weight) * np.eye(3) - config.rate_weight) / h ** 2
        efforts = ca.DM(np.trace(config.torque_weight) * np.eye(3) - config.torque_weight)
        # w (1 - b . gamma) = w |b_N - aim|^2 / 2
        self.residuals = ca.vertcat(turned(axis) - aim, rate, u)
        self.weight = np.array(ca.diagcat(
            config.pointing_weight * np.eye(3), rates,
            ca.diag(limit) @ efforts @ ca.diag(limit)))
        cost = ca.dot(self.residuals, ca.DM(self.weight) @ self.residuals) / 2
        R = ca.horzcat(*(turned(e) for e in np.eye(3)))
        gamma = R.T @ aim
        normal = ca.cross(gamma, ca.DM(axis))
        sine = ca.sqrt(ca.dot(normal, normal) + 1e-16)
        error = ca.atan2(sine, ca.dot(gamma, ca.DM(axis))) / sine * normal
        self.end_residuals = ca.vertcat(ca.DM(tangent_basis(axis)).T @ error, rate / h)
        self.end_weight = terminal_design(replace(config, cones=())).P
        end = ca.dot(self.end_residuals, ca.DM(self.end_weight) @ self.end_residuals) / 2
        limits = [ca.dot(rate, ca.DM(E) @ rate) / h ** 2 - 1 for E in config.rate_ellipsoids_s2]
        limits += [each.sign * (ca.dot(turned(each.axis_B), ca.DM(each.direction_N))
                                - np.cos(each.half_angle_rad)) for each in config.kept_cones]
        self.x, self.u = x, u
        self.next, self.stage_cost, self.end_cost = x + (a + 2 * b + 2 * c + d) / 6, cost, end
        self.node_limits = ca.vertcat(*limits)
        self.step = ca.Function('step', [x, u], [self.next])

    def state(self, R_NB: Array, omega_BN_B: Array) -> Array:
        """Return a state (7,) of an attitude (3, 3) and a rate (3,) [rad/s]."""
        return np.concatenate([so3.quaternion_from_rotation(R_NB),
                               self.config.step_s * omega_BN_B])


def _along(states: Array, torques: Array) -> tuple[Array, Array]:
    """Return a plan one interval ahead, its last torque again."""
    return states[1:], np.vstack([torques[1:], torques[-1:]])


class CasadiPeer:
    """One NLP of a form in multiple shooting, in the order that fatrop needs."""

    def __init__(self, form: Form, solver: str) -> None:
        """Build and compile."""
        self._form, n = form, form.config.horizon
        x, u = form.x, form.u
        m = form.node_limits.numel()
        stage = ca.Function('stage', [x, u], [form.next, form.stage_cost])
        node = ca.Function('node', [x], [form.node_limits])
        end = ca.Function('end', [x], [form.end_cost])
        plan, state = ca.MX.sym('plan', 10 * n + 7), ca.MX.sym('state', 7)
        stages = ca.reshape(plan[:10 * n], 10, n)
        states, torques, last = stages[:7, :], stages[7:, :], plan[10 * n:]
        following, costs = stage.map(n)(states, torques)
        gaps = ca.horzcat(states[:, 1:], last) - following
        limits = node.map(n)(ca.horzcat(states[:, 1:], last))
        rows = [gaps[:, 0], states[:, 0] - state]
        for k in range(1, n):
            rows += [gaps[:, k], limits[:, k - 1]]
        rows.append(limits[:, n - 1])
        nlp = {'x': plan, 'p': state, 'f': ca.sum2(costs) + end(last), 'g': ca.vertcat(*rows)}
        equal = [True] * 14 + ([True] * 7 + [False] * m) * (n - 1) + [False] * m
        options: dict[str, dict[str, Any]] = {
            'ipopt': {'ipopt': {'print_level': 0, 'sb': 'yes', 'tol': TOLERANCE,
                                'max_iter': MOST_ITERATIONS}},
            'fatrop': {'structure_detection': 'auto', 'equality': equal,
                       'fatrop': {'print_level': 0, 'tol': TOLERANCE,
                                  'max_iter': MOST_ITERATIONS}}}
        chosen = options[solver]
        cold = {**_QUIET, **chosen}
        warm = cold if solver == 'fatrop' else {**_QUIET, 'ipopt': {
            **chosen['ipopt'], 'warm_start_init_point': 'yes', 'mu_init': 1e-4,
            'warm_start_bound_push': 1e-6, 'warm_start_mult_bound_push': 1e-6}}
        self._folder = tempfile.TemporaryDirectory(prefix='peer_')
        source = library_of(ca.nlpsol('peer', solver, nlp, cold), Path(self._folder.name),
                            '-O1')
        self._cold = ca.nlpsol('cold', solver, source, cold)
        self._warm = ca.nlpsol('warm', solver, source, warm)
        bound = np.concatenate([np.tile([np.inf] * 7 + [1.0] * 3, n), [np.inf] * 7])
        self._bounds = {'lbx': -bound, 'ubx': bound, 'ubg': 0.0,
                        'lbg': np.where(equal, 0.0, -np.inf)}
        self._last: dict[str, Any] = {}

    def solve(self, state: Array, guess: tuple[Array, Array] | None) -> Answer:
        """Solve from states (N + 1, 7) and torques (N, 3), or from the last plan, shifted."""
        n, solver = self._form.config.horizon, self._cold
        more: dict[str, Any] = {}
        if guess is None:
            solver, last = self._warm, np.array(self._last['x']).ravel()
            stages = last[:10 * n].reshape(n, 10)
            states, torques = _along(np.vstack([stages[:, :7], last[10 * n:]]), stages[:, 7:])
            guess = np.vstack([states, np.array(self._form.step(
                states[-1], torques[-1])).ravel()]), torques
            more = {'lam_x0': self._last['lam_x'], 'lam_g0': self._last['lam_g']}
        flat = np.concatenate([np.hstack([guess[0][:-1], guess[1]]).ravel(), guess[0][-1]])
        self._last = solver(x0=flat, p=state, **self._bounds, **more)
        stats = solver.stats()
        return Answer(stats['t_wall_total'], bool(stats['success']), float(self._last['f']),
                      int(stats['iter_count']))


class AcadosPeer:
    """acados: SQP with HPIPM and Gauss-Newton, set as in the comparison without cones."""

    def __init__(self, form: Form) -> None:
        """Generate and compile; raises ManifoldMpcError where acados is not installed."""
        self._folder = tempfile.TemporaryDirectory(prefix='acados_')
        folder = Path(self._folder.name)
        acados = _acados()
        self._form, n = form, form.config.horizon
        ocp, model = acados.template.AcadosOcp(), acados.template.AcadosModel()
        model.name, model.x, model.u = f'cones_{n}_{form.node_limits.numel()}', form.x, form.u
        model.disc_dyn_expr = form.next
        model.cost_y_expr, model.cost_y_expr_e = form.residuals, form.end_residuals
        model.con_h_expr = model.con_h_expr_e = form.node_limits
        ocp.model = model
        cost = ocp.cost
        cost.cost_type = cost.cost_type_e = 'NONLINEAR_LS'
        cost.W, cost.W_e = form.weight / form.config.step_s, form.end_weight
        cost.yref, cost.yref_e = np.zeros(len(form.weight)), np.zeros(len(form.end_weight))
        limits, m = ocp.constraints, form.node_limits.numel()
        limits.x0, limits.idxbu = np.eye(7)[0], np.arange(3)
        limits.ubu, limits.lbu = np.ones(3), -np.ones(3)
        for end in ('', '_e'):
            setattr(limits, f'lh{end}', np.full(m, -10.0))
            setattr(limits, f'uh{end}', np.zeros(m))
        options = ocp.solver_options
        if hasattr(options, 'N_horizon'):
            options.N_horizon = n
        else:
            ocp.dims.N = n
        options.tf = n * form.config.step_s
        options.integrator_type, options.hessian_approx = 'DISCRETE', 'GAUSS_NEWTON'
        options.nlp_solver_type, options.nlp_solver_max_iter = 'SQP', MOST_ITERATIONS
        options.qp_solver = 'PARTIAL_CONDENSING_HPIPM'
        options.qp_solver_warm_start, options.hpipm_mode = 2, 'SPEED'
        options.qp_solver_cond_N = max(1, n // 4)
        for residual in ('stat', 'eq', 'ineq', 'comp'):
            setattr(options, f'nlp_solver_tol_{residual}', TOLERANCE)
        getattr(ocp, 'code_gen_opts', options).ext_fun_compile_flags = '-O3 -march=native'
        ocp.code_export_directory = str(folder / 'generated')
        self._solver = acados.template.AcadosOcpSolver(
            ocp, json_file=str(folder / 'ocp.json'), verbose=False)

    def solve(self, state: Array, guess: tuple[Array, Array] | None) -> Answer:
        """As `CasadiPeer.solve`."""
        solver, n = self._solver, self._form.config.horizon
        if guess is None:
            states, torques = _along(np.array([solver.get(k, 'x') for k in range(n + 1)]),
                                     np.array([solver.get(k, 'u') for k in range(n)]))
            guess = np.vstack([states, np.array(self._form.step(
                states[-1], torques[-1])).ravel()]), torques
        else:
            solver.reset()
        for k, x in enumerate(guess[0]):
            solver.set(k, 'x', x)
        for k, u in enumerate(guess[1]):
            solver.set(k, 'u', u)
        solver.set(0, 'lbx', state)
        solver.set(0, 'ubx', state)
        status = solver.solve()
        return Answer(float(np.ravel(solver.get_stats('time_tot'))[0]), status == 0,
                      float(solver.get_cost()), int(np.ravel(solver.get_stats('sqp_iter'))[0]))


@cache
def _acados() -> Acados:
    """Return acados, whose folder of links lasts as long as the process: it is imported once."""
    return find_acados(Path(tempfile.mkdtemp(prefix='acados_root_')) / 'root')


PEERS: dict[str, Callable[[Form], Any]] = {
    'acados SQP (HPIPM)': AcadosPeer, 'fatrop': lambda form: CasadiPeer(form, 'fatrop'),
    'IPOPT': lambda form: CasadiPeer(form, 'ipopt')}


