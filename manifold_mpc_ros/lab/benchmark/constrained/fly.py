# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A slew in closed loop, in inertial frames turned at random; everything seen at every sample."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from manifold_mpc_ros.config.cones import joined
from manifold_mpc_ros.control.input_gate import NANOSECONDS, StateSample
from manifold_mpc_ros.control.moving.slew_profile import SlewPlanner
from manifold_mpc_ros.control.response.observer import ResponseObserver, ResponseSettings
from manifold_mpc_ros.control.target import FixedTarget
from manifold_mpc_ros.control.torque_history import TorqueHistory
from manifold_mpc_ros.lab.benchmark.constrained.plant import Bodies
from manifold_mpc_ros.lab.benchmark.constrained.slews import Slew
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution
from manifold_mpc_ros.mpc.target import attitude_towards

SEED = 12
#: The plant takes so many steps in one of the predictor, and with cones none above 10 ms.
FINER, SAMPLE_S = 100, 0.01
#: Part of the torque and rate limits that a profile uses, and the angle from which one begins.
PROFILE_PART, SMALLEST_RAD = 0.985, 0.1


@dataclass
class Pilot:
    """What flies one body: the controller, what it is told beside the state, what it answered."""

    slew: Slew
    turned: Array
    answers: list[AttitudeMpcSolution] = field(default_factory=list)
    states: list[tuple[Array, Array, Array]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Build the controller."""
        self.config = self.slew.config(self.turned)
        self.mpc = AttitudeMpc(self.config, disturbed=self.slew.observed,
                               moving=self.slew.profile)
        self.R_ND = attitude_towards(self.config, self.turned @ self.slew.target) \
            if self.slew.axis_B is not None else self.turned @ self.slew.target
        self._slews = SlewPlanner(self.config, PROFILE_PART, SMALLEST_RAD)
        self._sent, self._observer = TorqueHistory(10 * self._tick_ns), None
        if self.slew.observed:
            self._observer = ResponseObserver(self.config, ResponseSettings(
                1e-6, 1e-9, 1.0, np.full(3, np.inf), True), 0.0)

    @property
    def _tick_ns(self) -> int:
        """The period of control [ns]."""
        return round(self.slew.step_s * NANOSECONDS)

    def command(self, R_NB: Array, omega_BN_B: Array, momenta: Array) -> tuple[Array, Array]:
        """Return the body torque (3,) and the motor torques (m,) of the next period [N m]."""
        more: dict[str, Any] = {}
        now_ns = len(self.answers) * self._tick_ns
        if self.slew.wheels is not None:
            more['wheel_momentum_n_m_s'] = momenta
        if self.slew.profile:
            more['reference'] = self._slews.target(
                FixedTarget(self.R_ND), (R_NB, omega_BN_B), now_ns, {}).over_horizon(
                    now_ns, self.slew.step_s, self.config.horizon)
        if self._observer is not None:
            self._observer.observe(StateSample(now_ns, R_NB, omega_BN_B), self._sent, 0)
            more['disturbance_B_n_m'] = self._observer.compensated_B_n_m
        self.states.append((R_NB, omega_BN_B, momenta))
        answer = self.mpc.solve(R_NB, omega_BN_B, self.R_ND, **more)
        self.answers.append(answer)
        self._sent.record(now_ns, answer.torque_B_n_m)
        if answer.wheel_torque_n_m is None:
            return answer.torque_B_n_m, np.zeros(0)
        return np.zeros(3), answer.wheel_torque_n_m


@dataclass(frozen=True)
class Seen:
    """Everything at every sample (samples, frames), and at which times [s]."""

    time_s: Array
    values: dict[str, Array]


def frames_of(count: int) -> Array:
    """Return so many inertial frames (n, 3, 3), the first one as published."""
    turned = so3.random_rotations(np.random.default_rng(SEED), max(count, 1))
    turned[0] = np.eye(3)
    return np.asarray(turned[:count])


def fly(slew: Slew, turned: Array, say: Callable[[str], None]
        ) -> tuple[list[Pilot], Seen]:
    """Close the loop in every frame (n, 3, 3); return who flew, and what was seen."""
    pilots = [Pilot(slew, each) for each in turned]
    wheels = np.zeros((3, 0)) if slew.wheels is None else slew.wheels.axes_B.T
    bodies = Bodies.at_rest(slew.inertia, wheels, turned @ slew.start)
    acting = _disturbances(slew, len(turned))
    finer = max(FINER, round(slew.step_s / SAMPLE_S) if slew.cones else 0)
    rows: list[dict[str, Array]] = []
    for tick in range(slew.ticks):
        say(f'{slew.name}: {tick} of {slew.ticks} ticks in {len(turned)} frames')
        R_NB = bodies.R_NB
        torque, motors = (np.array(part) for part in zip(*(
            pilot.command(R_NB[i], bodies.omega[i], bodies.momenta[i])
            for i, pilot in enumerate(pilots))))
        for _ in range(finer):
            rows.append(_look(slew, turned, bodies, torque, motors))
            bodies.step(torque + acting, motors, slew.step_s / finer)
    values = {key: np.array([row[key] for row in rows]) for key in rows[0]}
    times = np.array([slew.step_s / finer * i for i in range(len(rows))])
    return pilots, Seen(times, values)


def _disturbances(slew: Slew, n: int) -> Array:
    """Return the torques (n, 3) that act unasked: as given, or of a size about random axes."""
    if np.ndim(slew.disturbance_n_m):
        return np.tile(slew.disturbance_n_m, (n, 1))
    axes = np.random.default_rng(SEED + 1).standard_normal((n, 3))
    return slew.disturbance_n_m * axes / np.linalg.norm(axes, axis=1, keepdims=True)


def _look(slew: Slew, turned: Array, bodies: Bodies, torque: Array, motors: Array
          ) -> dict[str, Array]:
    """Return what is seen of bodies: angles [deg], and parts of the limits."""
    R, omega = bodies.R_NB, bodies.omega
    back = np.swapaxes(turned, 1, 2) @ R
    if slew.axis_B is None:
        error = so3.angle(slew.target.T @ back)
    else:
        axis = back @ slew.axis_B
        error = np.arctan2(np.linalg.norm(np.cross(axis, slew.target), axis=1),
                           axis @ slew.target)
    law = slew.law
    seen = {'error_deg': np.degrees(error),
            'rate_deg_s': np.degrees(np.linalg.norm(omega, axis=1)),
            'torque_n_m': np.linalg.norm(torque, axis=1),
            'torque': np.max(np.abs(torque) / law['max_torque_n_m'], axis=1)}
    if slew.energy_form is not None:
        seen['energy'] = np.sum(omega @ slew.energy_form * omega, axis=1)
    elif slew.wheels is None:
        seen['rate'] = np.max(np.abs(omega) / law['max_rate_rad_s'], axis=1)
    if slew.wheels is not None:
        seen['motor'] = np.max(np.abs(motors) / slew.wheels.max_torque_n_m, axis=1)
        seen['momentum'] = np.max(np.abs(bodies.momenta) / slew.wheels.max_momentum_n_m_s, axis=1)
    margins = np.array([each.margins_rad(back) for each in slew.cones]).reshape(
        len(slew.cones), len(back))
    return seen | {f'cone {name}': np.degrees(each)
                   for name, each in joined(slew.cones, margins).items()}


def judged(slew: Slew, pilots: list[Pilot], seen: Seen) -> list[dict[str, Any]]:
    """Return what became of each frame."""
    values = seen.values
    inside = ((values['error_deg'] < slew.settled_deg)
              & (values['rate_deg_s'] < slew.settled_deg_s)
              & (values['torque_n_m'] < slew.settled_n_m))
    runs = []
    for i, pilot in enumerate(pilots):
        outside = np.flatnonzero(~inside[:, i])
        last = int(outside[-1]) + 1 if len(outside) else 0
        cones = {key[5:]: float(value[:, i].min()) for key, value in values.items()
                 if key.startswith('cone ')}
        runs.append({
            'settled_s': None if last == len(seen.time_s) else float(seen.time_s[last]),
            'least_margin_deg': cones,
            **{f'largest_{key}': float(values[key][:, i].max())
               for key in ('torque', 'energy', 'rate', 'motor', 'momentum') if key in values},
            'statuses': sorted({str(each.status) for each in pilot.answers}),
            'searches': sum(each.searched for each in pilot.answers),
            'end_error_deg': float(values['error_deg'][-1, i])})
    return runs
