# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A torque that comes late: the plan starts where the body will be when it comes."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from cases import CERTIFIED, configuration
from closed_loops import Flight, fly
from hypothesis import given
from hypothesis import strategies as st
from scripted import CONFIG

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.control.torque_history import TorqueHistory
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

HALF_TURN = (0.0, 0.0, 1.0, 0.0)
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope='module')
def mpc() -> AttitudeMpc:
    return AttitudeMpc(configuration(**CERTIFIED))


@given(st.lists(st.integers(1, 9), max_size=8), st.integers(-5, 60), st.integers(0, 30))
def test_history_is_what_was_sent(gaps: list[int], begin: int, length: int) -> None:
    history, sent, now = TorqueHistory(1000), {}, 0
    for number, gap in enumerate(gaps, 1):
        now += gap
        sent[now] = float(number)
        history.record(now, np.full(3, float(number)))
    told = [float(torque[0]) for lasting, torque in history.between(begin, begin + length)
            for _ in range(lasting)]
    assert told == [sent[max((t for t in sent if t <= at), default=0)] if any(
        t <= at for t in sent) else 0.0 for at in range(begin, begin + length)]


@given(st.lists(st.integers(1, 9), max_size=8), st.lists(st.integers(-5, 60), min_size=1),
       st.integers(1, 30))
def test_impulses_are_sums_of_what_was_sent(
    gaps: list[int], begins: list[int], length: int,
) -> None:
    history, now = TorqueHistory(10**12), 0
    for number, gap in enumerate(gaps, 1):
        now += gap
        history.record(now * 10**9, np.array([number, -number, 0.5]))
    sums = [sum((lasting * torque for lasting, torque in history.between(
        begin * 10**9, (begin + length) * 10**9)), np.zeros(3)) / 1e9 for begin in begins]
    np.testing.assert_allclose(
        history.impulses(np.array(begins) - 3.0, length, 3 * 10**9), sums, atol=1e-9)


def test_history_forgets_what_is_old_and_what_was_sent_later_than_now() -> None:
    history = TorqueHistory(10)
    for time, size in ((0, 1.0), (20, 2.0), (40, 3.0), (30, 4.0)):
        history.record(time, np.full(3, size))
    assert [(lasting, torque[0]) for lasting, torque in history.between(0, 50)] == [
        (20, 0.0), (10, 2.0), (20, 4.0)]


def late(mpc: AttitudeMpc, declared_s: float, delay_s: float, age_steps: int = 0) -> Flight:
    return fly(mpc, 20.0, age_steps=age_steps, law={'actuation_delay_s': declared_s},
               plant={'actuation_delay_s': delay_s, 'initial_attitude_xyzw': HALF_TURN})


@pytest.mark.parametrize('age_steps', [0, 7])
@pytest.mark.parametrize('delay_s', [0.4, 0.65])
def test_a_declared_delay_costs_little_time_and_no_rate(
    mpc: AttitudeMpc, delay_s: float, age_steps: int,
) -> None:
    prompt, delayed = late(mpc, 0.0, 0.0), late(mpc, delay_s, delay_s, age_steps)
    ignored = late(mpc, 0.0, delay_s, age_steps)
    limit = mpc.config.max_rate_rad_s
    assert limit is not None
    assert delayed.settled_s(np.deg2rad(0.1)) <= 1.1 * prompt.settled_s(np.deg2rad(0.1))
    assert (np.abs(delayed.rate_rad_s) <= limit).all()
    assert not (np.abs(ignored.rate_rad_s) <= limit * 1.1).all()


def test_a_plan_starts_where_the_body_is_when_its_torque_acts(mpc: AttitudeMpc) -> None:
    flight = late(mpc, 0.65, 0.65, 7)
    for tick, command in enumerate(flight.commands[3:20], 3):
        assert command.solution is not None
        acts = 20 * tick + 26  # the body turns by 0.3 rad a step
        assert so3.angle(command.solution.R_NB[0]) == pytest.approx(
            flight.angle_rad[acts], abs=1e-2)
        assert command.solution.omega_BN_B[0] == pytest.approx(flight.rate_rad_s[acts], abs=1e-2)


def test_a_delay_of_more_than_ten_steps_is_refused() -> None:
    config = ControllerConfig.from_yaml(ROOT / 'config' / 'controller.yaml')
    assert dataclasses.replace(config, actuation_delay_s=10.0 * CONFIG.step_s)
    with pytest.raises(ConfigurationError, match='at most 10 steps'):
        dataclasses.replace(config, actuation_delay_s=10.1 * CONFIG.step_s)
