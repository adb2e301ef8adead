# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The attitude controller: a configuration in, a torque per measured state out."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.backends.build import load_solver
from manifold_mpc_ros.mpc.cone_keeper import ConeKeeper
from manifold_mpc_ros.mpc.local_solver import LocalSolver, Plan, StateReport
from manifold_mpc_ros.mpc.plan_finder import VIOLATION, PlanFinder
from manifold_mpc_ros.mpc.program.numbers import numbers_of
from manifold_mpc_ros.mpc.reference import (
    LEAST_SHARE,
    ROTATION_DEFECT,
    Reference,
    ReferenceNumbers,
    numbers_of_reference,
)
from manifold_mpc_ros.mpc.scaling import scaling_of
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus, failed, with_wheels
from manifold_mpc_ros.mpc.stages.inequalities import structure_of
from manifold_mpc_ros.mpc.stored_design import stored_design
from manifold_mpc_ros.mpc.target import error_angle
from manifold_mpc_ros.mpc.wheel_keeper import WheelKeeper
from manifold_mpc_ros.terminal.design import TerminalDesign

# A level that no state exceeds: the terminal set is then not there.
NO_LEVEL = 1e12
# A commanded attitude that moved by more than this [rad] forgets the warm start.
SETPOINT_MOVED_RAD = 1e-3
_IDENTITY = np.eye(3)


class AttitudeMpc:
    """Model predictive control on SO(3), paper eq. (mpcopt) with the LGVI as its model.

    ``solve`` maps a measured (R_NB, omega_BN_B) and a commanded R_ND to the plan that minimises

        sum_k tr(Qg (I - g_k)) + tr(Qf (I - f_k)) / h^2 + tr(u_k^T R u_k) / 2 + xi_N^T P xi_N / 2

    with ``g = R_ND^T R_NB``, subject to torque limits, rate limits at k >= 1 and the terminal
    set. Outside D_N, where no plan meets them all, the terminal set is dropped, the rate limits
    are violated as little as an exact penalty says, torque limits still hold, and the status
    is 'infeasible'. From a cold start the search covers both sides of the 180 degree set and the
    torque octants; later ticks improve the shifted plan, which keeps the side of the turn, and
    search again only when the plan's value exceeds the bound V - L of the last one with more than
    90 degrees left to turn, or when it does not converge. With cones the search also goes round
    those that hold its best plan back, and runs again when a cone breaks a plan that kept it. A
    commanded attitude that a cone forbids is held off: plans end as near as cones let it.
    """

    def __init__(self, config: AttitudeMpcConfig, *, backend: str = 'auto',
                 cache_dir: str | Path | None = None,
                 terminal: TerminalDesign | None = None, disturbed: bool = False,
                 moving: bool = False) -> None:
        """Design the terminal set, then build or load the solver (seconds at the first start).

        ``terminal`` is the design where the caller has it already (horizon and cones aside).
        ``disturbed`` and ``moving``: take disturbance torques and references without building the
        solver again when the first one is given.

        Raises
        ------
        DesignError
            When the terminal design does not exist.
        SolverBuildError
            When the solver cannot be compiled.

        """
        self.config = config
        self.terminal: TerminalDesign = terminal or stored_design(config, cache_dir)
        self._unit = scaling_of(config)
        self._built_with = backend, cache_dir
        self._disturbance, self._reference = np.zeros(3), numbers_of_reference(
            Reference.fixed(_IDENTITY, config.horizon), config)
        self._ahead: Array | None = None  # foreseen attitudes of a reference
        self._build(disturbed=disturbed, moving=moving)
        inertia = config.inertia_kg_m2 / (self._unit.torque_n_m * self._unit.time_s ** 2)
        self._guard_squared = float(np.linalg.eigvalsh(inertia)[0]) ** 2
        self._R_ND = _IDENTITY

    def _build(self, *, disturbed: bool, moving: bool) -> None:
        """Load the solver and allocate its memory."""
        config, self._disturbed, self._moving = self.config, disturbed, moving
        structure = structure_of(config, disturbed=disturbed, moving=moving)
        make, self.backend = load_solver(structure, config.horizon, *self._built_with)

        def solver_within(level: float) -> LocalSolver:
            return make(numbers_of(config, self.terminal, level, structure))

        self._strict = solver_within(self.terminal.c)
        self._relaxed = solver_within(NO_LEVEL) if config.terminal_constraint else self._strict
        self._cones = ConeKeeper(config, self.terminal, self._strict, self._relaxed)
        self._wheels = WheelKeeper(config, self.terminal, {self._strict, self._relaxed})
        self._finder = PlanFinder(config, self._strict, self._relaxed, self._cones)
        if moving:
            self._set_reference(self._reference)

    def reset(self) -> None:
        """Forget the warm start; the next solve searches globally."""
        self._finder.reset()

    def solve(self, R_NB: ArrayLike, omega_BN_B: ArrayLike, R_ND: ArrayLike | None = None, *,
              disturbance_B_n_m: ArrayLike | None = None, max_solve_time_s: float | None = None,
              directions_N: Mapping[str, ArrayLike] | None = None,
              wheel_momentum_n_m_s: ArrayLike | None = None, reference: Reference | None = None,
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
        disturbance_B_n_m
            Torque d (3,) that acts unasked, below the torque limits [N m]; none when None. The
            plan is made in the net torque u, which the cost weighs, with ``u - d`` within the
            limits; the torques of the solution are the commands ``u - d``. The terminal level
            is cut by the square of ``min_i (1 - |d_i| / max_torque_i)``, for the local law.
        max_solve_time_s
            Time [s] after which no pass and no start begins: the best plan so far is the answer,
            'feasible', or 'infeasible' when none has met every limit yet. None: no end.
        directions_N
            Directions of cones by name, (3,), or (N + 1, 3) one a node; the others as configured.
        wheel_momentum_n_m_s
            Momenta (n,) of the wheels, NaN for one that is not there (it keeps its last); at rest
            when None. The solution then has motor torques.
        reference
            A target that moves, in place of R_ND; what it uses of the limits, terminal sets lose.

        Raises ConfigurationError for an array of another shape or an unknown name, a direction
        that moves so far in a step that nothing is left of its cone, or a disturbance that is not
        below the limits; what a state holds is judged by the status.

        """
        begin = time.perf_counter()
        deadline_s = math.inf if max_solve_time_s is None else time.monotonic() + max_solve_time_s
        self._disturb(disturbance_B_n_m)
        self._cones.set_directions(directions_N)
        if reference is not None or self._moving:
            R_ND = self._track(reference, np.asarray(R_NB, dtype=float), R_ND)
        state = self._set_state(R_NB, omega_BN_B, R_ND, wheel_momentum_n_m_s)
        self._ahead = None if reference is None else reference.R_ND[:2]
        if state is None:
            self.reset()
            return failed(R_NB, omega_BN_B, self.config.horizon, time.perf_counter() - begin)
        plan, passes, searched = self._finder.find(state, deadline_s)
        answer = self._answer(plan, passes, searched, begin)
        return answer if wheel_momentum_n_m_s is None else with_wheels(
            answer, self.config, self._wheels.working, self._wheels.momentum_n_m_s)

    def solve_local(self, R_NB: ArrayLike, omega_BN_B: ArrayLike) -> AttitudeMpcSolution:
        """Map a measured state to the plan of one cold start, the short way; for measuring."""
        begin = time.perf_counter()
        if self._set_state(R_NB, omega_BN_B, None, None) is None:
            return failed(R_NB, omega_BN_B, self.config.horizon, time.perf_counter() - begin)
        plan, passes = self._finder.first_start()
        return self._answer(plan, passes, False, begin)

    def _set_state(self, R_NB: ArrayLike, omega_BN_B: ArrayLike, R_ND: ArrayLike | None,
                   wheel_momentum_n_m_s: ArrayLike | None) -> StateReport | None:
        """Hand a state to the solvers; None when it cannot be predicted from."""
        attitude = self._R_NB = np.asarray(R_NB, dtype=float)
        omega = self._omega = np.asarray(omega_BN_B, dtype=float)
        target = _IDENTITY if R_ND is None else np.asarray(R_ND, dtype=float)
        for name, value, shape in (('R_NB', attitude, (3, 3)), ('omega_BN_B', omega, (3,)),
                                   ('R_ND', target, (3, 3))):
            if value.shape != shape:
                raise ConfigurationError(name, value.shape, f'an array of shape {shape}')
        rate, self._begun_s = omega * self._unit.time_s, self._elapsed_s()
        state = self._strict.set_state(attitude, target, rate)
        if state.defect > ROTATION_DEFECT or state.momentum_squared >= self._guard_squared:
            return None
        if self._relaxed is not self._strict:
            self._relaxed.set_state(attitude, target, rate)
        if target is not self._R_ND and not np.array_equal(target, self._R_ND):
            self._aim(target)
        if self.config.wheels is not None:
            self._cones.leave(self.terminal_share * self._wheels.hold(
                wheel_momentum_n_m_s, attitude, omega, target, self._disturbance))
        return state

    @property
    def target_margins_rad(self) -> dict[str, float]:
        """By which angle the commanded attitude keeps each cone [rad]; negative: it is missing."""
        return self._cones.target_margins_rad

    def _disturb(self, disturbance_B_n_m: ArrayLike | None) -> None:
        """Plan in the net torque under this disturbance (3,) [N m] from now on."""
        if disturbance_B_n_m is None and not self._disturbance.any():
            return
        limit = self.config.max_torque_n_m
        bound = np.full(3, np.inf) if limit is None else limit
        d = np.zeros(3) if disturbance_B_n_m is None else np.array(disturbance_B_n_m, dtype=float)
        if d.shape != (3,) or not (np.abs(d) < bound).all():
            raise ConfigurationError('disturbance_B_n_m', d.tolist(),
                                     '3 finite numbers, each below the torque limit')
        changed, self._disturbance = not np.array_equal(d, self._disturbance), d
        if limit is not None and changed:
            if not self._disturbed:
                self._build(disturbed=True, moving=self._moving)
                self._cones.aim(self._R_ND)
            for solver in {self._strict, self._relaxed}:
                solver.disturb(d / self._unit.torque_n_m)
            self._cones.leave(self.terminal_share)

    def _track(self, reference: Reference | None, R_NB: Array, R_ND: ArrayLike | None
               ) -> ArrayLike | None:
        """Plan about a reference from now on; return its first attitude, R_ND without one."""
        if reference is None and self._ahead is None:
            return R_ND
        if reference is not None and self.config.target == 'pointing' and R_NB.shape == (3, 3):
            reference = reference.rolled(self.config.pointing_axis_B, R_NB)
        still = Reference.fixed(_IDENTITY, self.config.horizon)
        self._reference = numbers_of_reference(reference or still, self.config)
        if not self._moving:
            self._build(disturbed=self._disturbed, moving=True)
            self._cones.aim(self._R_ND)
        self._set_reference(self._reference)
        self._cones.leave(self.terminal_share)
        return R_ND if reference is None else reference.R_ND[0]

    def _set_reference(self, numbers: ReferenceNumbers) -> None:
        """Hand a reference to the solvers."""
        for solver in {self._strict, self._relaxed}:
            solver.set_reference(numbers.nodes)

    @property
    def limits_used(self) -> float:
        """The largest part of a torque or rate limit that disturbance and reference use."""
        limit = self.config.max_torque_n_m
        acting = np.abs(self._disturbance) / (np.inf if limit is None else limit)
        return max(float((self._reference.torque_share + acting).max()),
                   self._reference.rate_share)

    @property
    def terminal_share(self) -> float:
        """The part of the terminal level that they leave; of less than the least, no promise."""
        return max(LEAST_SHARE, 1.0 - self.limits_used) ** 2

    def _aim(self, target: Array) -> None:
        """Forget the warm start where the commanded attitude moved otherwise than foreseen."""
        foreseen, allowed = [self._R_ND], SETPOINT_MOVED_RAD
        if self._ahead is not None:
            foreseen = list(self._ahead)
            allowed += float(error_angle(self.config, foreseen[0].T @ foreseen[1]))
        if min(error_angle(self.config, target.T @ each) for each in foreseen) > allowed:
            self.reset()
        self._R_ND = target if target is _IDENTITY else target.copy()
        self._cones.aim(self._R_ND)

    def _answer(self, plan: Plan | None, passes: int, searched: bool, begin: float
                ) -> AttitudeMpcSolution:
        """Keep a plan for the next tick and return it in SI units."""
        if plan is None:
            self.reset()
            return failed(self._R_NB, self._omega, self.config.horizon,
                          time.perf_counter() - begin)
        report, unit = self._strict.report(plan), self._unit
        self._finder.keep(plan, report)
        cost = plan.progress.cost - report.penalties
        torques, poses = plan.torques * unit.torque_n_m, self._strict.poses()
        if self._disturbance.any():
            torques -= self._disturbance
        violation = max(report.violation, self._finder.missed(report))
        return AttitudeMpcSolution(
            torque_B_n_m=torques[0].copy(), torques_B_n_m=torques,
            R_NB=poses[:, :9].reshape(-1, 3, 3), omega_BN_B=poses[:, 9:] * unit.rate_rad_s,
            cost=cost * unit.cost, iterations=passes, solve_time_s=time.perf_counter() - begin,
            status=self._status(plan, violation), kkt_residual=plan.progress.residual,
            violation=violation, searched=searched,
            promised_cost=(cost - report.first_cost) * unit.cost,
            terminal_ratio=report.first_level, local_time_s=self._elapsed_s() - self._begun_s,
            limits_used=self.limits_used)

    def _elapsed_s(self) -> float:
        """Return the time that the local solvers have taken so far [s]."""
        return sum(solver.elapsed_s for solver in {self._strict, self._relaxed})

    def _status(self, plan: Plan, violation: float) -> SolveStatus:
        """Return how a solve ended."""
        if violation > VIOLATION or not self._finder.inside:
            return SolveStatus.INFEASIBLE
        return SolveStatus.CONVERGED if plan.progress.converged else SolveStatus.FEASIBLE
