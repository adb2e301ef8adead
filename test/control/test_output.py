# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The gate at the exit: finite, within the limits, in the direction that was asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import PROPERTY, any_vector, finite_vector

from manifold_mpc_ros.control.actuator import TorqueActuator, scaled_into
from manifold_mpc_ros.control.output_gate import SLEW_FRACTION, OutputGate

LIMIT = np.array([0.3, 0.2, 0.1])
limits = st.tuples(*[st.floats(1e-3, 1e3) | st.just(math.inf)] * 3).map(np.array)


def passed(gate: OutputGate, asked: np.ndarray) -> np.ndarray:
    """Return the body torque that is commanded for one that is asked for."""
    return gate.let_through(asked).torque_B_n_m


def test_a_torque_within_the_limits_passes_to_the_bit() -> None:
    gate = OutputGate(TorqueActuator(LIMIT))
    asked = np.array([0.3, -0.2, 0.05])
    np.testing.assert_array_equal(passed(gate, asked), asked)
    np.testing.assert_array_equal(gate.latest.torque_B_n_m, asked)
    assert (gate.saturated, gate.not_finite) == (0, 0)
    np.testing.assert_array_equal(gate.zero().torque_B_n_m, np.zeros(3))
    assert not gate.latest.torque_B_n_m.any()


def test_no_limits_and_other_limits() -> None:
    gate = OutputGate(TorqueActuator(None))
    huge = np.array([1e6, -1e9, 0.0])
    np.testing.assert_array_equal(passed(gate, huge), huge)
    gate.actuator = TorqueActuator(LIMIT)
    np.testing.assert_allclose(passed(gate, np.array([0.6, 0.0, 0.1])), [0.3, 0.0, 0.05])
    assert gate.saturated == 1


@pytest.mark.parametrize('asked', [
    [math.nan, 0.0, 0.0], [0.0, math.inf, 0.0], [0.1, 0.1], [[0.1, 0.1, 0.1]], []])
def test_what_is_no_torque_is_zero_and_counted(asked: list) -> None:
    gate = OutputGate(TorqueActuator(LIMIT))
    for count in (1, 2):
        np.testing.assert_array_equal(passed(gate, np.array(asked)), np.zeros(3))
        assert (gate.not_finite, gate.saturated) == (count, 0)


def test_the_way_back_is_gradual_and_ends() -> None:
    gate = OutputGate(TorqueActuator(LIMIT))
    passed(gate, -LIMIT)
    gate.slew()
    seen = [passed(gate, LIMIT) for _ in range(4)]
    np.testing.assert_allclose(seen, np.outer([-0.5, 0.0, 0.5, 1.0], LIMIT), atol=1e-15)
    np.testing.assert_array_equal(passed(gate, LIMIT), LIMIT)
    np.testing.assert_array_equal(passed(gate, -LIMIT), -LIMIT)  # it has ended
    gate.slew()
    gate.zero()
    np.testing.assert_array_equal(passed(gate, LIMIT), LIMIT)  # zero is no way back


def test_a_free_axis_needs_no_way_back() -> None:
    gate = OutputGate(TorqueActuator(np.array([math.inf, math.inf, 0.1])))
    gate.slew()
    np.testing.assert_array_equal(
        passed(gate, np.array([9.0, -5.0, 0.05])), [9.0, -5.0, 0.05])
    assert not gate._returning


class Noting(TorqueActuator):
    """Keeps what it is told of the devices."""

    def observe(self, omega_BN_B: np.ndarray, devices: np.ndarray | None) -> None:
        self.seen = omega_BN_B, devices


def test_the_actuator_is_told_the_rate_and_what_the_devices_report() -> None:
    actuator = Noting(LIMIT)
    gate, rate, speeds = OutputGate(actuator), np.ones(3), np.zeros(4)
    gate.observe(rate)
    assert actuator.seen == (rate, None)
    gate.devices = speeds
    gate.observe(rate)
    assert actuator.seen[1] is speeds
    actuator.refusal = 'no wheels'
    assert gate.actuator.refusal == 'no wheels'


def test_from_one_end_of_floats_to_the_other_there_is_no_way_back() -> None:
    gate, end = OutputGate(TorqueActuator(None)), np.full(3, 1.7e308)
    passed(gate, -end)
    gate.slew()
    np.testing.assert_array_equal(passed(gate, end), end)
    assert not gate._returning


@PROPERTY
@given(torques=st.lists(any_vector, min_size=1, max_size=4), limit=limits, slew=st.booleans())
def test_whatever_is_asked_for_what_leaves_is_finite_and_within_the_limits(
    torques: list, limit: np.ndarray, slew: bool,
) -> None:
    gate = OutputGate(TorqueActuator(limit))
    for asked in torques:
        if slew:
            gate.slew()
        torque = passed(gate, np.array(asked))
        assert np.isfinite(torque).all()
        assert (np.abs(torque) <= limit).all()
        np.testing.assert_array_equal(torque, gate.latest.torque_B_n_m)


@PROPERTY
@given(asked=finite_vector.map(np.array), limit=limits)
def test_the_direction_is_kept_and_nothing_is_amplified(
    asked: np.ndarray, limit: np.ndarray,
) -> None:
    torque = scaled_into(asked, limit)
    lengths = np.linalg.norm(asked), np.linalg.norm(torque)
    assert lengths[1] <= lengths[0] * (1.0 + 1e-12)
    assert asked @ torque >= lengths[0] * lengths[1] * (1.0 - 1e-9)
    if (np.abs(asked) <= limit).all():
        np.testing.assert_array_equal(torque, asked)
    else:  # and it uses what the limits leave
        assert np.max(np.abs(torque) / limit) == pytest.approx(1.0)


@PROPERTY
@given(first=finite_vector.map(np.array), goal=finite_vector.map(np.array), limit=limits)
def test_on_the_way_back_no_step_is_larger_than_the_slew(
    first: np.ndarray, goal: np.ndarray, limit: np.ndarray,
) -> None:
    gate = OutputGate(TorqueActuator(limit))
    last, end = passed(gate, first), scaled_into(goal, limit)
    gate.slew()
    for _ in range(5):
        torque = passed(gate, goal)
        step = np.abs(torque - last)
        assert (step <= SLEW_FRACTION * limit * (1.0 + 1e-9)).all()
        last = torque
    np.testing.assert_array_equal(last, end)
