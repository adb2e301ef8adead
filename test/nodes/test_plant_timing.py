# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated time, and how long a command lasts; no ROS needed, the clock is the test's."""

from __future__ import annotations

import numpy as np
import pytest

from manifold_mpc_ros.config.control_law import SimulatorConfig
from manifold_mpc_ros.sim.pacing import LONGEST_CATCH_UP_S, Ask, FreeRun, Lockstep, Patience
from manifold_mpc_ros.sim.plant_loop import PlantLoop

CONFIG = SimulatorConfig(
    inertia_kg_m2=np.diag([1.0, 0.9, 0.6]), step_s=0.025, control_period_s=0.5,
    command_timeout_periods=3, max_torque_n_m=np.full(3, 0.3),
    initial_attitude_xyzw=np.array([0.0, 0.0, 0.0, 1.0]))
EPOCH_NS = 10**9


@pytest.mark.parametrize('factor', [0.5, 1.0, 20.0])
def test_steps_follow_the_wall_clock_times_the_factor(factor: float) -> None:
    free = FreeRun(0.025, factor, may_slip=False)
    free.start(100.0)
    rng = np.random.default_rng(1)
    wall, taken = 100.0, 0
    for gap in rng.uniform(0.0, 0.1, 200):
        wall += gap
        due = free.due(wall)
        assert due >= 0
        free.took(due)
        taken += due
        assert abs(taken * 0.025 - (wall - 100.0) * factor) <= 0.025 + 1e-9
    assert free.slipped_s == 0.0


def test_lost_time_is_made_up_or_slips() -> None:
    keep, slip = (FreeRun(0.025, 1.0, may_slip=choice) for choice in (False, True))
    for free in (keep, slip):
        free.start(0.0)
    assert keep.due(10.0) == 400
    assert slip.due(10.0) == round(LONGEST_CATCH_UP_S / 0.025)
    assert slip.slipped_s == pytest.approx(10.0 - LONGEST_CATCH_UP_S)


def test_held_time_is_not_made_up() -> None:
    free = FreeRun(0.025, 1.0, may_slip=True)
    free.start(0.0)
    free.took(free.due(0.1))
    free.hold(0.2)
    assert free.due(0.2) == 0
    assert free.due(0.2251) == 1
    assert free.slipped_s == pytest.approx(0.1)


def test_patience_ends_and_comes_back() -> None:
    patience = Patience(1.0)
    assert not patience.waits(0.0, overdue=False)
    assert patience.waits(0.1, overdue=True)
    assert patience.waits(1.0, overdue=True)
    assert not patience.waits(1.1, overdue=True)
    assert not patience.waits(5.0, overdue=True)
    assert not patience.waits(5.1, overdue=False)
    assert patience.waits(5.2, overdue=True)
    assert not Patience(0.0).waits(0.0, overdue=True)


def test_lockstep_waits_for_a_first_answer_for_ever() -> None:
    exchange = Lockstep(retry_s=0.25, timeout_s=1.0)
    exchange.ask(EPOCH_NS, 0.0)
    asked = [exchange.poll(wall) for wall in np.arange(0.0625, 100.0, 0.0625)]
    assert set(asked) == {Ask.WAIT, Ask.REPEAT}
    assert exchange.repeats == 399
    assert exchange.timeouts == 0
    assert exchange.asking


def test_lockstep_takes_only_the_answer_and_gives_up_later() -> None:
    exchange = Lockstep(retry_s=0.25, timeout_s=1.0)
    exchange.ask(EPOCH_NS, 0.0)
    assert not exchange.answer(EPOCH_NS - 1)
    assert exchange.asking
    assert exchange.answer(EPOCH_NS)
    assert not exchange.answer(EPOCH_NS)
    exchange.ask(2 * EPOCH_NS, 10.0)
    assert [exchange.poll(10.125), exchange.poll(10.25), exchange.poll(10.375)] == [
        Ask.WAIT, Ask.REPEAT, Ask.WAIT]
    assert exchange.poll(11.0) is Ask.GIVE_UP
    assert exchange.timeouts == 1
    assert not exchange.asking


def momentum(loop: PlantLoop) -> np.ndarray:
    return CONFIG.inertia_kg_m2 @ loop.measure().omega_BN_B


def test_a_command_lasts_three_control_periods() -> None:
    """About one principal axis from rest, momentum is torque times the time it acted."""
    loop = PlantLoop(CONFIG, EPOCH_NS)
    loop.command(np.array([0.02, 0.0, 0.0]))
    loop.advance(1000)
    np.testing.assert_allclose(momentum(loop), [0.02 * 1.5, 0.0, 0.0], atol=1e-12)
    assert loop.counters()['expired_commands'] == 1
    assert loop.counters()['commands_in_force'] == 0
    assert loop.stamp_ns == EPOCH_NS + 1000 * 25_000_000
    assert loop.elapsed_s == pytest.approx(25.0)


def test_a_command_that_is_renewed_lasts_on() -> None:
    loop = PlantLoop(CONFIG, EPOCH_NS)
    for _ in range(10):
        loop.command(np.array([0.02, 0.0, 0.0]))
        loop.advance(20)
    np.testing.assert_allclose(momentum(loop), [0.02 * 5.0, 0.0, 0.0], atol=1e-12)
    assert loop.counters()['expired_commands'] == 0
    assert loop.counters()['commands_in_force'] == 1


def test_the_life_of_a_command_is_never_below_150_ms() -> None:
    quick = SimulatorConfig(
        inertia_kg_m2=np.eye(3), step_s=0.001, state_period_s=0.002, control_period_s=0.01)
    assert quick.command_life_s == 0.15


def test_overdue_between_one_and_a_half_periods_and_the_end_of_life() -> None:
    loop = PlantLoop(CONFIG, EPOCH_NS)
    assert not loop.overdue  # no command has come yet
    loop.command(np.zeros(3))
    overdue = []
    for _ in range(70):
        loop.advance(1)
        overdue.append(loop.overdue)
    assert overdue == [False] * 29 + [True] * 31 + [False] * 10


def test_a_reset_puts_the_plant_back_but_not_the_time() -> None:
    loop = PlantLoop(CONFIG, EPOCH_NS)
    first = loop.measure()
    loop.command(np.array([0.3, 0.1, 0.0]))
    loop.advance(40)
    assert np.linalg.norm(loop.measure().omega_BN_B) > 0.1
    before_ns = loop.stamp_ns
    loop.reset()
    again = loop.measure()
    assert again.stamp_ns > before_ns
    np.testing.assert_array_equal(again.R_NB, first.R_NB)
    loop.advance(10)
    assert not loop.measure().omega_BN_B.any()  # the command ended with the reset
