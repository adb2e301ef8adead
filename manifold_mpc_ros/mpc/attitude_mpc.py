# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The attitude controller: a configuration in, a torque per measured state out."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.config import AttitudeMpcConfig
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc import search
from manifold_mpc_ros.mpc.build import load_functions
from manifold_mpc_ros.mpc.engine import Engine, Trajectory
from manifold_mpc_ros.mpc.scaling import Array, flat_parameters, scaling_of
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus
from manifold_mpc_ros.mpc.structure import Structure
from manifold_mpc_ros.mpc.target import error_angle
from manifold_mpc_ros.problems.registry import terminal_design
from manifold_mpc_ros.theory.design import TerminalDesign
from manifold_mpc_ros.theory.manifold import tangent_basis

# Barrier parameter of a warm start.
WARM_BARRIER = 1e-3
# A level that no state exceeds: the terminal set is then not there.
NO_LEVEL = 1e12
# A relative violation of a state limit above this makes a plan infeasible.
VIOLATION = 1e-6
# The warm plan is kept while its value stays within this of what the last plan promised, and
# always when less than this angle [rad] is left to turn: no other side can win there.
PROMISE = 1e-2
SEARCH_ANGLE_RAD = np.pi / 2
# A commanded attitude that moved by more than this [rad] forgets the warm start.
SETPOINT_MOVED_RAD = 1e-3


def _reaches_set(plan: Trajectory) -> bool:
    """Return whether a plan ends in the terminal set."""
    return plan.terminal_violation <= VIOLATION


def structure_of(config: AttitudeMpcConfig) -> Structure:
    """Map a configuration to the structure that its solver is generated for."""
    return Structure(config.horizon, config.forcing == 'symmetric',
                     config.max_torque_n_m is not None, config.max_rate_rad_s is not None,
                     config.terminal_constraint, config.target == 'pointing')


class AttitudeMpc:
    """Model predictive control on SO(3), paper eq. (mpcopt) with the LGVI as its model.

    ``solve`` maps a measured (R_NB, omega_BN_B) and a commanded R_ND to the plan that minimises

        sum_k tr(Qg (I - g_k)) + tr(Qf (I - f_k)) / h^2 + tr(u_k^T R u_k) / 2 + xi_N^T P xi_N / 2

    with ``g = R_ND^T R_NB``, subject to torque limits, rate limits at k >= 1 and the terminal
    set. Outside D_N, where no plan meets them all, the terminal set is dropped, the rate limits
    are violated as little as an exact penalty says, torque limits still hold, and the status
    is 'infeasible'. From a cold start the
    search covers both sides of the 180 degree set and the torque octants; later ticks improve
    the shifted plan, which keeps the side of the turn, and search again only when the plan's
    value breaks the decrease promised by the last one with more than 90 degrees left to turn,
    or when it does not converge.
    """

    def __init__(self, config: AttitudeMpcConfig, *, backend: str = 'auto',
                 cache_dir: str | Path | None = None,
                 terminal: TerminalDesign | None = None) -> None:
        """Design the terminal set, then build or load the solver (seconds at the first start).

        ``terminal`` is the design where the caller has it already (it does not depend on the
        horizon).

        Raises
        ------
        DesignError
            When the terminal design does not exist.
        SolverBuildError
            When ``backend='c'`` and the solver cannot be compiled.

        """
        self.config = config
        self.terminal: TerminalDesign = terminal or terminal_design(config)
        self._unit = scaling_of(config)
        structure = structure_of(config)
        parameters = flat_parameters(config, self.terminal.P, self.terminal.K, self.terminal.c)
        functions, self.backend = load_functions(structure, backend, cache_dir)
        self._strict = Engine(structure, functions, parameters)
        self._relaxed = self._strict
        if structure.terminal_set:
            unbounded = flat_parameters(config, self.terminal.P, self.terminal.K, NO_LEVEL)
            self._relaxed = Engine(structure, functions, unbounded)
        self._starts = search.starts(structure, tangent_basis(config.pointing_axis_B))
        self._pool = [Trajectory(structure) for _ in self._starts]
        self._plan = Trajectory(structure)
        self._shifted = Trajectory(structure)
        self._guard = float(np.linalg.eigvalsh(config.inertia_kg_m2)[0])
        self._R_ND = np.eye(3)
        self._promised: float | None = None
        self._inside = True

    def reset(self) -> None:
        """Forget the warm start; the next solve searches globally."""
        self._promised = None

    def solve(self, R_NB: ArrayLike, omega_BN_B: ArrayLike, R_ND: ArrayLike | None = None
              ) -> AttitudeMpcSolution:
        """Map a measured state to a plan.

        Arguments
        ---------
        R_NB
            Attitude (3, 3), body components to inertial ones.
        omega_BN_B
            Body rate (3,) [rad/s].
        R_ND
            Commanded attitude (3, 3); the identity when None.

        """
        begin = time.perf_counter()
        attitude, omega = np.asarray(R_NB, dtype=float), np.asarray(omega_BN_B, dtype=float)
        target = np.eye(3) if R_ND is None else np.asarray(R_ND, dtype=float)
        if not self._predictable(attitude, omega, target):
            self.reset()
            return self._failed(attitude, omega, time.perf_counter() - begin)
        if not np.array_equal(target, self._R_ND) and (
                error_angle(self.config, target.T @ self._R_ND) > SETPOINT_MOVED_RAD):
            self.reset()
        self._R_ND = target
        error = so3.attitude_error_B(target, attitude)
        quaternion = so3.quaternion_from_rotation(error)
        for engine in (self._strict, self._relaxed):
            engine.set_state(quaternion, omega * self._unit.time_s)
        near = bool(error_angle(self.config, error) < SEARCH_ANGLE_RAD)
        plan, passes, searched = self._find_plan(near)
        if plan is None:
            self.reset()
            return self._failed(attitude, omega, time.perf_counter() - begin)
        self._plan.copy_from(plan)
        first = self._strict.stage_cost(plan.nodes[0], plan.torques[0])
        self._promised = float(plan.progress.cost) - first
        return self._report(passes, searched, first, begin)

    def _find_plan(self, near: bool) -> tuple[Trajectory | None, int, bool]:
        """Return the plan, the passes used, and whether the global search ran.

        First with the terminal set; when that cannot be reached, without it. From outside D_N
        the set is tried again at every tick, from the shifted plan only.
        """
        was_inside, passes, searched = self._inside, 0, False
        if self._promised is not None:
            plan, passes = self._improve(self._strict)
            if plan is not None and _reaches_set(plan) and (
                    near or not was_inside or self._keeps_promise(plan)):
                self._inside = True
                return plan, passes, False
        if self._promised is None or was_inside:
            plan, more = self._search(self._strict)
            passes, searched = passes + more, True
            if self._relaxed is self._strict or (plan is not None and _reaches_set(plan)):
                self._inside = True
                return plan, passes, True
        self._inside = False
        if self._promised is not None:
            plan, more = self._improve(self._relaxed)
            passes += more
            if plan is not None and (near or self._keeps_promise(plan)):
                return plan, passes, searched
        plan, more = self._search(self._relaxed)
        return plan, passes + more, True

    def _improve(self, engine: Engine) -> tuple[Trajectory | None, int]:
        """Return the converged plan that starts from the shifted one, or None; and its passes."""
        shifted = self._plan.torques[1:]
        self._shifted.copy_from(engine.begin_plan(shifted, 0.0))
        engine.begin_plan(shifted, WARM_BARRIER)
        plan = engine.iterate(search.MOST_PASSES)
        return plan if search.is_converged(plan) else None, int(plan.progress.passes)

    def _search(self, engine: Engine) -> tuple[Trajectory | None, int]:
        """Return the best of the global search and the shifted plan, and the passes it took."""
        best, passes = search.global_search(engine, self._starts, self._pool)
        if best is not None and self._promised is not None and (
                self._shifted.progress.cost < best.progress.cost):
            best = self._shifted
        return best, passes

    def _keeps_promise(self, plan: Trajectory) -> bool:
        """Return whether a plan's value (with penalties) is what the last plan promised."""
        assert self._promised is not None
        bound = self._promised + PROMISE * max(abs(self._promised), 1e-3)
        return bool(plan.progress.cost <= bound)

    def _predictable(self, attitude: Array, omega: Array, target: Array) -> bool:
        """Return whether the state is finite, on SO(3), and inside the existence guard."""
        if not all(np.isfinite(value).all() for value in (attitude, omega, target)):
            return False
        if not (so3.is_rotation(attitude, 1e-6) and so3.is_rotation(target, 1e-6)):
            return False
        momentum = self.config.step_s * self.config.inertia_kg_m2 @ omega
        return bool(np.linalg.norm(momentum) < self._guard)

    def _report(self, passes: int, searched: bool, first: float, begin: float
                ) -> AttitudeMpcSolution:
        """Return the current plan, whose first stage costs ``first``, in SI units."""
        plan, unit = self._plan, self._unit
        torques = plan.torques * unit.torque_n_m
        violation = max(float(np.max(plan.rate_violations, initial=0.0)),
                        plan.terminal_violation if self._inside
                        else self._strict.terminal_ratio(plan.nodes[-1]) - 1)
        status = SolveStatus.FEASIBLE
        if violation > VIOLATION or not self._inside:
            status = SolveStatus.INFEASIBLE
        elif search.is_converged(plan):
            status = SolveStatus.CONVERGED
        return AttitudeMpcSolution(
            torque_B_n_m=torques[0].copy(), torques_B_n_m=torques,
            R_NB=self._R_ND @ so3.rotation_from_quaternion(plan.nodes[:, 0:4]),
            omega_BN_B=plan.nodes[:, 4:7] * unit.rate_rad_s, cost=plan.cost * unit.cost,
            iterations=passes, solve_time_s=time.perf_counter() - begin, status=status,
            kkt_residual=search.residual(plan), violation=violation, searched=searched,
            promised_cost=(plan.cost - first) * unit.cost,
            terminal_ratio=self._strict.terminal_ratio(plan.nodes[0]))

    def _failed(self, attitude: Array, omega: Array, elapsed_s: float) -> AttitudeMpcSolution:
        """Return the zero plan for a state that cannot be predicted from."""
        n = self.config.horizon
        return AttitudeMpcSolution(
            np.zeros(3), np.zeros((n, 3)), np.tile(attitude, (n + 1, 1, 1)),
            np.tile(omega, (n + 1, 1)), float('nan'), 0, elapsed_s, SolveStatus.FAILED,
            float('inf'), float('inf'), False, float('nan'), float('nan'))
