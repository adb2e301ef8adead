# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Closed loops that judge a controller: settling over the bang-bang time, margins, solve time."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from manifold_mpc_ros.control.moving.slew_profile import SlewPlanner
from manifold_mpc_ros.lab.batch.model_loop import LoopingMpc
from manifold_mpc_ros.lab.tune import rule
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.solution import SolveStatus
from manifold_mpc_ros.mpc.target import error_angle

# A loop runs for so many times the bang-bang time, and so many steps more.
TIMES, MORE_STEPS = 2.0, 10
# Limits hold to this part in closed loop with the model.
BROKEN = 1e-6


@dataclass(frozen=True)
class Slew:
    """A slew at rest to the target: rotation vector [rad]."""

    vector: Array

    @property
    def text(self) -> str:
        """Angle and axis in words."""
        angle = float(np.linalg.norm(self.vector))
        axis = ', '.join(f'{value:.3g}' for value in self.vector / angle)
        return f'{np.degrees(angle):.4g} deg about ({axis})'


@dataclass(frozen=True)
class Outcome:
    """What one closed loop did; ``settled_s`` is inf when it did not settle.

    ``peak_torque`` and ``effort`` are the largest torque over its limit, and the mean one of the
    three axes until it settled.
    """

    slew: Slew
    settled_s: float
    bound_s: float
    infeasible: int
    broken: bool
    peak_torque: float
    effort: float

    @property
    def ratio(self) -> float:
        """Settling time over the bang-bang time."""
        return self.settled_s / self.bound_s


def default_slews() -> list[Slew]:
    """Return quarter and half turns about the body axes and two others."""
    axes = [*np.eye(3), np.array([2.0, -1.0, 2.0]) / 3.0, np.array([-2.0, 6.0, 3.0]) / 7.0]
    return [Slew(angle * axis) for axis in axes for angle in (np.pi / 2, np.pi)]


class Flyer(NamedTuple):
    """A controller, and what makes its profiles; None: it aims at setpoints."""

    mpc: LoopingMpc
    slews: SlewPlanner | None = None


def fly(flyer: Flyer, slews: Sequence[Slew], accuracy_rad: float, *,
        inertia_factor: float = 1.0, disturbance_part: float = 0.0) -> list[Outcome]:
    """Close the loop for every slew; the body may differ from the model."""
    return [_fly(flyer, slew, accuracy_rad, inertia_factor, disturbance_part) for slew in slews]


def _fly(flyer: Flyer, slew: Slew, accuracy_rad: float, inertia_factor: float,
         disturbance_part: float) -> Outcome:
    config = flyer.mpc.config
    assert config.max_torque_n_m is not None
    angle = float(np.linalg.norm(slew.vector))
    bound = rule.bang_bang_time_s(config, slew.vector / angle, angle)
    ticks = int(TIMES * bound / config.step_s) + MORE_STEPS
    if flyer.slews is not None:
        flyer.slews.forget()
    loop = flyer.mpc.close_loop(
        so3.exp(slew.vector), np.zeros(3), ticks,
        inertia_kg_m2=inertia_factor * config.inertia_kg_m2,
        disturbance_B_n_m=disturbance_part * config.max_torque_n_m, slews=flyer.slews)
    rates = np.linalg.norm(loop.omega_BN_B, axis=1)
    moving = np.flatnonzero((error_angle(config, loop.R_NB) >= accuracy_rad)
                            | (rates >= rule.settled_rate_rad_s(config, accuracy_rad)))
    at = int(moving[-1]) + 1
    excess = [np.max(value) for limit in config.rate_limits
              for value in limit.values(loop.omega_BN_B.T)]
    return Outcome(
        slew, at * config.step_s if at < ticks else np.inf, bound,
        sum(status in (SolveStatus.INFEASIBLE, SolveStatus.FAILED) for status in loop.exceptions),
        max(excess, default=-1.0) > BROKEN,
        float(np.max(np.abs(loop.torque_B_n_m) / config.max_torque_n_m)),
        float(np.mean(np.abs(loop.torque_B_n_m[:at]) / config.max_torque_n_m)))


def worst_ratio(outcomes: Sequence[Outcome]) -> float:
    """Return the largest settling time over its bound; inf where a loop is not acceptable."""
    if any(outcome.infeasible or outcome.broken for outcome in outcomes):
        return np.inf
    return max(outcome.ratio for outcome in outcomes)


def solve_times_s(flyer: Flyer, slew: Slew) -> Array:
    """Return the processor time of every plan of a closed loop [s], profile and search included.

    What else the machine does is not in it.
    """
    R, omega, times = so3.exp(slew.vector), np.zeros(3), []
    flyer.mpc.reset()
    if flyer.slews is not None:
        flyer.slews.forget()
    for tick in range(flyer.mpc.config.horizon):
        begin_s = time.thread_time()
        plan = flyer.mpc.solve(
            R, omega, reference=flyer.mpc.profile(flyer.slews, R, omega, tick))
        times.append(time.thread_time() - begin_s)
        R, omega = plan.R_NB[1], plan.omega_BN_B[1]
    return np.array(times)
