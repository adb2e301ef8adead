# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Flights of references.py in orbit: targets of guidance, gravity gradient, a cone.

The body is Hubble-sized, so that gravity gradient is a tenth of its torque; it flies 500 km high.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.guidance import GUIDANCE_PARAMETERS, GuidanceConfig
from manifold_mpc_ros.config.parameter import resolve_parameters
from manifold_mpc_ros.control.guidance.laws import Guidance
from manifold_mpc_ros.control.guidance.orbit import orbit_of, sun_direction_N
from manifold_mpc_ros.control.moving.trajectory import Trajectory
from manifold_mpc_ros.control.response.observer import ResponseObserver, ResponseSettings
from manifold_mpc_ros.dynamics.environment import gravity_gradient_B
from manifold_mpc_ros.lab.tracking.body import ContinuousBody
from manifold_mpc_ros.lab.tracking.flight import EPOCH_NS, Flight, fly
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

START_NS, STEP_S = 1_800_000_000 * 10**9, 2.0
INERTIA = np.diag([31046.0, 77217.0, 78754.0])
#: About an orbit [s]; the parts that are judged leave out the way from the start [s].
ORBIT_S, SETTLING_S = 5680.0, 1200.0
ROLL = so3.exp([0.0, math.radians(30.0), math.radians(20.0)])


@functools.cache
def telescope(*cones: Cone) -> AttitudeMpc:
    """Return the controller of the body."""
    return AttitudeMpc(AttitudeMpcConfig(
        inertia_kg_m2=INERTIA, step_s=STEP_S, horizon=60, attitude_weight=np.eye(3),
        rate_weight=60.0 ** 2 * np.eye(3), torque_weight=0.05 ** 2 * np.eye(3),
        max_torque_n_m=1.2, max_rate_rad_s=np.radians([0.5, 0.2, 0.2]), cones=list(cones)),
        moving=True, disturbed=True)


def guidance(mode: str, **changes: Any) -> tuple[GuidanceConfig, Guidance]:
    """Return guidance on the orbit; the axis that points is tilted against the principal ones."""
    config = GuidanceConfig.from_parameters(resolve_parameters(GUIDANCE_PARAMETERS, {
        'mode': mode, 'axis_B': ROLL[:, 2].tolist(), 'second_axis_B': ROLL[:, 0].tolist(),
        'orbit.epoch_s': START_NS / 1e9, 'orbit.semi_major_axis_m': 6.878e6, **changes},
        complete=False))
    return config, Guidance(config)


def flown(mpc: AttitudeMpc, config: GuidanceConfig, target: Trajectory, duration_s: float, *,
          R_NB: Any, omega: Any = None, estimate: bool, begin_ns: int = 0) -> Flight:
    """Fly under gravity gradient."""
    places = orbit_of(config)

    def torque(time_s: float, attitude: Any) -> Any:
        at_ns = START_NS + begin_ns + round(1e9 * time_s)
        return gravity_gradient_B(
            attitude, places(np.array([at_ns]))[0], mpc.config.inertia_kg_m2)

    observer = ResponseObserver(mpc.config, ResponseSettings(
        1e-7, 1e-6, 1e-3, np.full(3, np.inf), estimate), 0.0)
    step_s = mpc.config.step_s
    body = ContinuousBody(
        mpc.config.inertia_kg_m2, step_s=step_s / 8, R_NB=R_NB, omega_BN_B=omega,
        max_torque_n_m=mpc.config.max_torque_n_m, disturbance=torque)
    return fly(mpc, body, target, duration_s, observer=observer, fallback_s=5.0 * step_s)


def target_of(law: Guidance, duration_s: float, *, begin_ns: int = 0) -> Trajectory:
    """Return what guidance commands from so long after the start on, a point every 4 s."""
    after = np.arange(0, round(duration_s / 4.0) + 2) * 4 * 10**9
    return Trajectory(EPOCH_NS + after, *law.points(START_NS + begin_ns + after))


def summary(flight: Flight, since_s: float, until_s: float = math.inf) -> dict[str, Any]:
    """Return the figures of a flight, errors between two times."""
    judged = (flight.time_s >= since_s) & (flight.time_s <= until_s)
    error = np.rad2deg(flight.error_rad[judged])
    last = flight.commands[-1].decrease
    assert last is not None
    torque = np.abs(flight.torque_n_m)
    return {'ticks': len(flight.commands), 'searches': flight.searches,
            'largest_error_deg': float(error.max()),
            'rms_error_deg': float(np.sqrt(np.mean(error ** 2))),
            'largest_torque_n_m': float(torque[judged].max()),
            'promises_checked': last.counters.checked, 'promises_broken': last.counters.broken,
            'time_s': flight.time_s[::5].tolist(),
            'error_deg': np.rad2deg(flight.error_rad[::5]).tolist()}


def orbit() -> dict[str, Any]:
    """Nadir for an orbit, with and without the estimate of the disturbance; inertial too."""
    found = {}
    for mode in ('nadir', 'inertial'):
        config, law = guidance(mode, attitude_xyzw=[0.3, 0.4, 0.5, math.sqrt(0.5)])
        target = target_of(law, ORBIT_S + SETTLING_S + 200.0)
        for estimate in (True, False):
            R_ND, rate = target.at(EPOCH_NS)
            flight = flown(telescope(), config, target, ORBIT_S + SETTLING_S, estimate=estimate,
                           R_NB=R_ND @ so3.exp([0.002, -0.001, 0.002]), omega=rate)
            found[f'{mode}, {"estimated" if estimate else "not estimated"}'] = summary(
                flight, SETTLING_S)
    return found


def ground_pass(mpc: AttitudeMpc) -> dict[str, Any]:
    """A place on the ground beside the track, followed for 200 s either way by a smaller body."""
    config, law = guidance('nadir')
    at_ns = START_NS + round(1e9 * ORBIT_S / 2)
    x, y, z = orbit_of(config)(np.array([at_ns]))[0]
    latitude = math.degrees(math.atan2(z, math.hypot(x, y)))
    day = (at_ns / 1e9 - 946_728_000) / 86400.0
    longitude = (math.degrees(math.atan2(y, x)) - 280.46061837 - 360.98564736629 * day) % 360.0
    config, law = guidance('target', **{
        'target.latitude_deg': latitude, 'target.longitude_deg': longitude + 8.0})
    begin_ns = round(1e9 * (ORBIT_S / 2 - 300.0))
    later = target_of(law, 600.0, begin_ns=begin_ns)
    R_ND, rate = later.at(EPOCH_NS)
    flight = flown(mpc, config, later, 500.0, begin_ns=begin_ns, estimate=True,
                   R_NB=R_ND @ so3.exp([0.1, -0.1, 0.1]), omega=rate)
    rates = [float(np.linalg.norm(later.at(EPOCH_NS + k * 10**9)[1])) for k in range(500)]
    return {'largest_rate_deg_s': math.degrees(max(rates)), **summary(flight, 100.0)}


def sun_to_nadir() -> dict[str, Any]:
    """From the Sun to nadir, with a telescope axis that has to stay 40 degrees off the Sun."""
    config, law = guidance('nadir', **{'orbit.ascending_node_deg': 252.0})
    sun = sun_direction_N(np.array([START_NS]))[0]
    axis = ROLL[:, 1]
    cone = Cone('telescope', tuple(axis), tuple(sun), math.radians(40.0))
    target = target_of(law, 3000.0)
    before = guidance('sun')[1].attitudes(np.array([START_NS]))[0]
    flight = flown(telescope(cone), config, target, 2400.0, R_NB=before, estimate=True)
    margins = np.array([float(cone.margins_rad(R)) for R in flight.attitudes])
    return {'smallest_margin_deg': math.degrees(margins.min()),
            'turn_deg': math.degrees(flight.error_rad[0]),
            'below_0.1_deg_after_s': flight.settled_s(math.radians(0.1)),
            **summary(flight, 1800.0)}
