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

from manifold_mpc_ros.config.cones import directions, tightened
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.errors import ConfigurationError, StepExistenceError
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.backends.build import load_library
from manifold_mpc_ros.mpc.compiled import CompiledMpc
from manifold_mpc_ros.mpc.reference import Reference
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
        self._disturbance = np.zeros(3)
        self.backend = 'c'
        self._build(backend, cache_dir, disturbed=disturbed, moving=moving)

    def _build(self, backend: str, cache_dir: str | Path | None, *, disturbed: bool,
               moving: bool) -> None:
        """Load the solver and allocate its memory."""
        config, self._disturbed, self._moving = self.config, disturbed, moving
        structure = structure_of(config, disturbed=disturbed, moving=moving)
        self.solver = CompiledMpc(load_library(structure, backend, cache_dir), structure, config,
                                  self.terminal)
        self._build_again = functools.partial(self._build, backend, cache_dir)
        self._wheels = WheelKeeper(config, self.solver)
        self.solver.disturb(self._disturbance)

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
            self._aim_cones(directions_N)
        if self.config.wheels is not None:
            self._wheels.tell(wheel_momentum_n_m_s)
        state = _checked(R_NB, omega_BN_B, R_ND if reference is None else reference.R_ND[0])
        if reference is not None or self._tracked:
            state = (*state[:2], self._track(reference, *state[::2]))
        answer = self._answer(*state, begin, deadline_s)
        if reference is not None:
            self.solver.foresee(reference.R_ND[1])
        return answer if wheel_momentum_n_m_s is None else answer._replace(
            wheel_torque_n_m=self._wheels.motor_torques(answer),
            target_momentum=self._wheels.target_momentum(answer, state[2]))

    def solve_local(self, R_NB: ArrayLike, omega_BN_B: ArrayLike) -> AttitudeMpcSolution:
        """Map a measured state to the plan of one cold start, the short way; for measuring."""
        begin, state = time.perf_counter(), _checked(R_NB, omega_BN_B, None)
        return self._answer(*state, begin, math.inf, local=True)

    def _answer(self, R_NB: Array, omega: Array, R_ND: Array, begin: float, deadline_s: float, *,
                local: bool = False) -> AttitudeMpcSolution:
        """Return the solver's answer to a state."""
        head, torques, attitudes, rates = self.solver.answer(
            R_NB, omega, R_ND, deadline_s, local=local)
        status, passes, searched, cost, residual, violation, promised, ratio, local_s = head
        if status == _FAILED:
            return failed(R_NB, omega, self.config.horizon, time.perf_counter() - begin,
                          self.limits_used)
        return AttitudeMpcSolution(
            torques[0], torques, attitudes, rates, cost, int(passes),
            time.perf_counter() - begin, _STATUSES[int(status)], residual, violation,
            searched != 0.0, promised, ratio, local_s, None,
            self.limits_used if self._acting or self._tracked else 0.0)

    def _disturb(self, disturbance_B_n_m: ArrayLike | None) -> None:
        """Plan in the net torque under this disturbance (3,) [N m] from now on."""
        limit = self.config.max_torque_n_m
        bound = np.full(3, np.inf) if limit is None else limit
        d = np.zeros(3) if disturbance_B_n_m is None else np.array(disturbance_B_n_m, dtype=float)
        if d.shape != (3,) or not (np.abs(d) < bound).all():
            raise ConfigurationError('disturbance_B_n_m', d.tolist(),
                                     '3 finite numbers, each below the torque limit')
        self._disturbance, self._acting = d, bool(d.any())
        if limit is not None and self._acting and not self._disturbed:
            self._build_again(disturbed=True, moving=self._moving)
        self.solver.disturb(d)

    def _aim_cones(self, directions_N: Mapping[str, ArrayLike] | None) -> None:
        """Set directions of cones by name; the configuration's for all others."""
        cones = self.config.cones
        given = directions(cones, directions_N, self.config.horizon) if directions_N else None
        lost = self.solver.set_directions(given)
        if lost is not None and given is not None:
            moved = np.linalg.norm(np.diff(given, axis=0), axis=-1).max(axis=0)
            tightened(cones, self.config.between_samples, moved.tolist())  # raises, naming it

    def _track(self, reference: Reference | None, R_NB: Array, R_ND: Array) -> Array:
        """Plan about a reference from now on, or about none; return what is commanded."""
        if self.config.horizon_s:
            raise ConfigurationError('reference', 'given', 'None with horizon_s')
        n = self.config.horizon
        if reference is not None and len(reference.R_ND) != n + 1:
            raise ConfigurationError('reference', len(reference.R_ND),
                                     f'{n + 1} nodes, one more than the horizon')
        if not self._moving:
            self._build_again(disturbed=self._disturbed, moving=True)
        self._tracked = reference is not None
        return self.solver.set_reference(R_NB, R_ND, reference)

    def moved_on(self, R_NB: ArrayLike, omega_BN_B: ArrayLike, torque_B_n_m: ArrayLike,
                 lasting_s: float) -> tuple[Array, Array]:
        """Map attitude, rate [rad/s], torque (3,) [N m] and its duration [s] to the state then.

        In LGVI steps of at most ``step_s``, as the exported controller does it; any thread may ask
        while another solves. Raises StepExistenceError where the implicit step is not guaranteed,
        ConfigurationError for an array of another shape or a time that is not positive and finite.
        """
        R, omega, _ = _checked(R_NB, omega_BN_B, None)
        torque = np.asarray(torque_B_n_m, dtype=float)
        if torque.shape != (3,):
            raise ConfigurationError('torque_B_n_m', torque.shape, 'an array of shape (3,)')
        if not 0.0 < lasting_s < math.inf:
            raise ConfigurationError('lasting_s', lasting_s, 'a positive finite time [s]')
        moved = self.solver.moved_on(R, omega, torque, lasting_s)
        if moved is None:
            raise StepExistenceError('the rate is beyond the guard of the implicit step')
        return moved

    @property
    def limits_used(self) -> float:
        """The largest part of a torque or rate limit that disturbance and reference use."""
        return self.solver.limits_used

    @property
    def terminal_share(self) -> float:
        """The part of the terminal level that they and wheels leave; of the least no promise.

        A reference that is at rest at the end of the horizon uses nothing of the limits there.
        """
        return self.solver.share


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
