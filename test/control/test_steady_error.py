# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An error that stays is told from one that is being turned away, with noise too."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from golden import BROKEN, GOLDEN, NAMES
from hypothesis import given, settings
from hypothesis import strategies as st
from scripted import CONFIG, SAMPLE, STEP_NS, Script, loop_with

from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.steady_error import SteadyError
from manifold_mpc_ros.control.target import FixedTarget
from manifold_mpc_ros.control.tick_time import LOCKSTEP
from manifold_mpc_ros.lab.recording.bags.run import read_run
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

LEAST_RAD = 0.005
HORIZON = 20
FEW = settings(max_examples=15, deadline=None)  # each is hundreds of ticks


def first_warned(errors_rad: Array, horizon: int = HORIZON) -> int | None:
    """Return the tick, from 1, at which the first warning came."""
    watch = SteadyError(dataclasses.replace(CONFIG, horizon=horizon), LEAST_RAD)
    for tick, error in enumerate(map(float, errors_rad), start=1):
        watch.see(dataclasses.replace(SAMPLE, R_NB=so3.exp([error, 0.0, 0.0])),
                  FixedTarget(np.eye(3)),
                  reduced=True)
        if watch.stays_rad is not None:
            return tick
    return None


@FEW
@given(offset_deg=st.floats(0.6, 170.0), noise=st.floats(0.0, 0.03), seed=st.integers(0, 99))
def test_an_offset_is_said_after_two_horizons(offset_deg: float, noise: float, seed: int) -> None:
    """Whatever its size above the least, with noise of up to 3 % of it."""
    random = np.random.default_rng(seed)
    errors = math.radians(offset_deg) * (1.0 + noise * random.standard_normal(50))
    assert first_warned(errors) == 2 * HORIZON


@FEW
@given(start_rad=st.floats(1e-6, 3.1), left=st.floats(0.0, 0.995), noise=st.floats(0.0, 1e-3),
       seed=st.integers(0, 99))
def test_an_error_that_falls_is_not_said(
    start_rad: float, left: float, noise: float, seed: int,
) -> None:
    """By half a percent a tick or more, down to noise below the least error."""
    random = np.random.default_rng(seed)
    errors = np.abs(start_rad * left ** np.arange(300) + noise * random.standard_normal(300))
    assert first_warned(errors) is None


@pytest.mark.parametrize('name', sorted(set(NAMES) - set(BROKEN)))
def test_recorded_runs_give_no_warning(name: str) -> None:
    run = read_run(GOLDEN / f'{name}.mcap')
    errors = run.error_rad[np.searchsorted(run.states.stamp_ns, run.commands.stamp_ns)]
    assert len(errors) > 10
    assert first_warned(errors, horizon=5) is None


def ticks(loop: ControlLoop, count: int) -> None:
    """Let the loop tick with the same state."""
    for _ in range(count):
        assert loop.sample is not None
        loop.admit(dataclasses.replace(
            loop.sample, stamp_ns=loop.sample.stamp_ns + STEP_NS, omega_BN_B=np.zeros(3)))
        loop.tick(LOCKSTEP)


def test_the_loop_watches_while_it_commands_and_begins_anew_with_a_setpoint() -> None:
    loop = loop_with(Script())
    loop.exchange(dataclasses.replace(loop._law, largest_steady_error_rad=0.01))
    offset = so3.exp([math.radians(0.95), 0.0, 0.0])
    loop.admit(dataclasses.replace(SAMPLE, R_NB=offset, omega_BN_B=np.zeros(3)))
    ticks(loop, 3)
    assert loop.steady_error.stays_rad is None
    ticks(loop, 2)  # two horizons of two steps, and the first tick
    assert loop.steady_error.stays_rad == pytest.approx(math.radians(0.95))
    assert loop.steady_error.rate_rad_s == 0.0
    loop.aim(FixedTarget(so3.exp([0.0, 0.02, 0.0])))
    assert loop.steady_error.stays_rad is None
    ticks(loop, 4)
    assert loop.steady_error.stays_rad is not None
    loop.aim(FixedTarget(offset))
    ticks(loop, 4)
    assert loop.steady_error.stays_rad is None
    assert loop.steady_error.attitude_rad < 1e-9
    loop.aim(FixedTarget(np.eye(3)))
    ticks(loop, 4)
    loop.logic.paused = True
    ticks(loop, 1)
    assert loop.steady_error.stays_rad is None


def test_the_status_has_both_errors_and_warns() -> None:
    pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
    from manifold_mpc_ros.nodes.controller.diagnostics import status_of
    loop = loop_with(Script())
    loop.exchange(dataclasses.replace(loop._law, largest_steady_error_rad=0.01))
    loop.admit(dataclasses.replace(
        SAMPLE, R_NB=so3.exp([0.0, math.radians(0.95), 0.0]), omega_BN_B=np.zeros(3)))
    levels = []
    for _ in range(6):
        ticks(loop, 1)
        status = status_of(loop.tick(LOCKSTEP), loop, '')
        levels.append(status.level)
    assert levels[0] == b'\x00'
    assert levels[-1] == b'\x01'
    assert status.message.endswith('; the attitude error stays at 0.95 deg')
    assert status.values['attitude_error_deg'] == pytest.approx(0.95)
    assert status.values['rate_error_rad_s'] == 0.0
