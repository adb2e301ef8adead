# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Solve times on B1 and B1b, solver by solver in turn at every tick, on one core.

Ours with the cones and without, each along its own nominal loop; the others at the states of ours
with cones, beginning from our first plan, then from their own plans, shifted.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.benchmark.constrained.peers import PEERS, Answer, Form
from manifold_mpc_ros.lab.benchmark.constrained.slews import Slew
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.target import attitude_towards

WITH, WITHOUT = 'ours, with cones', 'ours, without cones'
REPEATS = 5


def measure(slew: Slew, ticks: int, *, peers: bool) -> dict[str, Any]:
    """Return times [ms] of solvers on a slew under ideal torque: first solve and warm ones."""
    ideal = replace(slew, wheels=None)
    ours = {WITH: _Loop(ideal), WITHOUT: _Loop(replace(ideal, cones=()))}
    for _ in range(REPEATS):
        for loop in ours.values():
            loop.begin()
        for _ in range(ticks):
            for loop in ours.values():
                loop.tick()
    rows = [{'solver': name, **loop.row(ticks)} for name, loop in ours.items()]
    rows += [_peer(name, ours[WITH], ticks) for name in PEERS if peers]
    with_cones, without = (np.min(ours[name].times, axis=0)[1:] for name in (WITH, WITHOUT))
    return {'problem': slew.name, 'horizon': ideal.law['horizon'], 'rows': rows,
            'cones_cost': {'median': float(np.median(with_cones) / np.median(without)),
                           'sum': float(with_cones.sum() / without.sum())}}


class _Loop:
    """Our controller along its nominal loop, again and again; times (repeats, ticks + 1) [s]."""

    def __init__(self, slew: Slew) -> None:
        """Build it."""
        self.config = slew.config(np.eye(3))
        self.mpc = AttitudeMpc(self.config)
        self.R_ND, self._start = attitude_towards(self.config, slew.target), slew.start
        self.times: list[list[float]] = []
        self.local: list[list[float]] = []

    def begin(self) -> None:
        """Forget everything, and solve the first time, which searches."""
        self.times.append([])
        self.local.append([])
        self.mpc.reset()
        self.state = self._start, np.zeros(3)
        self.states: list[tuple[Array, Array]] = []
        self.answers: list[Any] = []
        self.tick()

    def tick(self) -> None:
        """Solve, and move on as the model does."""
        plan = self.mpc.solve(*self.state, self.R_ND)
        self.times[-1].append(plan.solve_time_s)
        self.local[-1].append(plan.local_time_s)
        self.states.append(self.state)
        self.answers.append(plan)
        self.state = plan.R_NB[1], plan.omega_BN_B[1]

    def row(self, ticks: int) -> dict[str, Any]:
        """Return what was measured: of each tick the quickest repeat."""
        call, local = (1e3 * np.min(times, axis=0) for times in (self.times, self.local))
        return {
            'first_ms': float(call[0]), 'first_passes': self.answers[0].iterations,
            **_warm(local[1:]), 'call_ms_median': float(np.median(call[1:])),
            'call_ms_p99': float(np.percentile(call[1:], 99)),
            'passes_median': float(np.median([plan.iterations for plan in self.answers[1:]])),
            'solves': ticks,
            'failures': sum(str(plan.status) != 'converged' for plan in self.answers)}


def _warm(times_ms: Array) -> dict[str, float]:
    """Return median, 99th percentile and largest."""
    return {'warm_ms_median': float(np.median(times_ms)),
            'warm_ms_p99': float(np.percentile(times_ms, 99)),
            'warm_ms_largest': float(times_ms.max())}


def _peer(name: str, ours: _Loop, ticks: int) -> dict[str, Any]:
    """Return what another solver takes at the states of ours, from our first plan on."""
    try:
        form = Form(ours.config, ours.R_ND)
        peer = PEERS[name](form)
    except (ManifoldMpcError, RuntimeError, ImportError, OSError) as error:
        return {'solver': name, 'why_not': ' '.join(str(error).split())[:200]}
    first = ours.answers[0]
    assert ours.config.max_torque_n_m is not None
    guess = _signed(np.array([form.state(R, omega) for R, omega in zip(
        first.R_NB, first.omega_BN_B)]))
    loop = _signed(np.array([form.state(R, omega) for R, omega in ours.states[:ticks + 1]]))
    answers: list[Answer] = [peer.solve(loop[0], (
        guess, first.torques_B_n_m / ours.config.max_torque_n_m))]
    answers += [peer.solve(state, None) for state in loop[1:]]
    times = 1e3 * np.array([answer.solver_s for answer in answers])
    excess = [answer.cost / plan.cost - 1.0 for answer, plan in zip(answers, ours.answers)
              if answer.converged]
    return {'solver': name, 'first_ms': float(times[0]), **_warm(times[1:]), 'solves': ticks,
            'failures': sum(not answer.converged for answer in answers),
            'passes_median': float(np.median([answer.iterations for answer in answers[1:]])),
            'cost_beside_ours': [float(min(excess)), float(max(excess))] if excess else None}


def _signed(states: Array) -> Array:
    """Return states (n, 7) with quaternions of continuous sign."""
    q = states[:, :4]
    dots = np.sum(q[1:] * q[:-1], axis=1)
    q[1:] *= np.cumprod(np.where(dots < 0.0, -1.0, 1.0))[:, None]
    return states
