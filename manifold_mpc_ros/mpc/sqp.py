# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The solver as CasADi functions over the whole horizon: starts and iterations.

The same graphs run in CasADi's virtual machine or as generated C (:mod:`.build`), so both give
the same numbers. The solver's state is a tuple of matrices, one column per node or stage.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from manifold_mpc_ros.mpc import backward, forward, guess, stage
from manifold_mpc_ros.mpc.scaling import PARAMETERS
from manifold_mpc_ros.mpc.structure import Structure

# Stop when stationarity and complementarity are below this (dimensionless).
TOLERANCE = 1e-8
# The barrier ends here; the cost is then within 24 N times this of the optimum.
SMALLEST_BARRIER = 1e-9
# Shrink the barrier once the model expects less decrease than this many times mu.
_BARRIER_READY = 10.0
_BARRIER_FACTOR = 0.1
_BARRIER_POWER = 1.5
_ARMIJO = 1e-4
# Rounding of cost and barrier, relative: changes below it count as no increase.
_COST_NOISE = 1e-11
_BARRIER_NOISE = 1e-13
_BACKTRACK = 1 / 3
_SMALLEST_STEP = 1e-6
# Blend towards the exact Hessian: halved while it is indefinite, grown on every accepted pass.
_BLEND_DOWN = 0.5
_BLEND_UP = 1.5
_SMALLEST_BLEND = 0.05
# A relative pivot of Quu below this counts as indefinite.
_SMALLEST_PIVOT = 1e-14
PASSES_PER_CALL = 4

RUNNING, CONVERGED, STALLED = 0, 1, 2


class Progress(NamedTuple):
    """Scalars of the solver's state, in the order of its last matrix."""

    mu: float
    alpha: float
    cost: float
    logs: float
    stationarity: float
    complementarity: float
    decrease: float
    passes: float
    flag: float
    exact: float


class State(NamedTuple):
    """The solver's state: nodes (10, N+1), step Cayley parameters, torques, barrier variables."""

    nodes: ca.MX
    steps: ca.MX
    torques: ca.MX
    duals: ca.MX
    terminal: ca.MX
    progress: ca.MX


def state_shapes(structure: Structure) -> State:
    """Return the shapes of the state's matrices."""
    n = structure.horizon
    return State((stage.NODE, n + 1), (3, n), (3, n), (structure.stage_duals, n),
                 (structure.terminal_duals, 1), (len(Progress._fields), 1))


def _symbols(structure: Structure) -> State:
    return State(*(ca.MX.sym(name, *shape) for name, shape
                   in zip(State._fields, state_shapes(structure))))


def _columns(matrix: ca.MX, count: int) -> list[ca.MX]:
    """Return the columns of a matrix; empty columns where it has no rows."""
    if matrix.shape[0] == 0:
        return [ca.MX(0, 1)] * count
    return list(ca.horzsplit(matrix))


def start_function(structure: Structure) -> ca.Function:
    """Map (node_0, torques (3, N), lean (3, N), follow (1, N), mu, p) to a starting state.

    ``follow``, stage by stage: 0 the slew law with its lean, 1 the given torque, 2 the local law.
    """
    n = structure.horizon
    node0, mu = ca.MX.sym('node', stage.NODE), ca.MX.sym('mu')
    torques, leans = ca.MX.sym('torques', 3, n), ca.MX.sym('leans', 3, n)
    follow, flat = ca.MX.sym('follow', 1, n), ca.MX.sym('flat', PARAMETERS)
    choose, begin = guess.start_torque(structure), guess.start_stage(structure)
    node, sums = node0, ca.MX.zeros(3)
    nodes, steps, chosen, duals = [node0], [], [], []
    for given, lean, source in zip(ca.horzsplit(torques), ca.horzsplit(leans),
                                   ca.horzsplit(follow)):
        torque = choose(node, given, lean, source, flat)
        node, step, torque, dual, sums = begin(node, torque, mu, flat, sums)
        nodes.append(node)
        steps.append(step)
        chosen.append(torque)
        duals.append(dual)
    terminal, sums = guess.start_terminal(structure)(node, mu, flat, sums)
    flag = ca.if_else(sums[2] < forward.STEP_RESIDUAL, RUNNING, STALLED)
    progress = ca.vertcat(mu, 1, sums[0], sums[1], ca.inf, ca.inf, ca.inf, 0, flag, 1)
    state = State(ca.horzcat(*nodes), ca.horzcat(*steps), ca.horzcat(*chosen),
                  ca.horzcat(*duals), terminal, progress)
    return ca.Function('start', [node0, torques, leans, follow, mu, flat], list(state))


def _backward(structure: Structure, z: State, exact: ca.MX, flat: ca.MX
              ) -> tuple[list[ca.MX], list[ca.MX], ca.MX]:
    """Return gains and models of every stage and the residuals."""
    n = structure.horizon
    mu = z.progress[0]
    nodes, duals = _columns(z.nodes, n + 1), _columns(z.duals, n)
    steps, torques = _columns(z.steps, n), _columns(z.torques, n)
    stage_model = backward.backward_stage(structure)
    v_xx, v_x, adjoint, residuals = backward.backward_terminal(structure)(
        nodes[n], z.terminal, mu, exact, flat)
    gains: list[ca.MX] = []
    models: list[ca.MX] = []
    for k in reversed(range(n)):
        gain, v_xx, v_x, adjoint, residuals, model = stage_model(
            nodes[k], nodes[k + 1], steps[k], torques[k], duals[k], mu, flat, exact, v_xx, v_x,
            adjoint, residuals)
        gains.insert(0, gain)
        models.insert(0, model)
    return gains, models, residuals


def _forward(structure: Structure, z: State, gains: list[ca.MX], models: list[ca.MX],
             flat: ca.MX) -> tuple[list[ca.MX], ca.MX]:
    """Return the trial matrices (nodes, steps, torques, duals, terminal) and its merit sums."""
    n = structure.horizon
    mu, alpha = z.progress[0], z.progress[1]
    nodes, duals = _columns(z.nodes, n + 1), _columns(z.duals, n)
    steps, torques = _columns(z.steps, n), _columns(z.torques, n)
    advance = forward.forward_stage(structure)
    node, linear, sums = nodes[0], ca.MX.zeros(stage.TANGENT), ca.MX.zeros(3)
    columns: tuple[list[ca.MX], ...] = ([node], [], [], [])
    for k in range(n):
        node, step, torque, dual, linear, sums = advance(
            nodes[k], nodes[k + 1], steps[k], torques[k], duals[k], mu, flat, node, gains[k],
            models[k], linear, alpha, sums)
        for column, value in zip(columns, (node, step, torque, dual)):
            column.append(value)
    terminal, sums = forward.forward_terminal(structure)(
        nodes[n], node, z.terminal, linear, alpha, mu, sums, flat)
    return [*(ca.horzcat(*column) for column in columns), terminal], sums


def _trial_function(structure: Structure) -> ca.Function:
    """Map (state, gains, models, p) to the trial matrices and sums: the costly half of a pass."""
    n = structure.horizon
    z, flat = _symbols(structure), ca.MX.sym('flat', PARAMETERS)
    gains, models = ca.MX.sym('gains', 3, 7 * n), ca.MX.sym('models', 6, 9 * n)
    trial, sums = _forward(structure, z, ca.horzsplit(gains, 7), ca.horzsplit(models, 9), flat)
    return ca.Function('trial', [*z, gains, models, flat], [*trial, sums])


def pass_function(structure: Structure) -> ca.Function:
    """Map a running state and p to the next state: one backward sweep, one trial roll-out."""
    z, flat = _symbols(structure), ca.MX.sym('flat', PARAMETERS)
    old = Progress(*(z.progress[i] for i in range(len(Progress._fields))))
    gains, models, residuals = _backward(structure, z, old.exact, flat)
    converged = ca.fmax(residuals[0], residuals[1]) < TOLERANCE
    indefinite = ca.logic_not(residuals[3] > _SMALLEST_PIVOT)
    trial = _trial_function(structure)(*z, ca.horzcat(*gains), ca.horzcat(*models), flat)
    sums = trial[-1]
    merit_old = old.cost - old.mu * old.logs
    merit = sums[0] - old.mu * sums[1]
    noise = _COST_NOISE * ca.fabs(old.cost) + _BARRIER_NOISE * ca.fabs(old.mu * old.logs)
    bound = merit_old - _ARMIJO * old.alpha * residuals[2] + noise
    descends = ca.logic_and(merit <= bound, sums[2] < forward.STEP_RESIDUAL)
    accept = ca.logic_and(descends, ca.logic_not(ca.logic_or(indefinite, converged)))
    exhausted = ca.logic_and(ca.logic_not(accept), old.alpha < _SMALLEST_STEP)
    give_up_exact = ca.logic_or(indefinite, exhausted)
    ready = ca.logic_and(accept, ca.logic_and(old.alpha >= 1,
                                              residuals[2] < _BARRIER_READY * old.mu))
    shrunk = ca.fmax(SMALLEST_BARRIER,
                     ca.fmin(_BARRIER_FACTOR * old.mu, old.mu ** _BARRIER_POWER))
    flag = ca.if_else(converged, CONVERGED, ca.if_else(
        ca.logic_and(give_up_exact, old.exact <= 0), STALLED, RUNNING))
    lower = ca.if_else(old.exact > _SMALLEST_BLEND, _BLEND_DOWN * old.exact, 0)
    higher = ca.fmin(1, ca.fmax(_BLEND_UP * old.exact, _SMALLEST_BLEND))
    progress = Progress(
        mu=ca.if_else(ready, shrunk, old.mu),
        alpha=ca.if_else(give_up_exact, 1, ca.if_else(
            accept, ca.fmin(1, old.alpha / _BACKTRACK), old.alpha * _BACKTRACK)),
        cost=ca.if_else(accept, sums[0], old.cost), logs=ca.if_else(accept, sums[1], old.logs),
        stationarity=residuals[0], complementarity=residuals[1], decrease=residuals[2],
        passes=old.passes + 1, flag=flag,
        exact=ca.if_else(give_up_exact, lower, ca.if_else(accept, higher, old.exact)))
    kept = [ca.if_else(accept, new, now) if now.numel() else now
            for new, now in zip(trial[:-1], z[:-1])]
    return ca.Function('one_pass', [*z, flat], [*kept, ca.vertcat(*progress)])


def iterate_function(structure: Structure, passes: int) -> ca.Function:
    """Map a state and p to the state after at most ``passes`` passes; stops when not running."""
    z, flat = _symbols(structure), ca.MX.sym('flat', PARAMETERS)
    keep = ca.Function('keep', [*z, flat], list(z))
    step = ca.Function.if_else('step', pass_function(structure), keep)
    now = list(z)
    for _ in range(passes):
        now = step(now[-1][Progress._fields.index('flag')] == RUNNING, *now, flat)
    return ca.Function('iterate', [*z, flat], now)
