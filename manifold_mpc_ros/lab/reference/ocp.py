# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The optimal control problem of paper section 2 on any manifold, as an NLP solved by IPOPT.

    min  sum_k L(x_k, u_k) + F(x_N),   x_{k+1} = f(x_k, u_k),   F = xi^T P xi / 2,  xi = phi^-1(x)

over u_0 .. u_{N-1} in their box, with the state limits at k = 1 .. N, the step's existence at
every stage, and (where a level c is given) ``xi_N^T P xi_N <= c``. The existence rows are left
out until a plan breaks them: a condition with a norm in it has no derivative at rest.

The nodes x_1 .. x_N are unknowns in the numbers that represent points, and each equals the image
of the one before it. Since f maps into M and x_0 is on M, so is every feasible node; the equations
have full rank (their derivative by the node is the identity), and unlike an equation in a chart
they have no solutions on the wrong sheet. What IPOPT returns is used for its controls only: the
plan is their roll-out, on M to rounding, and its cost and violations are those of the roll-out.
Shooting nodes rather than eliminated states keep the Hessian sparse and let the optimiser start
from, and pass through, trajectories that a roll-out of poor controls would never reach.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.problem import ManifoldProblem

# The step is kept where this much of the room in its existence condition is left.
EXISTENCE_ROOM = 1e-3
# Violations of a plan above this (relative for the terminal set) make it infeasible.
VIOLATION = 1e-6
IPOPT = {'print_level': 0, 'sb': 'yes', 'tol': 1e-10, 'max_iter': 400, 'bound_relax_factor': 0.0}
# From a plan that is nearly optimal: stay near it.
NEAR = {'mu_init': 1e-7, 'bound_push': 1e-8, 'bound_frac': 1e-8, 'slack_bound_push': 1e-8,
        'slack_bound_frac': 1e-8}


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A trajectory on the manifold: N controls in coordinates of psi, N + 1 points.

    ``violation`` is the largest over all constraints; ``success`` says that IPOPT met its
    optimality conditions (a roll-out alone is never a success).
    """

    controls: Array      # (N, m)
    states: Array        # (N + 1, ambient)
    stage_costs: Array   # (N,)
    terminal_cost: float
    violation: float
    success: bool = False

    @property
    def value(self) -> float:
        """The cost of the plan."""
        return float(self.stage_costs.sum()) + self.terminal_cost

    @property
    def feasible(self) -> bool:
        """Whether every constraint holds."""
        return bool(np.isfinite(self.value)) and self.violation <= VIOLATION


class OptimalControlProblem:
    """The problem of one horizon; P (n, n) and the level c (None: no terminal set) are given."""

    def __init__(self, problem: ManifoldProblem, horizon: int, P: ArrayLike,
                 level: float | None) -> None:
        """Write the problem down with the initial state as its parameter.

        ``cost_unit`` is the terminal cost at a typical state, by which the cost is scaled.
        """
        self.problem, self.horizon = problem, horizon
        self._P, self._level = np.asarray(P, dtype=float), level
        units = np.asarray(problem.state_units, dtype=float)
        self.cost_unit = float(np.diag(self._P) @ units ** 2)
        self._node_units = _node_units(problem)
        self._solvers: dict[tuple[bool, bool], tuple[ca.Function, dict[str, Array]]] = {}
        self._write_functions()

    @property
    def control_box(self) -> Array:
        """Half widths (m,) of the control box, inf where there is no limit."""
        free = np.full(self.problem.controls.dimension, np.inf)
        limits = self.problem.control_limits
        return free if limits is None else np.asarray(limits, dtype=float)

    def coordinates(self, state: ArrayLike) -> Array:
        """Map a point (ambient,) to its coordinates (n,)."""
        return _column(self._coordinates(state))

    def control_point(self, coordinates: ArrayLike) -> Array:
        """Map control coordinates (m,) to the point of U."""
        return _column(self._control_point(coordinates))

    def step(self, state: ArrayLike, control: ArrayLike) -> Array:
        """Map a point and control coordinates to the next point."""
        return _column(self._stage(state, control)[0])

    def exists(self, state: ArrayLike, control: ArrayLike) -> bool:
        """Say whether the step is guaranteed to exist."""
        return bool(float(self._exists(state, control)) <= 1.0 - EXISTENCE_ROOM)

    def roll_out(self, state: ArrayLike, controls: Array, *, success: bool = False) -> Trajectory:
        """Map controls (N, m) from a point to their plan."""
        states, costs, worst = [np.asarray(state, dtype=float)], [], [0.0]
        for control in controls:
            following, cost = self._stage(states[-1], control)
            worst += [float(self._exists(states[-1], control)) - 1.0,
                      float(self._limits(following))]
            states.append(_column(following))
            costs.append(float(cost))
        box = self.control_box
        bounded = np.isfinite(box)
        worst.append(float(np.max(np.abs(controls[:, bounded]) / box[bounded], initial=0.0)) - 1.0)
        terminal = float(self._terminal(states[-1]))
        if self._level is not None:
            worst.append(2.0 * terminal / self._level - 1.0)
        violation = float(np.max(worst)) if np.all(np.isfinite(worst)) else np.inf
        return Trajectory(np.array(controls, dtype=float), np.array(states), np.array(costs),
                          terminal, violation, success)

    def solve(self, state: ArrayLike, guess: Trajectory, *, near: bool = False,
              bound: float = np.inf) -> Trajectory:
        """Return the plan of the local optimum that IPOPT reaches from a guess.

        ``near`` starts at the guess itself, for one that is nearly optimal. A plan that breaks
        the existence condition is sought again with it, unless it is worth ``bound`` or more.
        """
        unknowns = np.concatenate([
            (guess.controls / self.problem.control_units).ravel(),
            (guess.states[1:] / self._node_units).ravel()])
        plan = self._solve(state, unknowns, near, guarded=False)
        if plan.value >= bound or all(
                self.exists(x, u) for x, u in zip(plan.states, plan.controls)):
            return plan
        guarded = self._solve(state, unknowns, near, guarded=True)
        return guarded if guarded.violation < plan.violation else plan

    def _solve(self, state: ArrayLike, unknowns: Array, near: bool, guarded: bool) -> Trajectory:
        """Run IPOPT from scaled unknowns, with the existence rows or without them."""
        solver, bounds = self._solver(near, guarded)
        result = solver(x0=unknowns, p=state, **bounds)
        m = self.problem.controls.dimension
        controls = _column(result['x'])[:self.horizon * m].reshape(self.horizon, m)
        return self.roll_out(state, controls * self.problem.control_units,
                             success=bool(solver.stats()['success']))

    def _write_functions(self) -> None:
        """Build the functions of one stage and of the end."""
        problem = self.problem
        x = ca.SX.sym('x', problem.states.ambient)
        eta = ca.SX.sym('eta', problem.controls.dimension)
        u, xi = problem.controls.point(eta), problem.states.coordinates(x)
        limits = [limit(x) for limit in problem.state_limits.values()]
        exists = ca.SX(-1) if problem.existence is None else problem.existence(x, u)
        self._stage = ca.Function('stage', [x, eta], [
            problem.step(x, u), problem.stage_cost(x, u)])
        self._rows = ca.Function('rows', [x], [ca.vertcat(*limits)])
        self._limits = ca.Function('limits', [x], [ca.mmax(ca.vertcat(-1, *limits))])
        self._exists = ca.Function('exists', [x, eta], [exists])
        self._terminal = ca.Function('terminal', [x], [ca.dot(xi, ca.DM(self._P) @ xi) / 2])
        self._coordinates = ca.Function('coordinates', [x], [xi])
        self._control_point = ca.Function('control_point', [eta], [u])

    def _solver(self, near: bool, guarded: bool) -> tuple[ca.Function, dict[str, Array]]:
        """Return the solver of these options and its bounds, built at its first use."""
        if (near, guarded) not in self._solvers:
            nlp, bounds = self._nlp(guarded)
            options = {'print_time': False, 'error_on_fail': False, 'show_eval_warnings': False,
                       'calc_lam_p': False, 'ipopt': {**IPOPT, **(NEAR if near else {})}}
            self._solvers[near, guarded] = ca.nlpsol('ocp', 'ipopt', nlp, options), bounds
        return self._solvers[near, guarded]

    def _nlp(self, guarded: bool) -> tuple[dict[str, ca.MX], dict[str, Array]]:
        """Return the NLP and its bounds; unknowns and equations in the problem's units."""
        problem, n = self.problem, self.horizon
        scaled_controls = ca.MX.sym('controls', problem.controls.dimension, n)
        scaled_nodes = ca.MX.sym('nodes', problem.states.ambient, n)
        start = ca.MX.sym('start', problem.states.ambient)
        controls = scaled_controls * ca.repmat(ca.DM(problem.control_units), 1, n)
        units = ca.repmat(ca.DM(self._node_units), 1, n)
        nodes = scaled_nodes * units
        before = ca.horzcat(start, nodes[:, :n - 1])
        images, costs = self._stage.map(n)(before, controls)
        terminal = self._terminal(nodes[:, n - 1])
        match = ca.vec(images / units - scaled_nodes)
        rows, tops = [ca.vec(self._rows.map(n)(nodes))], [0.0]
        if guarded:
            rows.append(ca.vec(self._exists.map(n)(before, controls)))
            tops.append(1.0 - EXISTENCE_ROOM)
        if self._level is not None:
            rows.append(2 * terminal / self._level)
            tops.append(1.0)
        high = np.concatenate([np.full(row.numel(), top) for row, top in zip(rows, tops)])
        zero, none = np.zeros(match.numel()), np.full(len(high), -np.inf)
        box = np.tile(self.control_box / problem.control_units, n)
        free = np.full(scaled_nodes.numel(), np.inf)
        bounds = {'lbx': np.concatenate([-box, -free]), 'ubx': np.concatenate([box, free]),
                  'lbg': np.concatenate([zero, none]), 'ubg': np.concatenate([zero, high])}
        nlp = {'x': ca.vertcat(ca.vec(scaled_controls), ca.vec(scaled_nodes)), 'p': start,
               'f': (ca.sum2(costs) + terminal) / self.cost_unit, 'g': ca.vertcat(match, *rows)}
        return nlp, bounds


def _node_units(problem: ManifoldProblem) -> Array:
    """Return typical sizes (ambient,) of the numbers of a point near the origin."""
    xi = ca.SX.sym('xi', problem.states.dimension)
    derivative = ca.Function('d', [xi], [ca.jacobian(problem.states.point(xi), xi)])(0)
    sizes = np.abs(np.array(ca.DM(derivative))) @ np.asarray(problem.state_units, dtype=float)
    return np.where(sizes > 0.0, sizes, 1.0)


def _column(value: ca.DM) -> Array:
    """Return a CasADi column as a vector."""
    return np.array(value).ravel()
