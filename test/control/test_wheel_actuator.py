# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reaction wheels behind the output gate and in the control loop."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from properties import EXAMPLES, PROPERTY, any_vector
from scripted import CONFIG, SAMPLE, TIMEOUT_S, Script, gate
from wheel_cases import INERTIA, wheels

from manifold_mpc_ros.config.interfaces import ACTUATORS, load
from manifold_mpc_ros.control.command import Law
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.devices.wheel_actuator import WheelActuator
from manifold_mpc_ros.control.modes import Mode
from manifold_mpc_ros.control.output_gate import OutputGate
from manifold_mpc_ros.control.solver_thread import DirectSolver, solve_with
from manifold_mpc_ros.control.tick_time import LOCKSTEP
from manifold_mpc_ros.errors import ConfigurationError

ARRAY = wheels(max_torque_n_m=0.3, max_momentum_n_m_s=2.0)
WITH_WHEELS = dataclasses.replace(CONFIG, wheels=ARRAY)
STORED = np.array([1.0, -0.5, 0.3, 0.2])


def loop_of(solver: Script) -> ControlLoop:
    """Return a control loop whose actuator is the four wheels."""
    return ControlLoop(Law(WITH_WHEELS, DirectSolver(solve_with(solver)), TIMEOUT_S), gate(),
                       initial_setpoint='identity',
                       make_actuator=load(ACTUATORS['wheels']).from_config)


def test_the_planned_torque_is_realised_with_momentum_stored() -> None:
    solver = Script()
    loop = loop_of(solver)
    loop.output.devices = STORED
    loop.admit(SAMPLE)
    command = loop.tick(LOCKSTEP)
    assert command.mode is Mode.NOMINAL
    assert solver.momentum is STORED
    assert command.actuation.realises(solver.torque)
    assert loop.output.saturated == 0
    # the motors give more than the torque alone asks for
    alone = ARRAY.inverse @ -solver.torque
    assert np.abs(ARRAY.matrix @ (command.actuation.device - alone)).max() > 0.1


def test_too_few_wheels_brake_and_say_so_until_they_are_back() -> None:
    solver = Script()
    loop = loop_of(solver)
    loop.output.devices = np.where([True, True, False, False], np.nan, STORED)
    loop.admit(SAMPLE)
    command = loop.tick(LOCKSTEP)
    assert command.mode is Mode.FALLBACK
    assert command.reason.startswith('only 2 of 4 wheels work')
    assert not command.actuation.device[:2].any()
    assert command.torque_B_n_m @ SAMPLE.omega_BN_B < 0.0
    loop.output.devices = STORED
    loop.admit(dataclasses.replace(SAMPLE, stamp_ns=SAMPLE.stamp_ns + 1))
    assert loop.tick(LOCKSTEP).mode is Mode.NOMINAL


def test_braking_with_one_wheel_never_adds_energy() -> None:
    actuator = WheelActuator(wheels(), INERTIA, 2.0)
    momentum = np.array([0.0, np.nan, np.nan, np.nan])
    rng = np.random.default_rng(5)
    for omega in 0.1 * rng.normal(size=(200, 3)):
        actuator.observe(omega, momentum)
        actuation = actuator.allocate(np.array([1.0, 2.0, 3.0]))
        after = omega + 2.0 * np.linalg.solve(INERTIA, actuation.realised_B_n_m)
        assert after @ INERTIA @ after < omega @ INERTIA @ omega


@settings(PROPERTY, max_examples=EXAMPLES // 5)
@given(torques=st.lists(any_vector.map(np.array), min_size=1, max_size=3), slew=st.booleans(),
       stored=st.lists(st.floats(-0.03, 0.03) | st.just(np.nan), min_size=4, max_size=4),
       rate=st.tuples(*[st.floats(-2.0, 2.0)] * 3))
def test_whatever_is_asked_for_motors_and_momenta_stay_within_their_limits(
    torques: list, slew: bool, stored: list, rate: tuple,
) -> None:
    """A wheel beyond its momentum (a report of 0.03, a limit of 0.02) gets no more of it."""
    array = wheels()
    gate_out = OutputGate(WheelActuator(array, INERTIA, 0.5))
    gate_out.devices = np.array(stored)
    gate_out.observe(np.array(rate))
    known = np.nan_to_num(gate_out.devices)
    for asked in torques:
        if slew:
            gate_out.slew()
        actuation = gate_out.let_through(asked)
        assert np.isfinite(actuation.realised_B_n_m).all()
        assert (np.abs(actuation.device) <= array.max_torque_n_m * (1 + 1e-9)).all()
        assert not actuation.device[np.isnan(gate_out.devices)].any()
        if not gate_out.actuator.refusal:
            after = np.abs(known + 0.5 * actuation.device)
            room = np.maximum(np.abs(known), array.max_momentum_n_m_s)
            assert (after <= room + 1e-8).all()
    assert not gate_out.zero().device.any()


def test_wheels_have_to_be_described() -> None:
    with pytest.raises(ConfigurationError, match=r'^wheels: '):
        WheelActuator.from_config(CONFIG)
