# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From a solver and a controller's configuration to the law that its loop works with."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.control.command import Law
from manifold_mpc_ros.control.consistency import MotionBounds
from manifold_mpc_ros.control.decrease_monitor import monitor_for
from manifold_mpc_ros.control.devices.magnetorquers import DipoleLaw
from manifold_mpc_ros.control.moving.promise import moving_promise_for
from manifold_mpc_ros.control.moving.slew_profile import SlewPlanner
from manifold_mpc_ros.control.response.observer import ResponseObserver, ResponseSettings
from manifold_mpc_ros.control.solver_thread import (
    DirectSolver,
    Solver,
    SolverRunner,
    SolverThread,
    solve_with,
)
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.nodes.controller.background_build import end_with_parent
from manifold_mpc_ros.terminal.design import TerminalDesign

#: Part of a tick that a plan may take; then the tick goes on without it.
SOLVER_BUDGET = 0.6
#: Part of a tick after which the solver hands over the best that it has.
SOLVER_TIME = 0.5
#: Of the attitude's noise, so many standard deviations are `monitor.attitude_noise_rad`.
NOISE_DEVIATIONS = 4.0
#: A process that builds a solver in the background is this much nicer than the node.
BUILDER_NICENESS = 10


def solver_for(config: ControllerConfig, terminal: TerminalDesign | None = None) -> AttitudeMpc:
    """Design the terminal set where it is not known yet, and build or load the solver."""
    return AttitudeMpc(
        config.mpc, backend=config.backend, terminal=terminal,
        disturbed=config.estimate_disturbance or config.magnetorquers is not None
        or config.known_torque is not None,
        moving=config.moving)


def law_with(
    solver: AttitudeMpc, config: ControllerConfig, prepare: Callable[[], None],
) -> Law:
    """Return the law of a solver; ``prepare`` runs first in the solver's thread."""
    monitor = monitor_for(
        config.mpc, solver.terminal.P, decrease_tolerance=config.decrease_tolerance,
        attitude_noise_rad=config.attitude_noise_rad)
    return Law(config.mpc, runner_for(solver, config, prepare), config.state_timeout_s, monitor,
               solver.backend, config.actuation_delay_s, MotionBounds.from_config(config),
               observer_for(config), config.largest_steady_error_rad, dipoles_of(config),
               moving_promise_for(config.mpc, solver.terminal), SlewPlanner.from_config(config),
               config.known_torque, solver.moved_on)


def dipoles_of(config: ControllerConfig) -> DipoleLaw | None:
    """Return what commands magnetorquers, None without them."""
    if config.magnetorquers is None:
        return None
    return DipoleLaw(config.magnetorquers, config.mpc.wheels, config.mpc.inertia_kg_m2)


def observer_for(config: ControllerConfig) -> ResponseObserver | None:
    """Return what watches the response, None where nobody asks for it."""
    if not (config.estimate_disturbance or config.actuation_delay_s or config.filter_state):
        return None
    return ResponseObserver(config.mpc, ResponseSettings(
        config.rate_noise_rad_s, config.attitude_noise_rad / NOISE_DEVIATIONS,
        config.drift_n_m, np.broadcast_to(config.max_disturbance_n_m, 3),
        config.estimate_disturbance, config.filter_state), config.actuation_delay_s)


def runner_for(
    solver: Solver, config: ControllerConfig, prepare: Callable[[], None],
) -> SolverRunner:
    """Return what runs a solver: in a thread within a budget; in lockstep in its own time."""
    if config.lockstep:
        return DirectSolver(solve_with(solver))
    step_s = config.mpc.step_s
    return SolverThread(
        solve_with(solver, SOLVER_TIME * step_s), SOLVER_BUDGET * step_s, prepare)


def designed_elsewhere(config: ControllerConfig) -> TerminalDesign:
    """Design the terminal set and build the solver in a process of its own.

    What is left to do here is to load the solver; both hold up the other threads of a process.
    """
    with ProcessPoolExecutor(
            max_workers=1, mp_context=get_context('spawn'), initializer=_stand_back) as pool:
        return pool.submit(_design, config).result()


def _stand_back() -> None:
    """Leave with the parent, and to it signals of a terminal and the processor."""
    end_with_parent()
    os.nice(BUILDER_NICENESS)
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _design(config: ControllerConfig) -> TerminalDesign:
    """Return the terminal design; the built solver stays in the cache on disk."""
    return solver_for(config).terminal
