# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is measured of a run: settling times, peaks beyond the limits, counts of ticks."""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.config.rate_limits import rates_beyond
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.lab.closed_loop import settling_time
from manifold_mpc_ros.lab.recording.bags.run import BagRun
from manifold_mpc_ros.lab.recording.bags.series import MOTOR_TORQUE, WHEEL_SPEED
from manifold_mpc_ros.lie.arrays import Array

#: Part of a limit by which it may be passed: the real body is not the model stepped at step_s.
SLACK = 0.01


def settling_times(
    run: BagRun, attitude_deg: float, rate_rad_s: float,
) -> tuple[float | None, ...]:
    """Return the time from the start, and from each later setpoint, until the run is settled [s].

    Settled means that the error of attitude (or pointing) and the norm of the rate, beside that
    of a target that moves, stay below their bounds until the next setpoint; None where they do
    not, or where no state follows.
    """
    below = (np.degrees(run.error_rad) < attitude_deg) \
        & (run.rate_error_rad_s < rate_rad_s)
    time_s, begins_s = run.states.time_s, _begins_s(run)
    times: list[float | None] = []
    for begin_s, end_s in zip(begins_s, _ends_s(begins_s), strict=True):
        inside = (time_s >= begin_s) & (time_s < end_s)
        settled_s = settling_time(time_s[inside], below[inside]) if inside.any() else None
        times.append(None if settled_s is None else settled_s - begin_s)
    return tuple(times)


def settled_at_s(run: BagRun, attitude_deg: float, rate_rad_s: float) -> float | None:
    """Return the time from which the run is settled to its end [s], None if it is not."""
    last_s = settling_times(run, attitude_deg, rate_rad_s)[-1]
    return None if last_s is None else _begins_s(run)[-1] + last_s


def lasted_s(run: BagRun) -> list[float]:
    """Return for how long the start and each later setpoint held, the last one for ever [s]."""
    begins_s = _begins_s(run)
    return [end_s - begin_s for begin_s, end_s in zip(begins_s, _ends_s(begins_s), strict=True)]


def _ends_s(begins_s: list[float]) -> list[float]:
    """Return when each of them is superseded [s]."""
    return [*begins_s[1:], np.inf]


def _begins_s(run: BagRun) -> list[float]:
    """Return when there was something new to do: at the start and at each later setpoint [s].

    A setpoint is published again where the controller does not hear it at once: same time.
    References that go on where the last one was bring nothing new.
    """
    return [0.0, *commands_at_s(run)]


def commands_at_s(run: BagRun) -> list[float]:
    """Return when, after the start, there was a setpoint or a target jumped [s]."""
    first_ns, step_s = int(run.states.stamp_ns[0]), run.config.step_s
    jumps_s = [(each - first_ns) / NANOSECONDS for each in run.commanded.jumps_ns(step_s)]
    return sorted({float(each) for each in (*run.setpoints.time_s, *jumps_s) if each > 0.0})


def violations(run: BagRun) -> int:
    """Return how many torques, rates and wheels are beyond the controller's limits by over 1 %."""
    if run.scenario is None:
        return 0
    config = run.scenario.controller_config.mpc
    torques = 0 if config.max_torque_n_m is None else int((
        np.abs(run.commands.torque_B_n_m) > config.max_torque_n_m * (1.0 + SLACK)
        ).any(axis=1).sum())
    return torques + _wheels_beyond(run, config.wheels) + int(np.count_nonzero(
        rates_beyond(config.rate_limits, run.states.omega_BN_B, SLACK)))


def _wheels_beyond(run: BagRun, wheels: WheelArray | None) -> int:
    """Return how many motor torques and momenta ``J_w (speed + w . omega)`` are beyond limits."""
    if wheels is None or wheels.inertia_kg_m2 is None or not len(run.ticks):
        return 0
    unknown = np.full(len(run.ticks), np.nan)
    torque, speed = (np.stack([run.ticks.devices.get(quantity, {}).get(name, unknown)
                               for name in wheels.names], axis=1)
                     for quantity in (MOTOR_TORQUE, WHEEL_SPEED))
    omega = np.stack([np.interp(tick_times_s(run), run.states.time_s, values)
                      for values in run.states.omega_BN_B.T], axis=1)
    momentum = wheels.inertia_kg_m2 * (speed + omega @ wheels.axes_B.T)
    return sum(int(np.count_nonzero(np.abs(values) > limit * (1.0 + SLACK))) for values, limit in (
        (torque, wheels.max_torque_n_m), (momentum, wheels.max_momentum_n_m_s)))


def solve_time_p99_s(run: BagRun) -> float | None:
    """Return the time that 99 % of the solves do not exceed [s], None without any."""
    times = run.ticks.solve_time_s[np.isfinite(run.ticks.solve_time_s)]
    return float(np.percentile(times, 99.0, method='higher')) if len(times) else None


def infeasible(run: BagRun) -> int:
    """Return the number of ticks without a plan that keeps the limits."""
    return sum(status in ('infeasible', 'failed') for status in run.ticks.solver_status)


def in_mode(mode: str, run: BagRun) -> int:
    """Return the number of ticks in a mode."""
    return run.ticks.mode.count(mode)


def unknown_ticks(run: BagRun) -> int:
    """Return how many ticks the controller had of which the bag says nothing.

    A recording with an end of its own began with the first tick, another with the first it has.
    """
    if not len(run.ticks):
        return 0
    first = 1 if run.outcome else int(run.ticks.tick[0])
    return int(run.ticks.tick[-1]) - first + 1 - len(run.ticks)


def refused(run: BagRun) -> int | None:
    """Return how many messages the controller refused, None where the bag does not say.

    A state that lockstep repeats because its answer takes long is answered again: no refusal.
    """
    if not run.ticks.last:
        return None
    repeats = sum(run.ticks.total(key) or 0 for key in run.ticks.last
                  if key.startswith('refused.') and key.endswith('.duplicate'))
    return run.ticks.refused - (repeats if run.lockstep else 0)


def tick_times_s(run: BagRun) -> Array:
    """Return the time of each tick since the first state (t,) [s].

    In lockstep that of the state answered; else by when the controller said something about it.
    """
    rows = run.ticks.tick - 1
    if run.lockstep and len(rows) and rows[-1] < len(run.commands):
        return np.asarray(run.commands.time_s[rows])
    origin_ns = int(run.states.received_ns[0])
    return np.asarray(np.interp(
        (run.ticks.received_ns - origin_ns) / NANOSECONDS,
        (run.states.received_ns - origin_ns) / NANOSECONDS, run.states.time_s))
