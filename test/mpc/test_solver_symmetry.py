# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a plan must not depend on: the quaternion's sign, rounding, frames and units."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from cases import CERTIFIED, LIMITED, REFERENCE, cold, configuration, random_states, rest_axes
from strategies import generator, half_turns

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution

Make = Callable[..., AttitudeMpc]

KINDS = {'free': REFERENCE, 'limited': LIMITED, 'certified': CERTIFIED}
in_kinds = pytest.mark.parametrize('kind', sorted(KINDS))


def bits(plan: AttitudeMpcSolution) -> bytes:
    """Return everything that a plan says about the future, as bits."""
    return b''.join(np.ascontiguousarray(part).tobytes() for part in (
        plan.torques_B_n_m, plan.R_NB, plan.omega_BN_B, np.float64(plan.cost)))


def quaternions(n: int) -> Array:
    """Return n random quaternions, n half turns, and n within 1e-12 to 1e-3 rad of one."""
    rng = generator('quaternions')
    q = rng.standard_normal((3, n, 4))
    q[1, :, 0] = 0.0
    q[2, :, 0] = np.logspace(-12, -3, n) * rng.choice([-1.0, 1.0], size=n)
    q = q.reshape(-1, 4)
    return q / np.linalg.norm(q, axis=1, keepdims=True)


@in_kinds
def test_a_quaternion_and_its_negative_give_the_same_bits(controller: Make, kind: str) -> None:
    mpc = controller(**KINDS[kind])
    for q in quaternions(5):
        plans = [cold(mpc).solve(so3.rotation_from_quaternion(sign * q), np.zeros(3))
                 for sign in (1.0, -1.0)]
        assert bits(plans[0]) == bits(plans[1])


def test_the_sign_may_change_from_tick_to_tick(controller: Make) -> None:
    """A loop that gets -q on every second tick records the bits of one that never does."""
    mpc, R = controller(**CERTIFIED), half_turns(np.array([0.6, 0.0, 0.8]))
    mpc.reset()
    outcomes = []
    for signs in ((1.0, 1.0), (1.0, -1.0)):
        mpc.reset()
        plans = []
        for tick in range(8):
            angle = 0.1 * tick
            turned = so3.exp(np.array([0.0, 0.0, angle])) @ R
            q = signs[tick % 2] * so3.quaternion_from_rotation(turned)
            plans.append(bits(mpc.solve(so3.rotation_from_quaternion(q), np.zeros(3))))
        outcomes.append(plans)
    assert outcomes[0] == outcomes[1]


@in_kinds
def test_half_turns_choose_the_same_side_whatever_the_rounding(
        controller: Make, kind: str) -> None:
    """Seven ways to write the same half turn, mirrored ones included, give one plan."""
    mpc = controller(**KINDS[kind])
    for axis in rest_axes(5):
        q = np.concatenate([[0.0], axis])
        written = [half_turns(axis), half_turns(-axis), so3.exp(np.pi * axis),
                   so3.exp(-np.pi * axis), so3.rotation_from_quaternion(q),
                   so3.rotation_from_quaternion(-q), so3.project(half_turns(axis))]
        plans = [cold(mpc).solve(R, np.zeros(3)) for R in written]
        for plan in plans[1:]:
            assert plan.cost == pytest.approx(plans[0].cost, rel=1e-9)
            assert np.abs(plan.torques_B_n_m - plans[0].torques_B_n_m).max() < 1e-9


@in_kinds
def test_a_cold_solve_repeats_its_bits(controller: Make, kind: str) -> None:
    mpc = controller(**KINDS[kind])
    for R, omega in random_states('repeat', 3, 0.25):
        assert bits(cold(mpc).solve(R, omega)) == bits(cold(mpc).solve(R, omega))


@in_kinds
def test_only_the_error_to_the_setpoint_counts(controller: Make, kind: str) -> None:
    """Turning the inertial frame turns the plan: left translation of R_NB and R_ND."""
    mpc = controller(**KINDS[kind])
    turns = so3.random_rotations(generator('frames'), 4)
    for (R, omega), D in zip(random_states('setpoint', 4, 0.25), turns):
        plain = cold(mpc).solve(R, omega)
        turned = cold(mpc).solve(D @ R, omega, D)
        assert np.abs(turned.torques_B_n_m - plain.torques_B_n_m).max() < 1e-9
        assert np.abs(turned.omega_BN_B - plain.omega_BN_B).max() < 1e-9
        assert np.abs(turned.R_NB - D @ plain.R_NB).max() < 1e-9
        assert turned.cost == pytest.approx(plain.cost, rel=1e-9)


def test_body_axes_are_a_matter_of_choice(controller: Make) -> None:
    """With inertia, weights and rate in other body axes the torque is the same vector.

    Boxes belong to their axes, so this holds without limits only.
    """
    plain = controller(**REFERENCE)
    for Q in so3.random_rotations(generator('body axes'), 2):
        config = plain.config
        turned = AttitudeMpc(replace(
            config, inertia_kg_m2=symmetric(Q @ config.inertia_kg_m2 @ Q.T),
            rate_weight=symmetric(Q @ config.rate_weight @ Q.T)))
        for R, omega in random_states('axes', 4, 0.5):
            expected = cold(plain).solve(R, omega)
            plan = cold(turned).solve(Q @ R @ Q.T, Q @ omega)
            assert plan.cost == pytest.approx(expected.cost, rel=1e-9)
            assert np.abs(plan.torques_B_n_m - expected.torques_B_n_m @ Q.T).max() < 1e-9


def symmetric(matrix: Array) -> Array:
    """Return the symmetric part."""
    return (matrix + matrix.T) / 2


def rescaled(config: AttitudeMpcConfig, inertia: float, time: float, cost: float
             ) -> AttitudeMpcConfig:
    """Return the same problem for a body of another inertia, step and unit of cost."""
    torque = inertia / time**2
    assert config.max_torque_n_m is not None
    assert config.max_rate_rad_s is not None
    return replace(
        config, inertia_kg_m2=config.inertia_kg_m2 * inertia, step_s=config.step_s * time,
        attitude_weight=config.attitude_weight * cost,
        rate_weight=config.rate_weight * cost * time**2,
        torque_weight=config.torque_weight * cost / torque**2,
        max_torque_n_m=config.max_torque_n_m * torque,
        max_rate_rad_s=config.max_rate_rad_s / time)


@pytest.mark.parametrize(('inertia', 'time', 'cost'), [
    (0.01, 0.1, 1.0), (1e6, 40.0, 1.0), (1.0, 1.0, 1e4)], ids=['cubesat', 'station', 'cost'])
def test_a_cubesat_and_a_station_get_the_same_plan(
        controller: Make, cache_dir: str, inertia: float, time: float, cost: float) -> None:
    plain = controller(**CERTIFIED)
    other = AttitudeMpc(rescaled(configuration(**CERTIFIED), inertia, time, cost),
                        cache_dir=cache_dir)
    assert other.terminal.c == pytest.approx(plain.terminal.c * cost, rel=1e-9)
    for R, omega in random_states('scale', 4, 0.25):
        expected = cold(plain).solve(R, omega)
        plan = cold(other).solve(R, omega / time)
        assert plan.status is expected.status
        assert plan.cost == pytest.approx(cost * expected.cost, rel=1e-9)
        torques = plan.torques_B_n_m * time**2 / inertia
        assert np.abs(torques - expected.torques_B_n_m).max() < 1e-9
        assert np.abs(plan.R_NB - expected.R_NB).max() < 1e-9
