# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Targets that move, over the control loop, with a body in continuous time."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from cases import CERTIFIED, configuration
from scripted import SAMPLE, STEP_NS, Script, loop_with

from manifold_mpc_ros.control.decrease_record import Decrease
from manifold_mpc_ros.control.input_gate import Reason, Refusal
from manifold_mpc_ros.control.modes import Mode
from manifold_mpc_ros.control.moving.gate import Frame, Point, admit_moving, admit_trajectory
from manifold_mpc_ros.control.moving.trajectory import Trajectory
from manifold_mpc_ros.control.target import FixedTarget
from manifold_mpc_ros.control.tick_time import LOCKSTEP
from manifold_mpc_ros.lab.tracking.body import ContinuousBody
from manifold_mpc_ros.lab.tracking.flight import EPOCH_NS, Flight, Path, fly, trajectory
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import SolveStatus

H = 0.1
CONFIG = configuration(**{**CERTIFIED, 'step_s': H, 'horizon': 30})
CLOSE = so3.exp([0.05, -0.05, 0.1])
AXIS = np.array([1.0, 0.5, -0.3]) / np.linalg.norm([1.0, 0.5, -0.3])
SECOND = 10**9


@pytest.fixture(scope='module')
def mpc() -> AttitudeMpc:
    return AttitudeMpc(CONFIG, moving=True)


def spin(omega: list[float]) -> Path:
    rate = np.array(omega)
    return lambda times: (so3.exp(times[:, None] * rate), np.tile(rate, (len(times), 1)))


def swing(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two swings about different axes, one in the other."""
    a, b = 2.0 * np.pi / 40.0, 2.0 * np.pi / 31.0
    inner = so3.exp(0.3 * np.cos(b * times)[:, None] * np.eye(3)[2])
    rate = 0.4 * a * np.cos(a * times)[:, None] * AXIS
    own = -0.3 * b * np.sin(b * times)[:, None] * np.eye(3)[2]
    return (so3.exp(0.4 * np.sin(a * times)[:, None] * AXIS) @ inner,
            np.einsum('nji,nj->ni', inner, rate) + own)


def followed(mpc: AttitudeMpc, path: Path, duration_s: float, **given: Any) -> Flight:
    body = ContinuousBody(
        CONFIG.inertia_kg_m2, step_s=H / 10, R_NB=CLOSE, max_torque_n_m=CONFIG.max_torque_n_m,
        delay_s=given.get('delay_s', 0.0))
    return fly(mpc, body, trajectory(path, duration_s + 5.0, 1.0), duration_s, **given)


@pytest.mark.parametrize(('path', 'delay_s', 'largest_deg'), [
    (spin([0.0, 0.0, np.deg2rad(0.06)]), 0.0, 1e-3),
    (spin([0.01, -0.01, np.deg2rad(0.8)]), 0.0, 1e-3),
    (swing, 0.0, 1e-2),
    (swing, 0.25, 1e-2),
])
def test_what_moves_is_followed_without_lag_and_the_promise_kept(
    mpc: AttitudeMpc, path: Path, delay_s: float, largest_deg: float,
) -> None:
    flight = followed(mpc, path, 20.0, delay_s=delay_s)
    assert np.rad2deg(flight.error_rad[0]) > 5.0
    assert np.rad2deg(flight.error_rad[-30:]).max() < largest_deg
    assert flight.searches == 1
    assert flight.loop.steady_error.rate_rad_s < 1e-4
    assert (np.abs(flight.rate_rad_s) < 0.6).all()
    last = flight.commands[-1].decrease
    assert last is not None
    assert (last.counters.broken, last.verdict) == (0, Decrease.KEPT)


def test_at_its_end_the_last_attitude_is_held(mpc: AttitudeMpc) -> None:
    times = np.array([0, 10 * SECOND]) + EPOCH_NS
    R_ND = so3.exp(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.6]]))
    slew = Trajectory(times, R_ND, np.zeros((2, 3)), np.zeros((2, 3)))
    body = ContinuousBody(CONFIG.inertia_kg_m2, step_s=H / 10)
    flight = fly(mpc, body, slew, 14.0)
    assert np.rad2deg(flight.error_rad).max() < 1e-2
    assert slew.warning(int(times[-1]) + SECOND) == ''
    assert np.rad2deg(so3.angle(R_ND[1].T @ body.R_NB)) < 1e-3
    moving = Trajectory(times, R_ND, np.full((2, 3), 0.01))
    assert 'ended while it moved, 1 s ago' in moving.warning(int(times[-1]) + SECOND)
    np.testing.assert_array_equal(moving.at(int(times[-1]))[1], np.zeros(3))


def test_one_that_no_limit_allows_is_followed_as_near_as_they_do(mpc: AttitudeMpc) -> None:
    flight = followed(mpc, spin([0.0, 0.0, 0.8]), 4.0)
    solution = flight.commands[-1].solution
    assert solution is not None
    assert (solution.status, solution.limits_used > 1.3) == (SolveStatus.INFEASIBLE, True)
    assert (np.abs(flight.rate_rad_s) < 0.6).all()
    assert (np.abs(flight.torque_n_m) <= 0.3 * (1.0 + 1e-9)).all()
    assert flight.rate_rad_s[-1, 2] > 0.55


def test_one_that_runs_away_from_every_plan_is_gone_after() -> None:
    mpc = AttitudeMpc(configuration(**CERTIFIED), moving=True)
    body = ContinuousBody(CONFIG.inertia_kg_m2, step_s=0.05, R_NB=so3.exp([0.0, 0.0, 1.0]))
    away = trajectory(spin([1.5, 2.0, -2.0]), 20.0, 0.5)  # 0.24 % beyond without margins
    assert mpc.solve(body.R_NB, body.omega_BN_B, reference=away.over_horizon(
        EPOCH_NS, 0.5, 20)).status is SolveStatus.FAILED
    flight = fly(mpc, body, away, 7.0)
    assert {command.mode for command in flight.commands} == {Mode.NOMINAL}
    assert all(command.solution.status is SolveStatus.INFEASIBLE  # type: ignore[union-attr]
               and command.solution.limits_used > 3.0  # type: ignore[union-attr]
               for command in flight.commands)
    assert (np.abs(flight.rate_rad_s) < 0.6).all()
    assert np.abs(flight.torque_n_m).max() > 0.2


def test_between_points_attitude_rate_and_acceleration_are_smooth() -> None:
    times = np.arange(0.0, 41.0, 2.0)
    R_ND, omega = swing(times)
    alpha = (swing(times + 1e-5)[1] - swing(times - 1e-5)[1]) / 2e-5
    path = Trajectory((times * 1e9).astype(np.int64), R_ND, omega, alpha)
    fine = np.linspace(0.0, 39.9, 500)
    reference = [path.at(round(s * 1e9)) for s in fine]
    true_R, true_omega = swing(fine)
    for (R, rate), R_true, rate_true in zip(reference, true_R, true_omega):
        assert so3.angle(R_true.T @ R) < 1e-5
        np.testing.assert_allclose(rate, rate_true, atol=1e-5)
    for knot in (times[1:-1] * 1e9).astype(int):
        before, at, after = (path.at(knot + k * 10**6)[1] for k in (-1, 0, 1))
        np.testing.assert_allclose(after - at, at - before, atol=1e-6)  # of 1e-3 or so


def test_a_setpoint_goes_on_at_its_rate_until_it_is_stale() -> None:
    rate = np.array([0.0, 0.3, -0.4])
    moving = Trajectory.at_rate(EPOCH_NS, CLOSE, rate, valid_s=3.0, seen_s=20.0)
    seen = moving.over_horizon(EPOCH_NS + 29 * SECOND // 10, 0.5, 20)  # across the end
    np.testing.assert_allclose(seen.omega_DN_D, np.tile(rate, (21, 1)), atol=1e-9)
    np.testing.assert_allclose(seen.R_ND[-1], CLOSE @ so3.exp(12.9 * rate), atol=1e-8)
    assert not moving.warning(EPOCH_NS + 2 * SECOND)
    late_ns = EPOCH_NS + 5 * SECOND
    assert 'setpoint is stale, 2 s ago' in moving.warning(late_ns)
    held = moving.over_horizon(late_ns, 0.5, 3)
    np.testing.assert_allclose(held.R_ND, np.tile(CLOSE @ so3.exp(3.0 * rate), (4, 1, 1)),
                               atol=1e-9)
    assert not held.omega_DN_D.any()


def test_one_that_goes_on_smoothly_is_no_other_setpoint_and_one_that_jumps_is() -> None:
    loop, now_ns = loop_with(Script()), SAMPLE.stamp_ns
    rate = np.array([0.0, 0.0, 0.01])

    def at(angle_rad: float, begin_ns: int, rate: np.ndarray = rate) -> Trajectory:
        return Trajectory.at_rate(
            begin_ns, so3.exp([0.0, 0.0, angle_rad]), rate, valid_s=9.0, seen_s=9.0)

    loop.admit(SAMPLE)
    loop.tick(LOCKSTEP)
    loop.aim(at(0.1, now_ns))
    assert loop.jumps == 1  # from the initial setpoint
    loop.aim(at(0.1 - 0.01, now_ns - SECOND))
    assert loop.jumps == 1
    for other in (at(0.2, now_ns), at(0.2, now_ns, 2.0 * rate), at(0.3, now_ns)):
        before = loop.jumps
        loop.aim(other)
        assert loop.jumps == before + 1
    loop.aim(FixedTarget(np.eye(3)))
    loop.admit(dataclasses.replace(SAMPLE, stamp_ns=now_ns + STEP_NS))
    loop.tick(LOCKSTEP)
    assert loop.jumps == 4


LEVEL = (0.0, 0.0, 0.0, 1.0)
NOW = Frame('inertial', EPOCH_NS)


def points(**changes: Any) -> list[Point]:
    return [Point(0, LEVEL, (0.1, 0.0, 0.0), (0.0, 0.0, 0.0)), Point(**{
        'after_ns': SECOND, 'quaternion_xyzw': LEVEL, 'rate': (0.1, 0.0, 0.0),
        'acceleration': (0.0, 0.0, 0.0), **changes})]


@pytest.mark.parametrize(('given', 'reason'), [
    (('map', EPOCH_NS, points(), NOW), Reason.WRONG_FRAME),
    (('inertial', EPOCH_NS, [], NOW), Reason.UNREADABLE),
    (('inertial', 0, points(), Frame('inertial', None)), Reason.INVALID_STAMP),
    (('inertial', EPOCH_NS, points(after_ns=0), NOW), Reason.INVALID_STAMP),
    (('inertial', EPOCH_NS - 2 * SECOND, points(), NOW), Reason.STALE),
    (('inertial', EPOCH_NS + 10**5 * SECOND, points(), NOW), Reason.FUTURE),
    (('inertial', EPOCH_NS, points(rate=None), NOW), Reason.NO_RATE),
    (('inertial', EPOCH_NS, points(rate=(np.nan, 0.0, 0.0)), NOW), Reason.NON_FINITE),
    (('inertial', EPOCH_NS, points(acceleration=(0.0, np.inf, 0.0)), NOW), Reason.NON_FINITE),
    (('inertial', EPOCH_NS, points(quaternion_xyzw=(1.0, 1.0, 0.0, 0.0)), NOW),
     Reason.QUATERNION_NORM),
    (('inertial', EPOCH_NS, points(rate=(1e300, 0.0, 0.0)), NOW), Reason.TOO_FAST),
    (('inertial', EPOCH_NS, points(acceleration=(0.0, 20.0, 0.0)), NOW), Reason.TOO_FAST),
])
def test_what_is_no_trajectory_is_refused(given: tuple[Any, ...], reason: Reason) -> None:
    admitted = admit_trajectory(*given)
    assert isinstance(admitted, Refusal)
    assert (admitted.reason, bool(admitted.detail)) == (reason, True)
    assert isinstance(admit_trajectory('inertial', 0, points(), NOW), Trajectory)


@pytest.mark.parametrize(('stamp_ns', 'rate', 'reason'), [
    (0, (0.0, 0.0, 1e300), Reason.TOO_FAST), (0, (0.0, 0.0, np.inf), Reason.NON_FINITE),
    (EPOCH_NS - 4 * SECOND, (0.0, 0.0, 0.1), Reason.STALE),
])
def test_what_is_no_moving_setpoint_is_refused(
    stamp_ns: int, rate: tuple[float, float, float], reason: Reason,
) -> None:
    admitted = admit_moving('inertial', stamp_ns, LEVEL, rate, NOW, valid_s=3.0, seen_s=10.0)
    assert isinstance(admitted, Refusal)
    assert admitted.reason is reason
