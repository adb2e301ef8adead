# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Profiles towards setpoints that jump: what they are, and the control loop that follows them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import BODY, CERTIFIED, configuration
from strategies import INERTIAS, generator

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.control.moving.slew_profile import ProfiledTarget, SlewPlanner
from manifold_mpc_ros.control.target import FixedTarget, Target
from manifold_mpc_ros.lab.tracking.body import ContinuousBody
from manifold_mpc_ros.lab.tracking.flight import Flight, fly
from manifold_mpc_ros.lab.tune.rule import bang_bang_time_s
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import SolveStatus

PART, NEAR_RAD, REST = 0.95, 0.1, np.zeros(3)
H = 0.1
CONFIG = configuration(**{
    **CERTIFIED, 'step_s': H, 'horizon': 40, 'rate_weight': 0.3 * np.eye(3),
    'torque_weight': (np.radians(1.0) / 0.3) ** 2 * np.eye(3)})
GOAL = so3.exp([0.4, -0.3, 0.2])
WHEELS = WheelArray(np.array([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]]), 0.2, 100.0)


def begun(config: AttitudeMpcConfig, R_NB: Array, omega: Array = REST, R_ND: Array = GOAL,
          ) -> Target:
    return SlewPlanner(config, PART, NEAR_RAD).target(
        FixedTarget(R_ND), (R_NB, omega), 0, {})


def sampled(target: Target, config: AttitudeMpcConfig) -> tuple[Array, Array, Array]:
    """Return attitudes and rates at 20,000 times, and the torques between them by Euler."""
    assert isinstance(target, ProfiledTarget)
    end_s = target.profile.arcs[-1].time_s[-1]
    reference = target.over_horizon(0, end_s / 20_000, 20_000)
    omega, J = reference.omega_DN_D, config.inertia_kg_m2
    middle = (omega[1:] + omega[:-1]) / 2.0
    torque = np.diff(omega, axis=0) @ J * 20_000 / end_s + np.cross(middle, middle @ J)
    return reference.R_ND, omega, torque


@pytest.mark.parametrize('body', ['diagonal', 'off_diagonal', 'wheels'])
def test_a_profile_begins_with_the_state_and_rests_at_the_goal_within_the_limits(body: str
                                                                                ) -> None:
    more: dict[str, Any] = {'inertia_kg_m2': INERTIAS['off_diagonal']} if (
        body == 'off_diagonal') else {'wheels': WHEELS} if body == 'wheels' else {}
    config = configuration(**{**CERTIFIED, 'horizon': 10, **more})
    rng = generator('slew profile')
    for omega in (REST, *rng.uniform(-0.3, 0.3, (5, 3))):
        R_NB = so3.random_rotations(rng, 1)[0]
        target = begun(config, R_NB, omega)
        R, rates, torque = sampled(target, config)
        np.testing.assert_allclose(R[0], R_NB, atol=1e-12)
        np.testing.assert_allclose(rates[0], omega, atol=1e-12)
        np.testing.assert_allclose(R[-1], GOAL, atol=1e-12)
        np.testing.assert_array_equal(rates[-1], REST)
        assert np.linalg.norm(np.diff(rates, axis=0), axis=1).max() < 1e-3  # no jump
        moved = np.linalg.norm(so3.log(np.swapaxes(R[:-1], 1, 2) @ R[1:]), axis=1)
        turned = np.linalg.norm((rates[1:] + rates[:-1]) / 2.0, axis=1)
        end_s = target.profile.arcs[-1].time_s[-1]  # type: ignore[union-attr]
        np.testing.assert_allclose(moved * 20_000 / end_s, turned, atol=5e-5)  # at a switch
        assert abs(end_s / config.step_s - round(end_s / config.step_s)) < 1e-9
        assert np.abs(rates[10_000:]).max() <= 0.6 * PART * (1.0 + 1e-9)
        used = (np.abs(torque) / 0.3 if config.wheels is None else np.abs(
            torque @ config.wheels.torques.normals.T) / config.wheels.torques.bounds)
        assert PART - 0.1 < used.max() < PART + 0.01


@pytest.mark.parametrize('degrees', [20.0, 90.0, 180.0])
def test_it_is_as_quick_as_its_part_of_the_limits(degrees: float) -> None:
    axis = np.array([0.0, 1.0, 0.0])
    target = begun(CONFIG, so3.exp(np.radians(degrees) * axis), R_ND=np.eye(3))
    assert isinstance(target, ProfiledTarget)
    scaled = configuration(**{
        **CERTIFIED, 'max_torque_n_m': 0.3 * PART, 'max_rate_rad_s': 0.6 * PART})
    quickest_s = bang_bang_time_s(scaled, axis, np.radians(degrees))
    assert 0.999 * quickest_s < target.profile.arcs[-1].time_s[-1] < 1.003 * quickest_s + H


def test_what_is_near_begins_none_and_a_setpoint_that_creeps_carries_it() -> None:
    planner, start, begins = SlewPlanner(CONFIG, PART, NEAR_RAD), so3.exp([1.5, 0.0, 0.0]), []

    def target(R_ND: Array, R_NB: Array, time_ns: int) -> Target:
        return planner.target(FixedTarget(R_ND), (R_NB, REST), time_ns, {}, begins.append)

    assert not target(np.eye(3), so3.exp([0.09, 0.0, 0.0]), 0).moves
    first = target(np.eye(3), start, 0)
    crept = so3.exp([0.0, 0.05, 0.0])
    there, rate = first.at(10**9)
    second = target(crept, there, 10**9)
    np.testing.assert_allclose(second.at(10**9)[0], crept @ there, atol=1e-15)
    np.testing.assert_array_equal(second.at(10**9)[1], rate)
    assert len(begins) == 1
    jumped = target(GOAL, there, 10**9)
    np.testing.assert_allclose(jumped.at(10**9)[0], there, atol=1e-12)
    assert len(begins) == 2
    assert not target(GOAL, GOAL, 100 * 10**9).moves
    planner.forget()
    assert not target(GOAL, GOAL, 0).moves


def test_a_body_too_fast_to_be_stopped_and_a_path_through_a_cone_have_none() -> None:
    slender = configuration(**{**CERTIFIED, 'inertia_kg_m2': [1.0, 0.9, 0.2],
                               'max_rate_rad_s': np.inf, 'max_torque_n_m': 0.01})
    assert not begun(slender, np.eye(3), np.array([0.3, 0.0, 0.3])).moves
    sun = Cone('sun', np.eye(3)[0], np.eye(3)[1], np.radians(20.0))
    kept = configuration(**{**CERTIFIED, 'step_s': H, 'horizon': 40, 'cones': [sun]})
    planner = SlewPlanner(kept, PART, NEAR_RAD)

    def moves(vector: tuple[float, float, float], directions_N: dict[str, Array]) -> bool:
        return planner.target(FixedTarget(np.eye(3)), (so3.exp(vector), REST), 0,
                              directions_N).moves

    assert not moves((0.0, 0.0, 2.5), {})
    assert not moves((0.0, 0.0, 0.5), {})  # clear by now, but begun without
    planner.forget()
    assert moves((0.0, 0.0, 2.5), {'sun': -np.eye(3)[1]})
    planner.forget()
    assert moves((2.5, 0.0, 0.0), {})


def test_pointing_turns_the_axis_the_short_way() -> None:
    config = configuration(**{**CERTIFIED, 'target': 'pointing'})
    R_NB = so3.exp([0.0, 1.2, 0.0]) @ so3.exp([0.0, 0.0, 2.0])
    R, rates, _ = sampled(begun(config, R_NB, R_ND=np.eye(3)), config)
    np.testing.assert_allclose(R[-1][:, 2], np.eye(3)[2], atol=1e-12)
    assert np.abs(rates[:, 2]).max() < 1e-12  # about an axis across the one that points
    assert so3.angle(R_NB.T @ R[-1]) == pytest.approx(1.2)


@pytest.fixture(scope='module')
def mpc() -> AttitudeMpc:
    return AttitudeMpc(CONFIG, moving=True)


def flown(mpc: AttitudeMpc, vector: list[float], omega: list[float], duration_s: float,
          **given: Any) -> Flight:
    body = ContinuousBody(BODY, step_s=H / 5, R_NB=so3.exp(vector), omega_BN_B=np.array(omega),
                          max_torque_n_m=CONFIG.max_torque_n_m)
    return fly(mpc, body, FixedTarget(np.eye(3)), duration_s,
               slews=SlewPlanner(CONFIG, PART, NEAR_RAD), **given)


def kept(flight: Flight) -> bool:
    last = flight.commands[-1].decrease
    assert last is not None
    return (last.counters.broken == 0 and (np.abs(flight.torque_n_m) <= 0.3 + 1e-9).all()
            and bool((np.abs(flight.rate_rad_s[20:]) < 0.6).all())
            and {command.solution.status for command in flight.commands  # type: ignore[union-attr]
                 } <= {SolveStatus.CONVERGED, SolveStatus.FEASIBLE})


@pytest.mark.parametrize('vector', [[np.pi, 0.0, 0.0], [0.0, np.pi / 2, 0.0], [0.7, -0.7, 1.4]])
def test_a_slew_settles_within_ten_percent_of_the_bang_bang_time(
    mpc: AttitudeMpc, vector: list[float],
) -> None:
    angle = float(np.linalg.norm(vector))
    bound_s = bang_bang_time_s(CONFIG, np.array(vector) / angle, angle)
    flight = flown(mpc, vector, [0.0, 0.0, 0.0], 1.5 * bound_s)
    assert flight.settled_s(np.radians(0.1)) < 1.1 * bound_s
    assert kept(flight)
    assert so3.angle(flight.attitudes[-1]) < 1e-4


def test_a_tumble_and_a_setpoint_in_the_middle_are_turned_to(mpc: AttitudeMpc) -> None:
    flight = flown(mpc, [2.0, 1.0, -1.0], [0.3, -0.2, 0.3], 20.0,
                   later={30: FixedTarget(GOAL)})
    assert kept(flight)
    assert so3.angle(GOAL.T @ flight.attitudes[-1]) < 1e-4
    assert flight.settled_s(np.radians(0.1)) < 17.0
