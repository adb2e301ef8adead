# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Actuators through the real control loop: a second kind is one class and one entry.

The made-up kind has four thrust pairs on a pyramid that give whole multiples of a least torque,
so that what is realised differs from what is asked for.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import PROPERTY, any_vector, finite_vector
from scripted import CONFIG, FREE, OMEGA, R_NB, SAMPLE, STEP_NS, TIMEOUT_S, Script, gate

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.interfaces import ACTUATORS, load
from manifold_mpc_ros.control.actuator import Actuation, TorqueActuator
from manifold_mpc_ros.control.command import Law
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.decrease_monitor import DecreaseMonitor
from manifold_mpc_ros.control.decrease_record import Decrease, Tolerance
from manifold_mpc_ros.control.output_gate import OutputGate
from manifold_mpc_ros.control.solver_thread import DirectSolver, solve_with
from manifold_mpc_ros.control.tick_time import LOCKSTEP, ClockTime
from manifold_mpc_ros.dynamics.lgvi import lgvi_step

AXES_B = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]).T / np.sqrt(3.0)
LEAST_N_M = 0.01


class Pairs:
    """Thrust pairs of 0.5 N m each, in steps of ``least_n_m``."""

    least_n_m = LEAST_N_M
    refusal = found = ''
    watches = True
    usage: Mapping[str, float] = MappingProxyType({})

    @classmethod
    def from_config(cls, _config: AttitudeMpcConfig) -> Pairs:
        return cls()

    def observe(self, omega_BN_B: np.ndarray, devices: np.ndarray | None) -> np.ndarray | None:
        self.observed = omega_BN_B, devices
        return devices

    def limited(self, torque_B_n_m: np.ndarray, part: float = 1.0) -> np.ndarray:
        asked = np.max(np.abs(np.linalg.pinv(AXES_B) @ torque_B_n_m))
        return torque_B_n_m if asked <= 0.5 * part else torque_B_n_m * (0.5 * part / asked)

    def allocate(self, torque_B_n_m: np.ndarray) -> Actuation:
        device = np.linalg.pinv(AXES_B) @ torque_B_n_m
        if self.least_n_m:
            device = self.least_n_m * np.round(device / self.least_n_m)
        return Actuation(torque_B_n_m, device, AXES_B @ device)

    def rest(self) -> Actuation:
        return self.allocate(np.zeros(3))


class FinePairs(Pairs):
    """The same without a least torque: all that is asked for is realised, but for rounding."""

    least_n_m = 0.0


KINDS = {name: f'{__name__}:{name}' for name in ('Pairs', 'FinePairs')}


def loop_of(kind: str, solver: Script, monkeypatch: pytest.MonkeyPatch) -> ControlLoop:
    """Return a control loop with the actuator that the table names for a kind."""
    monkeypatch.setitem(ACTUATORS, kind, KINDS[kind])
    monitor = DecreaseMonitor(Tolerance(0.1, 1e-9), step_s=CONFIG.step_s)
    law = Law(CONFIG, DirectSolver(solve_with(solver)), TIMEOUT_S, monitor)
    return ControlLoop(law, gate(), initial_setpoint='identity',
                       make_actuator=load(ACTUATORS[kind]).from_config)


def test_the_devices_get_their_command_and_the_state_moves_on_under_what_is_realised(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    solver = Script()
    loop = loop_of('Pairs', solver, monkeypatch)
    loop.admit(SAMPLE)
    actuation = loop.tick(ClockTime(SAMPLE.stamp_ns)).actuation
    assert actuation.device.shape == (4,)
    np.testing.assert_array_equal(actuation.torque_B_n_m, solver.torque)
    assert np.abs(actuation.realised_B_n_m - solver.torque).max() > 1e-4
    loop.tick(ClockTime(SAMPLE.stamp_ns + STEP_NS))
    expected, other = (lgvi_step(
        R_NB, OMEGA, torque, inertia_kg_m2=CONFIG.inertia_kg_m2, step_s=CONFIG.step_s)
        for torque in (actuation.realised_B_n_m, actuation.torque_B_n_m))
    np.testing.assert_array_equal(solver.states[-1][1], expected[1])
    assert (solver.states[-1][1] != other[1]).any()


@pytest.mark.parametrize(('kind', 'made'), [('Pairs', 0), ('FinePairs', 2)])
def test_the_decrease_is_expected_where_the_planned_torque_is_realised(
    kind: str, made: int, monkeypatch: pytest.MonkeyPatch,
) -> None:
    solver = Script()
    loop = loop_of(kind, solver, monkeypatch)
    for number in range(2):
        loop.admit(dataclasses.replace(SAMPLE, stamp_ns=SAMPLE.stamp_ns + number * STEP_NS))
        record = loop.tick(LOCKSTEP).decrease
        assert record is not None
    assert record.counters.made == made
    assert (record.verdict is Decrease.NONE) == (made == 0)
    if not made:
        assert record.reason == 'not the torque of the plan was commanded'


def test_another_law_brings_another_actuator() -> None:
    """Limits that change at run time are those of the next command."""
    solver = Script()
    loop = ControlLoop(Law(FREE, DirectSolver(solve_with(solver)), TIMEOUT_S), gate(),
                       initial_setpoint='identity')
    solver.torque = np.array([3.0, 0.0, 0.0])
    loop.admit(SAMPLE)
    assert loop.tick(LOCKSTEP).torque_B_n_m[0] == 3.0
    loop.exchange(Law(CONFIG, DirectSolver(solve_with(solver)), TIMEOUT_S))
    assert loop.tick(LOCKSTEP).torque_B_n_m[0] == pytest.approx(0.3)
    assert loop.output.saturated == 1


@PROPERTY
@given(torques=st.lists(any_vector.map(np.array), min_size=1, max_size=4), slew=st.booleans())
def test_whatever_is_asked_for_the_devices_stay_within_their_limits(
    torques: list, slew: bool,
) -> None:
    gate_out = OutputGate(Pairs())
    for asked in torques:
        if slew:
            gate_out.slew()
        actuation = gate_out.let_through(asked)
        assert np.abs(actuation.device).max() <= 0.5 + LEAST_N_M
        np.testing.assert_allclose(actuation.realised_B_n_m, AXES_B @ actuation.device)
        assert np.abs(actuation.realised_B_n_m - actuation.torque_B_n_m).max() <= 4 * LEAST_N_M
    assert not gate_out.zero().device.any()


@PROPERTY
@given(torque=finite_vector.map(np.array))
def test_a_body_torque_is_realised_as_it_is_commanded(torque: np.ndarray) -> None:
    actuator = TorqueActuator(np.array([0.3, 0.2, 0.1]))
    limited = actuator.limited(torque)
    actuation = actuator.allocate(limited)
    assert actuation.realises(limited)
    assert actuation.realises(torque) == (
        np.abs(limited - torque).max() <= 1e-9 * np.abs(torque).max())
    assert actuator.limited(limited) is limited
