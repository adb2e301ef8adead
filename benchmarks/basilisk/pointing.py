# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The controller beside Basilisk's own feedback law, on the same spacecraft and targets.

The law is Basilisk's mrpFeedback behind its attTrackingError, with rate and acceleration of the
target fed forward, gyroscopic torque of body and wheels made up for, and integral action; its
rwMotorTorque maps it to the motors. Both are given exact states and the same target.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from body import (
    AXES_B,
    FRICTION_N_M,
    INERTIA,
    ORBIT_M,
    RATE_RAD_S,
    WHEELS,
    common,
    hub,
    observer,
    wheel_parameters,
    wheels,
)
from link import BasiliskProcess, PlantState, reference_of
from loop import START_NS, Controller, error_rad, fly

from manifold_mpc_ros.config.guidance import GUIDANCE_PARAMETERS, GuidanceConfig
from manifold_mpc_ros.config.parameter import resolve_parameters
from manifold_mpc_ros.control.guidance.laws import Guidance
from manifold_mpc_ros.control.guidance.orbit import orbit_of
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

ORBIT_S = 5677.0
#: What the plans of these flights see ahead [s].
AHEAD_S = 30.0
#: A point of the reference the controller is given for so long [s].
SPACING_S = {'nadir': 4.0, 'target': 1.0, 'inertial': 4.0}
START_OFF = so3.exp(math.radians(10.0) * np.array([2.0, -1.0, 2.0]) / 3.0)
DISTURBANCE_N_M, DISTURBED_FROM_S = np.array([2e-5, -2e-5, 2e-5]), 100.0
SETTLED_DEG = 0.01
#: Standard deviations about each axis, of a star tracker and a gyroscope.
NOISE = {'attitude_rad': 1e-4, 'rate_rad_s': 2e-5}
#: Decay times [s] and integral gains [1/(N m s)] of the law that are tried.
DECAYS_S = (0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 4.0)
INTEGRALS = (0.0, 1.0, 4.0, 16.0, 64.0)
#: Torque that the integral may give [N m].
INTEGRAL_N_M = 2e-4


class Flight(NamedTuple):
    """A target, how long it is followed, and how long errors do not count [s]."""

    mode: str
    duration_s: float
    settling_s: float
    changes: dict[str, Any]
    off: Array = START_OFF
    disturbance_N_m: Array = np.zeros(3)
    noise: dict[str, float] | None = None


def flights() -> dict[str, Flight]:
    """Return the flights by name."""
    return {
        'nadir for an orbit': Flight('nadir', ORBIT_S, 100.0, {}),
        'pass over a place on the ground': Flight('target', 500.0, 100.0, ground()),
        'nadir with noise': Flight('nadir', 600.0, 100.0, {}, noise=NOISE),
        'step of a disturbance': Flight('inertial', 300.0, DISTURBED_FROM_S, {
            'attitude_xyzw': [0.3, 0.4, 0.5, math.sqrt(0.5)]}, np.eye(3), DISTURBANCE_N_M)}


def guidance(mode: str, **changes: Any) -> tuple[GuidanceConfig, Guidance]:
    """Return guidance from the orbit; body z points."""
    config = GuidanceConfig.from_parameters(resolve_parameters(GUIDANCE_PARAMETERS, {
        'mode': mode, 'axis_B': [0.0, 0.0, 1.0], 'second_axis_B': [1.0, 0.0, 0.0],
        'orbit.epoch_s': START_NS / 1e9, 'orbit.semi_major_axis_m': ORBIT_M,
        'orbit.inclination_deg': 45.0, **changes}, complete=False))
    return config, Guidance(config)


def ground() -> dict[str, Any]:
    """Return the place that is 3 degrees east of below the orbit, 250 s after the start."""
    at_ns = START_NS + 250 * 10**9
    x, y, z = orbit_of(guidance('nadir')[0])(np.array([at_ns]))[0]
    day = (at_ns / 1e9 - 946_728_000) / 86400.0
    longitude = math.degrees(math.atan2(y, x)) - 280.46061837 - 360.98564736629 * day
    return {'target.latitude_deg': math.degrees(math.atan2(z, math.hypot(x, y))),
            'target.longitude_deg': (longitude + 3.0 + 180.0) % 360.0 - 180.0}


def points(flight: Flight, spacing_s: float) -> tuple[list[int], list[tuple[Array, Array, Array]]]:
    """Return times after the start [ns], and attitudes, rates and accelerations of the target."""
    law = guidance(flight.mode, **flight.changes)[1]
    count = math.ceil((flight.duration_s + 2.0 * AHEAD_S) / spacing_s) + 1
    after = np.round(np.arange(count) * spacing_s * 1e9).astype(np.int64)
    return after.tolist(), list(zip(*law.points(START_NS + after)))


def spacecraft(flight: Flight, period_s: float) -> dict[str, Any]:
    """Return the description of the spacecraft on its orbit, so far off the target."""
    law = guidance(flight.mode, **flight.changes)[1]
    places = orbit_of(guidance('nadir')[0])
    d = 10**8
    before, now, after = places(START_NS + np.array([-d, 0, d]))
    R_ND, omega, _ = (each[0] for each in law.points(np.array([START_NS])))
    return hub(R_ND @ flight.off, flight.off.T @ omega, wheels=wheels(FRICTION_N_M),
               position_N_m=now.tolist(), velocity_N_m_s=((after - before) / 0.2).tolist(),
               period_s=period_s, noise=flight.noise)


def acting(flight: Flight) -> Callable[[float], Array]:
    """Return the disturbance (3,) by time [N m]."""
    return lambda time_s: flight.disturbance_N_m * (time_s >= DISTURBED_FROM_S)


def by_controller(flight: Flight, period_s: float) -> dict[str, Any]:
    """Fly with the controller over DDS; return figures."""
    watching = observer(**flight.noise or {}) | {
        'disturbance.filter_state': flight.noise is not None}
    parameters = {**common(), **wheel_parameters(), **watching, 'mpc.step_s': period_s,
                  'mpc.horizon': round(AHEAD_S / period_s), 'reference.timeout_s': AHEAD_S}
    with (BasiliskProcess(spacecraft(flight, period_s)) as plant,
          Controller(parameters, 'wheel_commands', WHEELS.names) as controller):
        controller.follow(*points(flight, SPACING_S[flight.mode]))
        states = fly(controller, plant, round(flight.duration_s / period_s),
                     acting(flight)).states
        ticks = Counter(' '.join(each) for each in controller.ticks.values())
    return {**summary(flight, states, period_s), 'ticks': dict(sorted(ticks.items()))}


def gains(decay_s: float, integral: float, period_s: float) -> dict[str, float]:
    """Return gains of mrpFeedback by the rule of Basilisk's examples, of damping 1.

    ``P = 2 max(J) / decay``, ``K = P^2 / max(J)``; the integral gives no more than so much torque.
    """
    largest = float(np.diag(INERTIA).max())
    P = 2.0 * largest / decay_s
    return {'K': P * P / largest, 'P': P, 'Ki': integral if integral else -1.0,
            'integral_limit': INTEGRAL_N_M / (P * integral) if integral else 0.0,
            'period_s': period_s}


def by_law(flight: Flight, law: dict[str, float]) -> dict[str, Any]:
    """Fly with Basilisk's law; return figures."""
    period_s, steps = law['period_s'], round(flight.duration_s / law['period_s'])
    references = [reference_of(*each) for each in points(flight, period_s)[1][:steps + 1]]
    disturbance = acting(flight)
    given = {**spacecraft(flight, period_s), 'law': law, 'reference': references[0]}
    with BasiliskProcess(given) as plant:
        states = [plant.state, *(
            plant.advance(reference=reference,
                          disturbance_B_n_m=disturbance(k * period_s))
            for k, reference in enumerate(references[1:]))]
    return {**summary(flight, states, period_s), 'gains': law}


def summary(flight: Flight, states: list[PlantState], period_s: float) -> dict[str, Any]:
    """Return the figures of a flight, errors of after the settling."""
    _, target = points(flight, period_s)
    error = np.degrees([error_rad(R_ND, state.R_NB) for (R_ND, _, _), state in zip(
        target, states)])
    judged = error[round(flight.settling_s / period_s):]
    late = np.flatnonzero(error >= SETTLED_DEG)
    motor = np.array([state.motor_torque_n_m for state in states[1:]])
    ratio = np.array([state.peak_rate_rad_s.max() for state in states]) / RATE_RAD_S
    every = max(1, round(flight.duration_s / 250.0 / period_s))
    largest = [error[k:k + every].max() for k in range(0, len(error), every)]
    return {
        'largest_error_deg': float(judged.max()),
        'rms_error_deg': float(np.sqrt(np.mean(judged ** 2))),
        'last_error_deg': float(error[-round(20.0 / period_s):].max()),
        'below_settled_s': float(late[-1] + 1) * period_s if late.size else 0.0,
        'mean_motor_torques_n_m': float(np.abs(motor).sum(axis=1).mean()),
        'mean_body_torque_n_m': float(np.linalg.norm(motor @ AXES_B, axis=1).mean()),
        'largest_rate_over_limit': float(ratio.max()),
        'trace': {'every_s': every * period_s,
                  'error_deg': [float(f'{value:.4g}') for value in largest]}}


def tried(flight: Flight, period_s: float) -> dict[str, Any]:
    """Return the rms error [deg] in a flight of every decay time and integral gain, and the best.

    One that lets the body tumble counts with what it reaches.
    """
    rms = {f'{decay:g} s, {integral:g}': by_law(
        flight, gains(decay, integral, period_s))['rms_error_deg']
        for decay, integral in itertools.product(DECAYS_S, INTEGRALS)}
    best = min(rms, key=lambda name: rms[name])
    decay, integral = best.split(' s, ')
    return {'rms_error_deg': rms, 'best': gains(float(decay), float(integral), period_s)}
