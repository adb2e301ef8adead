# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Membership in D_N: a plan of N steps that keeps every limit and ends in X_T, or none found.

An answer needs no optimum. Every iterate of the solver is a roll-out of the model by torques
strictly inside their limits, so the first iterate whose rates keep their limits and whose last
state is in the terminal set is a plan that paper (Dn_defn) asks for: the state *is* in D_N, up
to rounding. When no start of the global search leads to one, the answer is 'not found'; that is
evidence that the state is outside, not a proof (IPOPT agrees on samples, test_domain.py).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from manifold_mpc_ros.config import AttitudeMpcConfig
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc import search, sqp
from manifold_mpc_ros.mpc.attitude_mpc import VIOLATION, structure_of
from manifold_mpc_ros.mpc.build import load_functions
from manifold_mpc_ros.mpc.engine import Engine, Trajectory
from manifold_mpc_ros.mpc.scaling import Array, flat_parameters, scaling_of
from manifold_mpc_ros.theory.design import TerminalDesign
from manifold_mpc_ros.theory.manifold import tangent_basis


class Feasibility:
    """The search for one feasible plan of ``config.horizon`` steps."""

    def __init__(self, config: AttitudeMpcConfig, terminal: TerminalDesign, *,
                 backend: str = 'auto', cache_dir: str | Path | None = None) -> None:
        """Build or load the solver; raises SolverBuildError as :class:`AttitudeMpc` does."""
        config = replace(config, terminal_constraint=True)
        structure = structure_of(config)
        functions, self.backend = load_functions(structure, backend, cache_dir)
        parameters = flat_parameters(config, terminal.P, terminal.K, terminal.c)
        self._engine = Engine(structure, functions, parameters)
        self._starts = search.starts(structure, tangent_basis(config.pointing_axis_B))
        self._lean_steps = search.lean_steps(config.horizon)
        self._unit = scaling_of(config)
        limits = np.full(3, np.inf) if config.max_rate_rad_s is None else config.max_rate_rad_s
        self._most_rate = (1 + VIOLATION) * limits / self._unit.rate_rad_s

    def plan(self, R_NB: Array, omega_BN_B: Array) -> Array | None:
        """Map a state (commanded attitude: identity) to torques (N, 3) [N m], None if not found.

        The torques steer it into the terminal set within all limits.
        """
        self._set_state(R_NB, omega_BN_B)
        for start in self._starts:
            plan = self._engine.begin_slew(
                np.array(start.lean), self._lean_steps, start.long_way, search.COLD_BARRIER)
            while not self._is_feasible(plan):
                if plan.progress.flag != sqp.RUNNING or (
                        plan.progress.passes >= search.MOST_PASSES):
                    break
                plan = self._engine.iterate(sqp.PASSES_PER_CALL)
            else:
                return plan.torques * self._unit.torque_n_m
        return None

    def terminal_ratio(self, R_NB: Array, omega_BN_B: Array) -> float:
        """Return ``xi^T P xi / c`` of a state, at most 1 in X_T = D_0."""
        self._set_state(R_NB, omega_BN_B)
        nothing = np.zeros((0, 3))
        return self._engine.terminal_ratio(self._engine.begin_plan(nothing, 0.0).nodes[0])

    def _set_state(self, R_NB: Array, omega_BN_B: Array) -> None:
        """Hand a state to the solver."""
        self._engine.set_state(so3.quaternion_from_rotation(R_NB),
                               omega_BN_B * self._unit.time_s)

    def _is_feasible(self, plan: Trajectory) -> bool:
        """Return whether a roll-out keeps the rate limits at k >= 1 and ends in X_T."""
        rates, end = plan.nodes[1:, 4:7], plan.nodes[-1]
        return bool(np.all(np.abs(rates) <= self._most_rate)
                    and self._engine.terminal_ratio(end) <= 1 + VIOLATION)
