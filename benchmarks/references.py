# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measure how the control loop follows targets that move, under disturbances and delays.

    python benchmarks/references.py --output docs/results/references.json [--only NAME ...]

Every flight closes the control loop of the node around a body in continuous time that shares
nothing with the model (lab/tracking). Body and weights are those of config/controller.yaml, but
for the orbit, which a Hubble-sized body flies. Studies that are not asked for stay in the file.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import json
import math
import os
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from orbit_flights import ground_pass, orbit, sun_to_nadir
from reference_tables import draw

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.control.response.observer import ResponseObserver, ResponseSettings
from manifold_mpc_ros.lab.tracking.body import ContinuousBody
from manifold_mpc_ros.lab.tracking.flight import Flight, fly, trajectory
from manifold_mpc_ros.lab.tracking.flight import Path as Motion
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.reference import LEAST_SHARE, Reference, reference_torque
from manifold_mpc_ros.mpc.solution import SolveStatus

TOP = Path(__file__).resolve().parent.parent
SHIPPED = ControllerConfig.from_yaml(TOP / 'config' / 'controller.yaml').mpc
#: A state is settled below this [deg].
SETTLED_DEG = 0.1
TORQUE_N_M = np.array([0.01, -0.01, 0.01])
HALF_TURN, NEAR = so3.exp([0.0, 0.0, math.pi]), so3.exp([0.05, -0.05, 0.1])


@functools.cache
def controller(step_s: float = SHIPPED.step_s) -> AttitudeMpc:
    """Return the shipped controller, or one of another step with a horizon of 3 s at least."""
    horizon = max(SHIPPED.horizon, round(3.0 / step_s))
    return AttitudeMpc(replace(SHIPPED, step_s=step_s, horizon=horizon), moving=True,
                       disturbed=True)


def observer(mpc: AttitudeMpc, declared_s: float = 0.0, noise: float = 1e-5,
             compensate: bool = True) -> ResponseObserver:
    """Return the observer of the node with its shipped settings."""
    return ResponseObserver(mpc.config, ResponseSettings(
        noise, noise, 1e-3, np.full(3, np.inf), compensate), declared_s)


def body(mpc: AttitudeMpc, R_NB: Any, **given: Any) -> ContinuousBody:
    """Return the shipped body, in 20 steps a control step."""
    return ContinuousBody(
        mpc.config.inertia_kg_m2, step_s=mpc.config.step_s / 20.0, R_NB=R_NB,
        max_torque_n_m=mpc.config.max_torque_n_m, **given)


def spin(rate_rad_s: Any) -> Motion:
    """Turn at a constant rate from the identity."""
    rate = np.asarray(rate_rad_s)
    return lambda times: (so3.exp(times[:, None] * rate), np.tile(rate, (len(times), 1)))


def waves(seed: int, share: float, mpc: AttitudeMpc) -> Motion:
    """Return two swings, one in the other, that use a share of the limits at their worst."""
    draw = np.random.default_rng([15, seed])
    axes = draw.normal(size=(2, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    periods, phases = draw.uniform(20.0, 90.0, 2), draw.uniform(0.0, 2.0 * np.pi, 2)
    times = np.arange(0.0, 200.0, mpc.config.step_s)

    def path(size: float) -> Motion:
        def at(t: Any) -> tuple[Any, Any]:
            w = 2.0 * np.pi / periods
            turns = [(size * np.sin(w[i] * t + phases[i]))[:, None] * axes[i] for i in (0, 1)]
            rates = [(size * w[i] * np.cos(w[i] * t + phases[i]))[:, None] * axes[i]
                     for i in (0, 1)]
            inner = so3.exp(turns[1])
            return (so3.exp(turns[0]) @ inner,
                    np.einsum('nji,nj->ni', inner, rates[0]) + rates[1])
        return at

    def used(size: float) -> float:
        made = Reference(*path(size)(times))
        torque = np.abs(reference_torque(made, mpc.config)) / mpc.config.max_torque_n_m
        box = np.abs(made.omega_DN_D) / np.asarray(mpc.config.max_rate_rad_s)
        return float(max(torque.max(), box.max()))

    low, high = 0.0, 50.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if used(middle) < share else (low, middle)
    return path(low)


def steady_deg(flight: Flight, part: float = 0.3) -> float:
    """Return the largest error over the last part of a flight."""
    return float(np.rad2deg(flight.error_rad[-round(part * len(flight.error_rad)):].max()))


def counted(flight: Flight) -> dict[str, Any]:
    """Return what the monitor counted, and the searches."""
    last = flight.commands[-1].decrease
    assert last is not None
    return {'promises_checked': last.counters.checked, 'promises_broken': last.counters.broken,
            'searches': flight.searches, 'ticks': len(flight.commands)}


def overshoot(flight: Flight, mpc: AttitudeMpc) -> float:
    """Return by how much, as a part of it, a rate limit was exceeded at any tick."""
    return float(max(0.0, (np.abs(flight.rate_rad_s) / mpc.config.max_rate_rad_s).max() - 1.0))


def constant() -> list[dict[str, Any]]:
    """Constant rates and swings at two steps."""
    rows = []
    for step_s in (0.1, 0.5):
        mpc = controller(step_s)
        paths = {f'{each:g} deg/s': spin(np.deg2rad(each) * np.array([0.6, -0.48, 0.64]))
                 for each in (0.06, 0.3, 1.0)}
        paths |= {f'swings, {share:g} of the limits': waves(0, share, mpc)
                  for share in (0.1, 0.3)}
        for name, path in paths.items():
            flight = fly(mpc, body(mpc, NEAR), trajectory(path, 70.0, 0.5), 60.0)
            rows.append({'step_s': step_s, 'target': name, 'steady_error_deg': steady_deg(flight),
                         **counted(flight)})
    return rows


def delays() -> list[dict[str, Any]]:
    """Half turns with delays that are declared right, as half, as double; and targets."""
    rows, mpc = [], controller()
    still = spin(np.zeros(3))
    for delay_s in (0.0, 0.4, 1.3 * SHIPPED.step_s):
        for declared in (1.0, 0.5, 2.0) if delay_s else (1.0,):
            watch = observer(mpc, declared * delay_s, compensate=False)
            slew = fly(mpc, body(mpc, HALF_TURN, delay_s=delay_s), trajectory(still, 50.0, 25.0),
                       40.0, observer=watch, delay_s=declared * delay_s)
            track = fly(mpc, body(mpc, NEAR, delay_s=delay_s),
                        trajectory(waves(1, 0.3, mpc), 70.0, 0.5), 60.0,
                        observer=observer(mpc, declared * delay_s, compensate=False),
                        delay_s=declared * delay_s)
            rows.append({
                'delay_s': delay_s, 'declared_s': declared * delay_s,
                'settled_s': slew.settled_s(math.radians(SETTLED_DEG)),
                'rate_limit_exceeded': overshoot(slew, mpc),
                'reported_at_the_end': watch.delay.disagrees,
                'measured_s': watch.delay.measured_s, 'final_error_deg': steady_deg(slew, 0.1),
                'tracking_error_deg': steady_deg(track)})
    return rows


def disturbances() -> list[dict[str, Any]]:
    """An unknown constant torque, from rest at the target and from a half turn."""
    rows = []
    for step_s in (0.1, 0.5):
        mpc = controller(step_s)
        for start, R_NB in (('at the target', np.eye(3)), ('half turn', HALF_TURN)):
            for estimate, size in ((True, 1.0), (False, 1.0), (True, 0.0)):
                flight = fly(
                    mpc, body(mpc, R_NB, disturbance=functools.partial(
                        lambda torque, _time, _R: torque, size * TORQUE_N_M)),
                    trajectory(spin(np.zeros(3)), 50.0, 25.0), 40.0,
                    observer=observer(mpc, compensate=estimate))
                error = np.rad2deg(flight.error_rad)
                rows.append({
                    'step_s': step_s, 'start': start, 'estimate': estimate, 'torque': size,
                    'below_1e-3_deg_after_s': flight.settled_s(math.radians(1e-3)),
                    'largest_error_deg': float(error.max()), 'final_error_deg': float(error[-1])})
    return rows


def noise() -> list[dict[str, Any]]:
    """Torque that noise makes, planned from measured and from filtered states."""
    rows = []
    for step_s, size, drift, filtered in itertools.product(
            (0.1, 0.5), (1e-4, 1e-3), (1e-3, 1e-4), (False, True)):
        mpc, draw = controller(step_s), np.random.default_rng(1)

        def measure(at: ContinuousBody, size: float = size, draw: Any = draw) -> Any:
            return (at.R_NB @ so3.exp(draw.normal(scale=size, size=3)),
                    at.omega_BN_B + draw.normal(scale=size, size=3))

        flight = fly(mpc, body(mpc, np.eye(3), disturbance=lambda _time, _R: TORQUE_N_M),
                     trajectory(spin(np.zeros(3)), 70.0, 25.0), 60.0, measure=measure,
                     observer=ResponseObserver(mpc.config, ResponseSettings(
                         size, size, drift, np.full(3, np.inf), True, filtered), 0.0))
        half = len(flight.commands) // 2
        rows.append({
            'step_s': step_s, 'noise_rad': size, 'drift_n_m': drift, 'filtered': filtered,
            'torque_rms_n_m': float(np.sqrt(np.mean(
                (flight.torque_n_m[half:] + TORQUE_N_M) ** 2))),
            'error_rms_deg': float(np.rad2deg(np.sqrt(np.mean(flight.error_rad[half:] ** 2))))})
    return rows


def _drawn(seed: int, low: float, high: float) -> dict[str, Any]:
    """Fly one random target that uses a share of the limits drawn from a range."""
    mpc = controller()
    share = float(np.random.default_rng([16, seed]).uniform(low, high))
    flight = fly(mpc, body(mpc, NEAR), trajectory(waves(seed, share, mpc), 60.0, 0.5), 45.0)
    solutions = [c.solution for c in flight.commands if c.solution is not None]
    beyond = [s for s in solutions if s.limits_used > 1.0 - LEAST_SHARE]
    torque = np.abs(flight.torque_n_m) / mpc.config.max_torque_n_m
    return {'share': share, 'steady_error_deg': steady_deg(flight), **counted(flight),
            'torque_limit_exceeded': float(max(0.0, torque.max() - 1.0)),
            'rate_limit_exceeded': overshoot(flight, mpc),
            'nominal': all(c.mode.value == 'NOMINAL' for c in flight.commands),
            'ticks_warned': len(beyond), 'ticks_infeasible': sum(
                s.status is SolveStatus.INFEASIBLE for s in solutions)}


def smooth() -> dict[str, Any]:
    """10,000 ticks of swings that use 0.3 of the limits: a search for the first plan only."""
    mpc = controller()
    path, ticks = waves(0, 0.3, mpc), 10_000
    R_ND, omega = path(np.zeros(1))
    flight = fly(mpc, body(mpc, R_ND[0] @ NEAR, omega_BN_B=omega[0]),
                 trajectory(path, ticks * mpc.config.step_s + 20.0, 0.5),
                 ticks * mpc.config.step_s)
    return {'steady_error_deg': steady_deg(flight), 'rate_limit_exceeded': overshoot(flight, mpc),
            **counted(flight)}


def _many(count: int, first: int, low: float, high: float) -> list[dict[str, Any]]:
    """Fly so many random targets on all processors."""
    controller()
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(_drawn, range(first, first + count), [low] * count, [high] * count,
                             chunksize=10))


def _random(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the figures of flights about random targets."""
    errors = np.array([row['steady_error_deg'] for row in rows])
    return {'flights': len(rows), 'median_error_deg': float(np.median(errors)),
            'largest_error_deg': float(errors.max()),
            'largest_torque_excess': max(row['torque_limit_exceeded'] for row in rows),
            'largest_rate_excess': max(row['rate_limit_exceeded'] for row in rows),
            'all_nominal': all(row['nominal'] for row in rows),
            'with_more_than_one_search': sum(row['searches'] > 1 for row in rows),
            'warned': sum(row['ticks_warned'] > 0 for row in rows),
            **{name: sum(row[name] for row in rows) for name in (
                'promises_checked', 'promises_broken', 'ticks', 'ticks_warned',
                'ticks_infeasible')},
            'shares': [row['share'] for row in rows], 'errors_deg': errors.tolist()}


STUDIES: dict[str, Callable[[], Any]] = {
    'targets': constant, 'delays': delays, 'disturbances': disturbances,
    'noise': noise, 'orbit': orbit, 'sun_to_nadir': sun_to_nadir,
    'smooth': smooth, 'ground_pass': lambda: ground_pass(controller()),
    'feasible': lambda: _random(_many(1000, 100, 0.05, 0.7)),
    'infeasible': lambda: _random(_many(200, 2000, 1.1, 4.0))}


def main() -> None:
    """Run the studies and write the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--output', type=Path, required=True)
    parser.add_argument('--only', nargs='+', choices=STUDIES, default=list(STUDIES))
    arguments = parser.parse_args()
    results = (json.loads(arguments.output.read_text(encoding='utf-8'))
               if arguments.output.exists() else {})
    for name in arguments.only:
        begin_s = time.monotonic()
        results[name] = STUDIES[name]()
        print(f'{name}: {time.monotonic() - begin_s:.0f} s', flush=True)
        arguments.output.write_text(json.dumps(results) + '\n', encoding='utf-8')
    if {'orbit', 'sun_to_nadir'} <= results.keys():
        draw(results, arguments.output.with_suffix('.png'))


if __name__ == '__main__':
    main()
