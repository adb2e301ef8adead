# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The control loop around a body in continuous time, and what happened."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from manifold_mpc_ros.config.orbit import KnownTorque
from manifold_mpc_ros.control.command import Command, Law
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.decrease_monitor import monitor_for
from manifold_mpc_ros.control.input_gate import NANOSECONDS, StateGate, StateSample
from manifold_mpc_ros.control.moving.promise import moving_promise_for
from manifold_mpc_ros.control.moving.slew_profile import SlewPlanner
from manifold_mpc_ros.control.moving.trajectory import Trajectory
from manifold_mpc_ros.control.response.observer import ResponseObserver
from manifold_mpc_ros.control.solver_thread import DirectSolver, solve_with
from manifold_mpc_ros.control.target import Target
from manifold_mpc_ros.control.tick_time import ClockTime
from manifold_mpc_ros.lab.tracking.body import ContinuousBody
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

EPOCH_NS = NANOSECONDS
#: Maps times (n,) [s] to attitudes (n, 3, 3) and rates in their own axes (n, 3) [rad/s].
Path = Callable[[Array], tuple[Array, Array]]
#: Difference of time for accelerations of a path [s].
_DIFFERENCE_S = 1e-4


def trajectory(path: Path, duration_s: float, spacing_s: float) -> Trajectory:
    """Return the trajectory through points of a path, so far apart."""
    times: Array = spacing_s * np.linspace(0.0, round(duration_s / spacing_s), round(
        duration_s / spacing_s) + 1)
    R_ND, omega = path(times)
    alpha = (path(times + _DIFFERENCE_S)[1] - path(times - _DIFFERENCE_S)[1]) / (
        2.0 * _DIFFERENCE_S)
    return Trajectory(
        EPOCH_NS + np.round(times * NANOSECONDS).astype(np.int64), R_ND, omega, alpha)


@dataclass(frozen=True, eq=False)
class Flight:
    """True attitude, error angle [rad] and rate [rad/s] at every tick (n, ...), and commands."""

    time_s: Array
    attitudes: Array
    error_rad: Array
    rate_rad_s: Array
    commands: list[Command]
    loop: ControlLoop

    @property
    def searches(self) -> int:
        """How often the solver searched globally."""
        return sum(command.solution is not None and command.solution.searched
                   for command in self.commands)

    @property
    def torque_n_m(self) -> Array:
        """The commanded torques (n, 3) [N m]."""
        return np.array([command.torque_B_n_m for command in self.commands])

    def settled_s(self, angle_rad: float) -> float:
        """Return the time after which the error stays below this [s]."""
        outside = np.flatnonzero(self.error_rad >= angle_rad)
        return float(self.time_s[outside[-1]]) if outside.size else 0.0


def fly(
    mpc: AttitudeMpc, body: ContinuousBody, target: Target, duration_s: float, *,
    observer: ResponseObserver | None = None, delay_s: float = 0.0,
    measure: Callable[[ContinuousBody], tuple[Array, Array]] | None = None,
    fallback_s: float = 2.5, slews: SlewPlanner | None = None,
    later: Mapping[int, Target] | None = None, known: KnownTorque | None = None,
) -> Flight:
    """Close the loop by the clock of the stamps; the body's steps divide those of the control.

    ``later`` are the targets that are commanded at ticks after the first.
    """
    mpc.reset()
    config, steps = mpc.config, round(mpc.config.step_s / body.step_s)
    monitor = monitor_for(
        config, mpc.terminal.P, decrease_tolerance=0.1, attitude_noise_rad=1e-4)
    gate = StateGate('inertial', 'base_link', step_s=config.step_s, timeout_s=fallback_s,
                     timed=True)
    loop = ControlLoop(
        Law(config, DirectSolver(solve_with(mpc)), fallback_s, monitor, observer=observer,
            actuation_delay_s=delay_s, moving=moving_promise_for(config, mpc.terminal),
            slews=slews, known=known), gate, initial_setpoint='identity')
    loop.aim(target)
    rows, commands = [], []
    for tick in range(round(duration_s / config.step_s)):
        now_ns = EPOCH_NS + round(tick * config.step_s * NANOSECONDS)
        if later is not None and tick in later:
            target = later[tick]
            loop.aim(target)
        R_NB, omega = (body.R_NB, body.omega_BN_B) if measure is None else measure(body)
        loop.admit(StateSample(now_ns, R_NB, omega))
        commands.append(loop.tick(ClockTime(now_ns)))
        error = so3.angle(target.at(now_ns)[0].T @ body.R_NB)
        rows.append((tick * config.step_s, body.R_NB, float(error), body.omega_BN_B))
        for _ in range(steps):
            body.step(commands[-1].torque_B_n_m)
    times, attitudes, errors, rates = map(np.array, zip(*rows, strict=True))
    return Flight(times, attitudes, errors, rates, commands, loop)
