# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cones without a plan: the body is stopped clear of them where it can be, and leaves them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray
from scripted import CONFIG, STEP_NS, Script, failed, loop_with
from strategies import generator

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.control.cone_guard import ConeGuard
from manifold_mpc_ros.control.fallback_law import FallbackLaw
from manifold_mpc_ros.control.input_gate import StateSample
from manifold_mpc_ros.control.modes import Mode
from manifold_mpc_ros.control.tick_time import LOCKSTEP
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.solution import SolveStatus

Array = NDArray[np.float64]

SUN = Cone('sun', (1.0, 0.0, 0.0), (0.2, 1.0, 0.3), 0.5)
SENSOR = Cone('sensor', (0.0, 0.3, 1.0), (0.2, -0.1, 1.0), 1.4, 'keep_in')
WEAK = dataclasses.replace(CONFIG, horizon=20, max_torque_n_m=0.05, max_rate_rad_s=0.2,
                           cones=(SUN, SENSOR))
SUBSTEPS = 5
TICKS = 24


def margin_rad(R_NB: Array, cones: tuple[Cone, ...] = WEAK.cones) -> float:
    return min(float(cone.margins_rad(R_NB)) for cone in cones)


def moved(R_NB: Array, omega: Array, torque: Array) -> list[tuple[Array, Array]]:
    """Return the states of a tick, finer than the controller's steps."""
    states = []
    for _ in range(SUBSTEPS):
        R_NB, omega = lgvi_step(R_NB, omega, torque, inertia_kg_m2=WEAK.inertia_kg_m2,
                                step_s=WEAK.step_s / SUBSTEPS)
        states.append((R_NB, omega))
    return states


def lowest(R_NB: Array, omega: Array, law: FallbackLaw | None) -> float:
    """Return the least margin [rad] at any time under a law, or braking without one."""
    least = np.inf
    for _ in range(TICKS):
        states = moved(R_NB, omega, brake(omega) if law is None
                       else law.torque(R_NB, omega, np.eye(3)))
        least = min(least, *(margin_rad(R) for R, _ in states))
        R_NB, omega = states[-1]
    return least


def towards_sun(rng: np.random.Generator) -> tuple[Array, Array]:
    """Return an attitude a few degrees outside the Sun's cone, turning into it."""
    away = np.array([0.0, *rng.standard_normal(2)])
    axis_N = so3.exp(np.cross(SUN.direction_N, [1.0, 0.0, 0.0]) * rng.uniform(0.3, 1.0)
                     ) @ SUN.direction_N
    R = so3.exp(np.cross([1.0, 0.0, 0.0], axis_N)) @ so3.exp(away * 0.2)
    turn = np.cross([1.0, 0.0, 0.0], R.T @ SUN.direction_N)
    return R, 0.18 * turn / np.linalg.norm(turn)


def brake(omega: Array) -> Array:
    wanted = -WEAK.inertia_kg_m2 @ omega / (4.0 * WEAK.step_s)
    return wanted / max(1.0, float(np.abs(wanted).max()) / 0.05)


def test_it_swerves_where_braking_would_sweep_the_sun_through_a_boresight() -> None:
    rng, saved, lost = generator('swerve'), 0, 0
    for _ in range(400):
        R, omega = towards_sun(rng)
        if margin_rad(R, WEAK.kept_cones) < 0.02 or lowest(R, omega, None) >= 0.0:
            continue
        least = lowest(R, omega, FallbackLaw(WEAK))
        saved += least >= 0.0
        lost += least < 0.0
        if saved + lost == 4:
            break
    assert saved >= 2, (saved, lost)


def test_it_leaves_a_cone_and_does_not_come_back() -> None:
    """At rest inside, the target behind: out by about the shortest way, then no cone again."""
    R = so3.exp(np.cross([1.0, 0.0, 0.0], SUN.direction_N) * 1.2)
    assert -0.5 < margin_rad(R) < -0.2
    law, omega, margins = FallbackLaw(WEAK), np.zeros(3), []
    for _ in range(60):
        states = moved(R, omega, law.torque(R, omega, np.eye(3)))
        margins += [margin_rad(R) for R, _ in states]
        R, omega = states[-1]
    outside = int(np.flatnonzero(np.array(margins) >= 0.0)[0])
    assert (np.diff(margins[:outside]) > -1e-4).all()
    assert min(margins[outside:]) >= 0.0
    # Three times the time that the strongest torque, on and then reversed, would take to the edge.
    best_s = 2.0 * (-margins[0] * 0.6 / 0.05) ** 0.5
    assert outside * WEAK.step_s / SUBSTEPS < 3.0 * best_s
    direct = FallbackLaw(dataclasses.replace(WEAK, cones=()))
    R, omega, deepest = so3.exp(np.cross([1.0, 0.0, 0.0], SUN.direction_N) * 1.9), omega * 0, 0.0
    for _ in range(60):
        R, omega = moved(R, omega, direct.torque(R, omega, np.eye(3)))[-1]
        deepest = min(deepest, margin_rad(R))
    assert deepest < -0.1  # without cones the law goes home through the Sun


def test_a_rate_limit_is_kept_and_every_torque_is_within_the_limits() -> None:
    guard, rng = ConeGuard(WEAK), generator('limits')
    R, omega = towards_sun(rng)
    for _ in range(8):
        torque = guard.keep(R, omega, np.array([0.0, 0.05, -0.05]), {})
        assert (np.abs(torque) <= 0.05 * (1.0 + 1e-12)).all()
        R, omega = moved(R, omega, torque)[-1]
        assert (np.abs(omega) <= 0.2 * (1.0 + 1e-3)).all()


def near_the_sun(rate: float, away_deg: float = 5.0) -> tuple[Array, Array]:
    """Return an attitude so far outside the Sun's cone, turning into it at a rate [rad/s]."""
    turn = np.cross([1.0, 0.0, 0.0], SUN.direction_N)
    turn /= np.linalg.norm(turn)
    angle = np.arccos(SUN.direction_N[0]) - WEAK.kept_cones[0].half_angle_rad - np.deg2rad(
        away_deg)
    return so3.exp(angle * turn), rate * turn


def test_what_wheels_give_is_what_a_stop_counts_on() -> None:
    """Limits of 0.3 N m, wheels of 0.01 N m: what the box stops in time, they do not."""
    strong = dataclasses.replace(WEAK, max_torque_n_m=0.3, cones=(SUN,))
    wheels = WheelArray(np.eye(3), np.full(3, 0.01), np.full(3, 10.0))
    R, omega = near_the_sun(0.15, away_deg=30.0)
    boxed, wheeled = (ConeGuard(dataclasses.replace(strong, wheels=each)) for each in (
        None, wheels))
    assert boxed.allows(R, omega, np.zeros(3), {})
    assert not wheeled.allows(R, omega, np.zeros(3), {})
    torque = wheeled.keep(R, omega, omega, {})
    assert wheels.torques.gauge(torque) == pytest.approx(1.0)
    assert torque @ omega < 0.0


@pytest.mark.parametrize(('rate', 'mode'), [(0.0, Mode.HOLD), (0.15, Mode.FALLBACK)])
def test_a_stored_plan_is_followed_only_while_the_body_can_stop_clear(
    rate: float, mode: Mode,
) -> None:
    solver = Script(20)
    loop = loop_with(solver, WEAK)
    R, omega = near_the_sun(rate)
    solver.torque = 0.01 * omega
    loop.admit(StateSample(0, R, omega))
    assert loop.tick(LOCKSTEP).mode is Mode.NOMINAL
    failed(solver)
    loop.admit(StateSample(STEP_NS, R, omega))
    command = loop.tick(LOCKSTEP)
    assert command.mode is mode
    assert ('could not stop clear of the cones' in command.reason) == (mode is Mode.FALLBACK)


def test_a_relaxed_plan_into_a_cone_is_not_applied_but_one_out_of_it_is() -> None:
    solver = Script(20)
    loop = loop_with(solver, WEAK)
    solver.status = SolveStatus.INFEASIBLE
    R, omega = near_the_sun(0.15)
    solver.torque = 0.3 * omega
    loop.admit(StateSample(0, R, omega))
    assert loop.tick(LOCKSTEP).mode is Mode.FALLBACK
    inside = R @ so3.exp(2.0 * omega)
    assert margin_rad(inside) < 0.0
    loop.admit(StateSample(STEP_NS, inside, omega))
    command = loop.tick(LOCKSTEP)
    assert command.mode is Mode.NOMINAL
    np.testing.assert_array_equal(command.torque_B_n_m, solver.torque)  # with cones at once


@pytest.mark.parametrize(('jump', 'mode'), [(True, Mode.NOMINAL), (False, Mode.HOLD)])
def test_after_a_jump_of_a_direction_no_old_plan_bounds_the_value(
    jump: bool, mode: Mode,
) -> None:
    solver = Script(20)
    loop = loop_with(solver, WEAK)
    loop.direct('sun', SUN.direction_N, 0)
    R = so3.exp([0.0, 0.0, -0.5])
    solver.torque = np.zeros(3)
    loop.admit(StateSample(0, R, np.zeros(3)))
    assert loop.tick(LOCKSTEP).mode is Mode.NOMINAL
    moved_by = 0.1 if jump else 1e-4
    loop.direct('sun', so3.exp([0.0, 0.0, moved_by]) @ SUN.direction_N, 0)
    solver.status, solver.cost = SolveStatus.FEASIBLE, 2.0
    loop.admit(StateSample(STEP_NS, R, np.zeros(3)))
    assert loop.tick(LOCKSTEP).mode is mode
    assert solver.directions_N is not None
