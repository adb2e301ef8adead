# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Membership in D_N: a plan of N steps that keeps every limit and ends in X_T, or none found.

An answer needs no optimum. Every iterate of the solver is a roll-out of the model by torques
strictly inside their limits, so the first iterate whose rates keep their limits, whose attitudes
keep the cones as tightened, and whose last state is in the terminal set is a plan that paper
(Dn_defn) asks for: the state *is* in D_N, up to rounding. When no start of the global search leads
to one, the controller itself is asked, so that both say the same; where it is 'infeasible', the
answer is 'not found', which is evidence that the state is outside, not a proof (IPOPT agrees on
samples, test_domain.py).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from manifold_mpc_ros.config.cones import joined
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program import options
from manifold_mpc_ros.mpc.scaling import scaling_of
from manifold_mpc_ros.mpc.solution import SolveStatus
from manifold_mpc_ros.terminal.design import TerminalDesign


class Feasibility:
    """The search for one feasible plan of ``config.horizon`` steps."""

    def __init__(self, config: AttitudeMpcConfig, terminal: TerminalDesign, *,
                 backend: str = 'auto', cache_dir: str | Path | None = None) -> None:
        """Build or load the solver; raises SolverBuildError as :class:`AttitudeMpc` does."""
        config = self._config = replace(config, terminal_constraint=True)
        self._mpc = AttitudeMpc(config, backend=backend, cache_dir=cache_dir, terminal=terminal)
        self._solver, self.backend = self._mpc.solver, self._mpc.backend
        self._unit = scaling_of(config)
        self._limits, self._cones = config.planned.rate_limits, config.kept_cones

    def plan(self, R_NB: Array, omega_BN_B: Array) -> Array | None:
        """Map a state (commanded attitude: identity) to torques (N, 3) [N m], None if not found.

        The torques steer it into the terminal set within all limits.
        """
        self._solver.set_state(R_NB, np.eye(3), omega_BN_B * self._unit.time_s)
        for start in self._solver.starts:
            self._solver.begin(start, self._solver.slew_steps)
            while not self._is_feasible():
                progress = self._solver.progress
                if progress.flag != options.RUNNING or progress.passes >= options.MOST_PASSES:
                    break
                self._solver.iterate(progress.passes + options.LOOK_PASSES)
            else:
                return self._solver.field(f.TORQUE)[:-1] * self._unit.torque_n_m
        self._mpc.reset()
        solution = self._mpc.solve(R_NB, omega_BN_B)
        found = solution.status in (SolveStatus.CONVERGED, SolveStatus.FEASIBLE)
        return solution.torques_B_n_m if found else None

    def terminal_ratio(self, R_NB: Array, omega_BN_B: Array) -> float:
        """Return ``xi^T P xi / c`` of a state, at most 1 in X_T = D_0."""
        self._solver.set_state(R_NB, np.eye(3), omega_BN_B * self._unit.time_s)
        self._solver.begin(self._solver.starts[0], 0.0)
        return self._solver.report().first_level

    def _is_feasible(self) -> bool:
        """Return whether a roll-out keeps cones, rate limits at k >= 1, and ends in X_T."""
        report, poses = self._solver.report(), self._solver.poses()
        R_NB = poses[:, :9].reshape(-1, 3, 3)
        margins = np.array([cone.margins_rad(R_NB) for cone in self._cones])
        if any(each.min() < -options.VIOLATION
               for each in joined(self._cones, margins).values()):
            return False
        rates = poses[1:, 9:].T * self._unit.rate_rad_s
        values = [value for limit in self._limits for value in limit.values(rates)]
        return bool(np.all(np.array(values) <= options.VIOLATION)
                    and report.last_level <= 1 + options.VIOLATION)
