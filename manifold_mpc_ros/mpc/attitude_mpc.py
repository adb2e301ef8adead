# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The attitude controller: a configuration in, a torque per measured state out."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.backends.build import load_library
from manifold_mpc_ros.mpc.compiled import CompiledMpc
from manifold_mpc_ros.mpc.cone_keeper import ConeKeeper
from manifold_mpc_ros.mpc.program.numbers import numbers_of
from manifold_mpc_ros.mpc.reference import LEAST_SHARE, Reference, Shares
from manifold_mpc_ros.mpc.scaling import scaling_of
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus, failed
from manifold_mpc_ros.mpc.stages.inequalities import structure_of
from manifold_mpc_ros.mpc.stored_design import stored_design
from manifold_mpc_ros.mpc.wheel_keeper import WheelKeeper
from manifold_mpc_ros.terminal.design import TerminalDesign

_IDENTITY = np.eye(3)
# In the order of search.c.
_STATUSES = tuple(SolveStatus)
_FAILED = _STATUSES.index(SolveStatus.FAILED)


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
        self._tracked = self._acting = False
        self._disturbance, self._acting_share = np.zeros(3), [0.0] * 3
        self._still = self._reference = Reference.fixed(_IDENTITY, config.horizon)
        self._shares, self._R_ND = Shares(config), _IDENTITY
        self.backend = 'c'
        self._build(backend, cache_dir, disturbed=disturbed, moving=moving)

    def _build(self, backend: str, cache_dir: str | Path | None, *, disturbed: bool,
               moving: bool) -> None:
        """Load the solver and allocate its memory."""
        config, self._disturbed, self._moving = self.config, disturbed, moving
        structure = structure_of(config, disturbed=disturbed, moving=moving)
        library = load_library(structure, backend, cache_dir)
        self.solver = CompiledMpc(library, structure, config, numbers_of(
            config.planned, self.terminal, self.terminal.c, structure))
        self._build_again = functools.partial(self._build, backend, cache_dir)
        self._cones = ConeKeeper(config, self.terminal, self.solver)
        self._wheels = WheelKeeper(config, self.terminal, self.solver)
        self._cones.aim(self._R_ND)
        self.solver.disturb(self._disturbance)
        if moving:
            self._follow()
        if self._tracked:
            self.solver.set_rate_limits(config.within_rate_margins)

    def reset(self) -> None:
        """Forget the warm start; the next solve searches globally."""
        self.solver.reset()
        self._wheels.reset()

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
        if disturbance_B_n_m is not None or self._acting:
            self._disturb(disturbance_B_n_m)
        if self.config.cones or directions_N:
            self._cones.set_directions(directions_N)
        if reference is not None or self._moving:
            R_ND = self._track(reference, np.asarray(R_NB, dtype=float), R_ND)
        state = _checked(R_NB, omega_BN_B, R_ND)
        answer = self._answer(*state, wheel_momentum_n_m_s, begin, deadline_s)
        if reference is not None:
            self.solver.foresee(reference.R_ND[1])
        return answer if wheel_momentum_n_m_s is None else answer._replace(
            wheel_torque_n_m=self._wheels.motor_torques(answer))

    def solve_local(self, R_NB: ArrayLike, omega_BN_B: ArrayLike) -> AttitudeMpcSolution:
        """Map a measured state to the plan of one cold start, the short way; for measuring."""
        begin, state = time.perf_counter(), _checked(R_NB, omega_BN_B, None)
        return self._answer(*state, None, begin, math.inf, local=True)

    def _answer(self, R_NB: Array, omega: Array, R_ND: Array,
                wheel_momentum_n_m_s: ArrayLike | None, begin: float, deadline_s: float, *,
                local: bool = False) -> AttitudeMpcSolution:
        """Return the solver's answer to a state."""
        if self.config.cones:
            self._aim(R_NB, omega, R_ND)
        if self.config.wheels is not None:
            self._cones.leave(self.terminal_share * self._wheels.hold(
                wheel_momentum_n_m_s, R_NB, omega, R_ND, self._disturbance))
        head, torques, attitudes, rates = self.solver.answer(
            R_NB, omega, R_ND, deadline_s, local=local)
        status, passes, searched, cost, residual, violation, promised, ratio, local_s = head
        if status == _FAILED:
            return failed(R_NB, omega, self.config.horizon, time.perf_counter() - begin,
                          self.limits_used)
        return AttitudeMpcSolution(
            torques[0].copy(), torques, attitudes, rates, cost, int(passes),
            time.perf_counter() - begin, _STATUSES[int(status)], residual, violation,
            searched != 0.0, promised, ratio, local_s, None,
            self.limits_used if self._acting or self._tracked else 0.0)

    @property
    def target_margins_rad(self) -> dict[str, float]:
        """By which angle the commanded attitude keeps each cone [rad]; negative: it is missing."""
        return self._cones.target_margins_rad

    def _disturb(self, disturbance_B_n_m: ArrayLike | None) -> None:
        """Plan in the net torque under this disturbance (3,) [N m] from now on."""
        limit = self.config.max_torque_n_m
        bound = np.full(3, np.inf) if limit is None else limit
        d = np.zeros(3) if disturbance_B_n_m is None else np.array(disturbance_B_n_m, dtype=float)
        if d.shape != (3,) or not (np.abs(d) < bound).all():
            raise ConfigurationError('disturbance_B_n_m', d.tolist(),
                                     '3 finite numbers, each below the torque limit')
        changed, self._disturbance = not np.array_equal(d, self._disturbance), d
        self._acting, self._acting_share = bool(d.any()), (np.abs(d) / bound).tolist()
        if limit is not None and changed:
            if not self._disturbed:
                self._build_again(disturbed=True, moving=self._moving)
            self._cones.leave(self.terminal_share)
        self.solver.disturb(d)

    def _track(self, reference: Reference | None, R_NB: Array, R_ND: ArrayLike | None
               ) -> ArrayLike | None:
        """Plan about a reference from now on; return its first attitude, R_ND without one."""
        if reference is None and not self._tracked:
            return R_ND
        if self.config.horizon_s:
            raise ConfigurationError('reference', 'given', 'None with horizon_s')
        begins = self._tracked != (reference is not None)
        self._tracked = reference is not None
        if reference is not None and self.config.target == 'pointing' and R_NB.shape == (3, 3):
            reference = reference.rolled(self.config.pointing_axis_B, R_NB)
        if reference is not None and len(reference.R_ND) != self.config.horizon + 1:
            raise ConfigurationError(
                'reference', len(reference.R_ND),
                f'{self.config.horizon + 1} nodes, one more than the horizon')
        self._reference = reference or self._still
        if not self._moving:
            self._build_again(disturbed=self._disturbed, moving=True)
        elif begins:
            self.solver.set_rate_limits(
                self.config.within_rate_margins if self._tracked else self.config.planned)
        self._follow()
        self._cones.leave(self.terminal_share)
        return R_ND if reference is None else reference.R_ND[0]

    def _follow(self) -> None:
        """Hand the reference to the solver, and take what it uses of the limits."""
        R_ND, omega = self._reference.R_ND, self._reference.omega_DN_D
        self._shares.see(omega, self.solver.set_reference(R_ND, omega), moving=self._tracked)

    def _aim(self, R_NB: Array, omega: Array, R_ND: Array) -> None:
        """Say which attitude is commanded with a state, as long as it can be used."""
        if not np.array_equal(R_ND, self._R_ND) and self.solver.set_state(
                R_NB, R_ND, omega * self._unit.time_s) is not None:
            self._R_ND = R_ND.copy()
            self._cones.aim(self._R_ND)

    @property
    def limits_used(self) -> float:
        """The largest part of a torque or rate limit that disturbance and reference use."""
        return max(self._shares.rate, *(
            each + acting for each, acting in zip(self._shares.torque, self._acting_share)))

    @property
    def terminal_share(self) -> float:
        """The part of the terminal level that they leave; of less than the least, no promise.

        A reference that is at rest at the end of the horizon uses nothing of the limits there.
        """
        used = max(self._acting_share) if self._shares.rests else self.limits_used
        left = max(LEAST_SHARE, 1.0 - used)
        return left * left


def _checked(R_NB: ArrayLike, omega_BN_B: ArrayLike, R_ND: ArrayLike | None
             ) -> tuple[Array, Array, Array]:
    """Return a state and a commanded attitude as arrays; raises for a wrong shape."""
    attitude, omega = np.asarray(R_NB, dtype=float), np.asarray(omega_BN_B, dtype=float)
    target = _IDENTITY if R_ND is None else np.asarray(R_ND, dtype=float)
    if attitude.shape == (3, 3) == target.shape and omega.shape == (3,):
        return attitude, omega, target
    name, value, shape = next(each for each in (
        ('R_NB', attitude, (3, 3)), ('omega_BN_B', omega, (3,)), ('R_ND', target, (3, 3)))
        if each[1].shape != each[2])
    raise ConfigurationError(name, value.shape, f'an array of shape {shape}')
