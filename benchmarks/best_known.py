# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The best known plan of an instance: many starts of our own, and many of IPOPT.

The starts of our own: both ways round and octants of first torque, held for three parts of the
slew; and random first torques; by no rule of the search. All
without the terminal set, and with it on short horizons and where the best plan misses it. IPOPT
solves an independent formulation, with the attitudes as unknowns besides the steps, so that its
Hessian stays sparse on long horizons.
"""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from oracle_starts import best

from manifold_mpc_ros import AttitudeMpc
from manifold_mpc_ros.lab.benchmark.peers.oracle import Optimum, Oracle, Steps
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.program import options
from manifold_mpc_ros.mpc.scaling import scaling_of

LEAN_PARTS = (0.08, 0.25, 0.45)
RANDOM_STARTS = 24
# The terminal set is asked too up to this horizon.
BOTH_HORIZON = 60
# A start ends where after so many passes it costs so many times the best.
HOPELESS_PASSES, HOPELESS = 40, 2.5
TIE = 1e-9
# Starts of IPOPT: octants of first torque and random torques, besides both ways round.
OCTANTS, RANDOM_TORQUES = 8, 8


class ManyStarts:
    """The best plan into the terminal set over a wide field of starts."""

    def __init__(self, mpc: AttitudeMpc) -> None:
        """Take a controller's solver."""
        self._solver, self._unit = mpc.solver, scaling_of(mpc.config)

    def best(self, R: Array, rng: np.random.Generator) -> float:
        """Return the least cost from rest over all starts whose plan is feasible, else inf."""
        field = [(LEAN_PARTS[0], (0.0, 0.0, 0.0, long_way)) for long_way in (0.0, 1.0)]
        field += [(part, (*octant, long_way)) for part, octant, long_way in itertools.product(
            LEAN_PARTS, itertools.product((1.0, -1.0), repeat=3), (0.0, 1.0))]
        field += [(float(rng.uniform(0.04, 0.7)),
                   (*rng.uniform(-1.0, 1.0, size=3), float(rng.integers(2))))
                  for _ in range(RANDOM_STARTS)]
        inside, any_end = self._costs(False, R, field)
        if self._solver.horizon <= BOTH_HORIZON or inside > any_end * (1 + TIE):
            inside = min(inside, self._costs(True, R, field)[0])
        return inside * self._unit.cost

    def _costs(self, with_set: bool, R: Array, field: list[tuple[float, tuple[float, ...]]]
               ) -> tuple[float, float]:
        """Return the least cost of a plan that ends in the terminal set, and of any."""
        solver, inside, any_end = self._solver, np.inf, np.inf
        solver.set_state(R, np.eye(3), np.zeros(3))
        solver.use_set(with_set)
        for part, start in field:
            solver.begin(np.array(start), solver.slew_steps * part / options.LEAN_PART)
            solver.iterate(HOPELESS_PASSES)
            if solver.progress.cost > HOPELESS * any_end:
                continue
            solver.iterate(options.MOST_PASSES)
            report = solver.report()
            cost = solver.progress.cost - report.penalties
            solver.use_set(with_set)
            if report.violation <= options.VIOLATION:
                any_end = min(any_end, cost)
                if report.last_level - 1 <= options.VIOLATION:
                    inside = min(inside, cost)
        return inside, any_end


class SparseOracle(Oracle):
    """IPOPT on the oracle's formulation with the quaternions of the attitudes as unknowns too."""

    def _advance(self, problem: Any, k: int, q: ca.SX, rate: ca.SX
                 ) -> tuple[ca.SX, ca.SX, ca.SX]:
        turned, after, torque = super()._advance(problem, k, q, rate)
        attitude = ca.SX.sym(f'q{k + 1}', 4)
        problem.unknowns.append(attitude)
        problem.require(attitude - turned, np.zeros(4), np.zeros(4))
        return attitude, after, torque

    def solve(self, R_NB: Array, omega_BN_B: Array, start: Steps, *, polish: bool = False
              ) -> Optimum:
        """Return the local optimum that IPOPT reaches from rest and a starting trajectory."""
        assert not polish
        assert not omega_BN_B.any()
        q = so3.quaternion_from_rotation(R_NB)
        attitudes, state = [], np.concatenate([q, np.zeros(3)])
        for c in start.turns:
            w, v = q[0], q[1:]
            q = np.concatenate([[w - v @ c], v + w * c + np.cross(v, c)]) / np.sqrt(1 + c @ c)
            attitudes.append(q)
        guess = np.hstack([start.turns, start.rates[1:], np.array(attitudes)]).ravel()
        result = self._cold(x0=guess, p=state, **self._bounds)
        found = float(result['f']) if self._cold.stats()['success'] else np.inf
        return Optimum(found, np.array(self._torques(result['x'], state)).T)


def of_ipopt(mpc: AttitudeMpc, R: Array, rng: np.random.Generator) -> float:
    """Return the least cost from rest that IPOPT finds from 18 starts, else inf."""
    oracle = SparseOracle(mpc.config, mpc.terminal.P, mpc.terminal.c)
    return best(oracle, R, np.zeros(3), rng, octants=OCTANTS, randoms=RANDOM_TORQUES).cost


class Known:
    """The file of best known costs: lines of number, horizon, who found it, and the cost."""

    def __init__(self, path: Path) -> None:
        """Read what is there; a line that was cut off ends it."""
        self._path, self._costs = path, {}
        for line in path.read_text(encoding='utf-8').splitlines() if path.exists() else ():
            try:
                row = json.loads(line)
            except ValueError:
                break
            self._costs[row['number'], row['horizon'], row['by']] = row['cost']

    def has(self, number: int, horizon: int, by: str) -> bool:
        """Return whether a cost is there, also one that says that nothing was found."""
        return (number, horizon, by) in self._costs

    def add(self, number: int, horizon: int, by: str, cost: float) -> None:
        """Append a line."""
        row = {'number': number, 'horizon': horizon, 'by': by,
               'cost': cost if np.isfinite(cost) else None}
        self._costs[number, horizon, by] = row['cost']
        with self._path.open('a', encoding='utf-8') as file:
            file.write(json.dumps(row) + '\n')

    def rows(self) -> list[tuple[int, int]]:
        """Return number and horizon of what our own starts have solved, sorted."""
        return sorted({(number, horizon) for number, horizon, by in self._costs if horizon})

    def best(self, number: int, horizon: int) -> float | None:
        """Return the least cost known for a horizon or a shorter one of the instance."""
        costs = [cost for (n, h, _), cost in self._costs.items()
                 if n == number and h <= horizon and cost is not None]
        return min(costs, default=None)
