# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the body answers: no offset under a disturbance, and delays that are not as declared."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cases import CERTIFIED, configuration
from closed_loops import Flight, fly
from scripted import CONFIG, OMEGA, R_NB, SAMPLE, STEP_NS, Script, gate

from manifold_mpc_ros.control.command import Law
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.input_gate import StateSample
from manifold_mpc_ros.control.modes import Mode
from manifold_mpc_ros.control.response.observer import ResponseObserver, ResponseSettings
from manifold_mpc_ros.control.solver_thread import DirectSolver, solve_with
from manifold_mpc_ros.control.tick_time import LOCKSTEP
from manifold_mpc_ros.control.torque_history import TorqueHistory
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

HALF_TURN, AT_TARGET = (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0)
DISTURBANCE = np.array([0.01, -0.01, 0.01])


def settings(**changes: Any) -> ResponseSettings:
    return ResponseSettings(**{
        'rate_noise_rad_s': 1e-5, 'attitude_noise_rad': 2.5e-5, 'drift_n_m': 1e-3,
        'max_torque_n_m': np.full(3, np.inf), 'compensate': True, **changes})


@pytest.fixture(scope='module')
def mpc() -> AttitudeMpc:
    return AttitudeMpc(configuration(**CERTIFIED), disturbed=True)


@pytest.fixture(scope='module')
def flown(mpc: AttitudeMpc) -> Callable[..., Flight]:
    def fly_watched(
        duration_s: float, declared_s: float = 0.0, delay_s: float = 0.0,
        disturbance: np.ndarray | None = None, start: tuple[float, ...] = HALF_TURN,
        noise: float = 0.0, **changes: Any,
    ) -> Flight:
        observer = ResponseObserver(mpc.config, settings(**changes), declared_s)
        return fly(
            mpc, duration_s, law={'actuation_delay_s': declared_s, 'observer': observer}, plant={
                'actuation_delay_s': delay_s, 'initial_attitude_xyzw': start,
                'disturbance_torque_n_m': np.zeros(3) if disturbance is None else disturbance,
                'rate_noise_std_rad_s': noise, 'attitude_noise_std_rad': noise})

    return fly_watched


def watched(flight: Flight) -> ResponseObserver:
    assert flight.loop.observer is not None
    return flight.loop.observer


@pytest.mark.parametrize('delay_s', [0.0, 0.65])
def test_a_constant_torque_leaves_no_offset(
    flown: Callable[..., Flight], delay_s: float,
) -> None:
    flight = flown(25.0, delay_s, delay_s, DISTURBANCE)
    offset = flown(25.0, delay_s, delay_s, DISTURBANCE, compensate=False)
    assert np.rad2deg(flight.angle_rad[-1]) < 1e-3
    assert np.rad2deg(offset.angle_rad[-1]) > 0.5
    np.testing.assert_allclose(watched(flight).disturbance_B_n_m, DISTURBANCE, atol=1e-6)
    assert (np.abs(flight.rate_rad_s) <= 0.6 * (1.0 + 1e-3)).all()
    assert {command.mode for command in flight.commands} == {Mode.NOMINAL}


def test_under_noise_the_error_is_what_the_standard_deviation_says(
    flown: Callable[..., Flight],
) -> None:
    flight = flown(60.0, disturbance=DISTURBANCE, start=AT_TARGET, noise=1e-4,
                   rate_noise_rad_s=1e-4, attitude_noise_rad=1e-4)
    observer = watched(flight)
    error, deviation = observer.disturbance_B_n_m - DISTURBANCE, observer.disturbance_std_n_m
    assert (np.abs(error) < 4.0 * deviation).all()
    assert (deviation < 2e-3).all()
    assert np.rad2deg(flight.angle_rad[-400:]).mean() < 0.1


def test_plans_from_filtered_states_make_less_torque_of_noise(
    flown: Callable[..., Flight],
) -> None:
    noisy = {'disturbance': DISTURBANCE, 'start': AT_TARGET, 'noise': 1e-3,
             'rate_noise_rad_s': 1e-3, 'attitude_noise_rad': 1e-3, 'drift_n_m': 1e-4}
    measured, filtered = (flown(60.0, **noisy, filter_state=each) for each in (False, True))

    def torque(flight: Flight) -> float:
        late = [command.torque_B_n_m for command in flight.commands[60:]]
        return float(np.sqrt(np.mean((np.array(late) + DISTURBANCE) ** 2)))

    assert torque(filtered) < 0.6 * torque(measured)
    assert filtered.angle_rad[-600:].mean() < 1.1 * measured.angle_rad[-600:].mean()


@pytest.mark.parametrize('declared', [0.5, 2.0])
@pytest.mark.parametrize('delay_s', [0.2, 0.65])
def test_a_wrong_delay_is_found_said_and_planned_with(
    mpc: AttitudeMpc, flown: Callable[..., Flight], delay_s: float, declared: float,
) -> None:
    flight = flown(30.0, declared * delay_s, delay_s)
    assert np.rad2deg(flight.angle_rad[-1]) < 0.01
    delay = watched(flight).delay
    assert delay.measured_s == pytest.approx(delay_s, abs=0.05)
    assert delay.disagrees == (abs(declared - 1.0) * delay_s > 0.125)
    assert delay.delay_s == (delay.measured_s if delay.disagrees else declared * delay_s)
    # Until it is found, rates may be beyond their limits by what the torque unaccounted for gives.
    config = mpc.config
    assert config.max_torque_n_m is not None
    assert config.max_rate_rad_s is not None
    fastest = np.abs(np.linalg.inv(config.inertia_kg_m2)) @ config.max_torque_n_m
    excess = np.abs(flight.rate_rad_s).max(axis=0) - config.max_rate_rad_s
    assert (excess <= abs(declared - 1.0) * delay_s * fastest + 0.01 * config.max_rate_rad_s).all()


def test_a_right_delay_is_never_doubted(flown: Callable[..., Flight]) -> None:
    delay = watched(flown(20.0, 0.65, 0.65, DISTURBANCE)).delay
    assert not delay.disagrees
    assert delay.measured_s == pytest.approx(0.65, abs=0.05)


def observed(
    rates: list[np.ndarray], acting_since_ns: int = 0, **changes: Any,
) -> ResponseObserver:
    observer, sent = ResponseObserver(CONFIG, settings(**changes), 0.0), TorqueHistory(STEP_NS)
    for tick, omega in enumerate(rates):
        sample = StateSample(SAMPLE.stamp_ns + tick * STEP_NS, np.eye(3), omega)
        observer.observe(sample, sent, acting_since_ns)
        sent.record(sample.stamp_ns, np.zeros(3))
    return observer


def test_the_estimate_is_bounded_by_its_own_limit_and_half_of_the_torque() -> None:
    rates = [np.full(3, 0.1 * tick) for tick in range(6)]
    np.testing.assert_array_equal(observed(rates).disturbance_B_n_m, [0.15, 0.1, 0.05])
    bounded = observed(rates, max_torque_n_m=np.array([0.02, np.inf, 0.03]))
    np.testing.assert_array_equal(bounded.disturbance_B_n_m, [0.02, 0.1, 0.03])


def test_the_estimate_is_frozen_while_torques_are_not_our_own() -> None:
    rates = [np.full(3, 0.01 * tick) for tick in range(6)]
    assert observed(rates).disturbance_B_n_m.all()
    later_ns = SAMPLE.stamp_ns + 9 * STEP_NS
    assert not observed(rates, acting_since_ns=later_ns).disturbance_B_n_m.any()


def test_a_pause_freezes_it_and_what_is_known_stays_through_a_restart() -> None:
    observer = ResponseObserver(CONFIG, settings(), 0.0)
    solver = Script()
    solver.torque = np.zeros(3)
    loop = ControlLoop(
        Law(CONFIG, DirectSolver(solve_with(solver)), 2.5, observer=observer), gate(),
        initial_setpoint='identity')

    def estimate(ticks: range) -> np.ndarray:
        for tick in ticks:
            loop.admit(StateSample(SAMPLE.stamp_ns + tick * STEP_NS, R_NB, OMEGA + 1e-3 * tick))
            loop.tick(LOCKSTEP)
        return observer.disturbance_B_n_m

    known = estimate(range(6))
    assert known.any()
    np.testing.assert_allclose(solver.disturbance, known)
    loop.logic.paused = True
    known = estimate(range(6, 7))  # until then the torque was our own
    np.testing.assert_array_equal(estimate(range(7, 12)), known)
    loop.logic.paused = False
    loop.reset()
    np.testing.assert_array_equal(estimate(range(12, 13)), known)
