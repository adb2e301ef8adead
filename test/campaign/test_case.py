# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a case draws is a function of seed, set and index, and is distributed as its file says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from campaign_plans import mapping, plan, plants
from cases import INERTIAS

from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.campaign.case import Case, CaseName, all_names, draw_case
from manifold_mpc_ros.lab.campaign.random_cones import straight_way
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.target import error_angle


def drawn(one: dict[str, Any], count: int = 1, **changed: Any) -> list[Case]:
    """Draw the first cases of a campaign of one set."""
    small = plan(one, **changed)
    return [draw_case(small, CaseName(one['name'], index)) for index in range(count)]


def start(attitude: dict[str, Any], rate: dict[str, Any] | None = None) -> dict[str, Any]:
    return {'name': 'some', 'loops': 1, 'attitude': attitude, 'rate': rate or {'kind': 'rest'}}


def same(one: Case, other: Case) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in (
        'R_NB', 'omega_BN_B', 'R_ND', 'inertia_kg_m2', 'disturbance_n_m',
        'attitude_noise_std_rad', 'rate_noise_std_rad_s', 'noise_seed'))


def test_a_case_depends_on_seed_set_and_index_alone() -> None:
    for one in (plants(), *mapping()['sets']):
        name = CaseName(one['name'], 17)
        case = draw_case(plan(one), name)
        assert same(case, draw_case(plan({**one, 'loops': 99}, duration_s=5.0), name))
        for other in (draw_case(plan(one), CaseName(one['name'], 18)),
                      draw_case(plan(one, seed=1), name)):
            assert not np.allclose(case.R_NB, other.R_NB)


def test_one_quantity_drawn_otherwise_leaves_the_others() -> None:
    (case,) = drawn(plants())
    (other,) = drawn(plants(inertia={'moments_part': 0.3}, setpoint={'kind': 'identity'}))
    assert not np.allclose(case.inertia_kg_m2, other.inertia_kg_m2)
    for name in ('omega_BN_B', 'disturbance_n_m', 'noise_seed', 'attitude_noise_std_rad'):
        assert np.array_equal(getattr(case, name), getattr(other, name))
    assert np.allclose(case.R_NB, case.R_ND @ other.R_NB, atol=1e-15)


def test_random_starts_fill_attitudes_and_the_ball_of_rates() -> None:
    cases = drawn(start({'kind': 'uniform'}, {'kind': 'ball', 'largest_rad_s': 0.3}), 2000)
    R, omega = np.array([case.R_NB for case in cases]), np.array([c.omega_BN_B for c in cases])
    # A uniform attitude has mean 0 and E[angle] = pi/2 + 2/pi; a uniform ball E[r] = 3/4 R.
    assert np.abs(R.mean(axis=0)).max() < 0.05
    assert so3.angle(R).mean() == pytest.approx(np.pi / 2 + 2 / np.pi, abs=0.05)
    lengths = np.linalg.norm(omega, axis=1)
    assert lengths.max() <= 0.3
    assert lengths.mean() == pytest.approx(0.225, abs=0.005)
    assert np.abs(omega.mean(axis=0)).max() < 0.02


def test_half_turns_are_exact_principal_axes_first() -> None:
    J = INERTIAS['off_diagonal']
    turns = drawn(start({'kind': 'half_turn'}), 20,
                  controller={'spacecraft.inertia_kg_m2': np.ravel(J).tolist()})
    for index, case in enumerate(turns):
        assert so3.angle(case.R_NB) == np.pi
        assert np.array_equal(case.omega_BN_B, np.zeros(3))
        axis = so3.log(case.R_NB) / np.pi
        principal = np.linalg.norm(np.cross(J @ axis, axis)) < 1e-12
        assert principal == (index < 3)


def test_half_turns_of_pointing_are_antipodes_of_any_roll() -> None:
    one, pointing = start({'kind': 'half_turn'}), {'target': 'pointing',
                                                   'pointing.axis_B': [0.6, 0.0, 0.8]}
    config, rolls = plan(one, controller=pointing).config, []
    for case in drawn(one, 20, controller=pointing):
        b = config.pointing_axis_B
        assert np.allclose(case.R_NB.T @ b, -b, rtol=0.0, atol=1e-15)
        assert error_angle(config, case.R_NB) == pytest.approx(np.pi, abs=1e-15)
        rolls.append(case.R_NB[1] @ np.array([0.0, 1.0, 0.0]))
    assert np.ptp(rolls) > 1.0


def test_angles_and_fixed_starts_are_seen_from_the_commanded_attitude() -> None:
    setpoint = {'kind': 'uniform'}
    cases = drawn(start({'kind': 'angle', 'angle_deg': [170.0, 175.0]}) | {'setpoint': setpoint},
                  200)
    angles = np.degrees([so3.angle(case.R_ND.T @ case.R_NB) for case in cases])
    assert angles.min() > 170.0 - 1e-9
    assert angles.max() < 175.0 + 1e-9
    assert np.ptp(angles) > 4.0
    assert so3.angle(np.array([case.R_ND for case in cases])).mean() > 1.5
    (fixed,) = drawn(start({'kind': 'fixed', 'xyzw': [0.0, 0.0, 0.6, 0.8]},
                           {'kind': 'fixed', 'rad_s': [0.1, 0.2, 0.3]}) | {'setpoint': setpoint})
    assert so3.angle(fixed.R_ND.T @ fixed.R_NB) == pytest.approx(2.0 * np.arcsin(0.6))
    assert fixed.omega_BN_B.tolist() == [0.1, 0.2, 0.3]


def test_bodies_are_spread_about_the_model_and_can_exist() -> None:
    cases = drawn(plants(inertia={'moments_part': 0.6, 'axes_deg': 30.0}), 300)
    moments = np.array([np.linalg.eigvalsh(case.inertia_kg_m2) for case in cases])
    assert np.all(moments[:, 0] + moments[:, 1] > moments[:, 2])
    traces = moments.sum(axis=1)
    assert traces.min() < 0.75 * 2.5
    assert traces.max() > 1.25 * 2.5
    axes = [np.linalg.eigh(case.inertia_kg_m2)[1] for case in drawn(
        plants(inertia={'axes_deg': 5.0}), 100)]
    tilts = np.degrees([np.arccos(np.abs(np.diag(one)).max().clip(max=1.0)) for one in axes])
    assert tilts.max() < 5.0 + 1e-6
    (exact,) = drawn(plants(inertia={}))
    assert np.allclose(exact.inertia_kg_m2, np.diag([1.0, 0.9, 0.6]), atol=1e-15)


def test_disturbance_and_noise_stay_in_their_ranges() -> None:
    cases = drawn(plants(), 300)
    torques = np.linalg.norm([case.disturbance_n_m for case in cases], axis=1)
    assert torques.max() <= 1e-3
    assert torques.mean() == pytest.approx(7.5e-4, rel=0.05)
    noises = [case.attitude_noise_std_rad for case in cases]
    assert min(noises) >= 1e-5
    assert max(noises) <= 1e-4
    assert np.mean(noises) == pytest.approx(5.5e-5, rel=0.1)
    assert {case.rate_noise_std_rad_s for case in cases} == {1e-5}
    assert len({case.noise_seed for case in cases}) == 300


def test_normal_rates() -> None:
    cases = drawn(plants(rate={'kind': 'normal', 'std_rad_s': [0.1, 0.2, 0.3]}), 2000)
    assert np.std([case.omega_BN_B for case in cases], axis=0) == pytest.approx(
        [0.1, 0.2, 0.3], rel=0.06)


@pytest.mark.parametrize('text', ['random-0', 'near_pi-12'])
def test_names_read_back(text: str) -> None:
    assert str(CaseName.parse(text)) == text


@pytest.mark.parametrize('text', ['', 'random', 'random-', 'random--1', '7', 'random-1x'])
def test_other_names_are_refused(text: str) -> None:
    with pytest.raises(ConfigurationError, match=f"case.*'{text}'"):
        CaseName.parse(text)


def test_all_names_are_in_the_order_of_the_file_and_sets_have_to_exist() -> None:
    assert [str(name) for name in all_names(plan())] == [
        'random-0', 'random-1', 'random-2', 'opposite-0', 'opposite-1', 'opposite-2']
    with pytest.raises(ConfigurationError, match=r"'tumble' is not valid.*'opposite'"):
        draw_case(plan(), CaseName('tumble', 1))


def test_drawn_cones_are_kept_at_both_ends_and_stand_in_the_way() -> None:
    one = start({'kind': 'angle', 'angle_deg': [90.0, 180.0]}) | {
        'setpoint': {'kind': 'uniform'},
        'cones': {'most': 3, 'keep_in_part': 0.3, 'on_the_way': True}}
    limits = {'limits.max_torque_n_m': [0.3] * 3, 'limits.max_rate_rad_s': [0.3] * 3}
    cases = drawn(one, 30, controller=limits)
    for case in cases:
        way = straight_way(case.R_NB, case.R_ND)
        assert min(cone.margins_rad(way[[0, -1]]).min() for cone in case.cones) > np.radians(1.0)
        assert min(cone.margins_rad(way).min() for cone in case.cones) < 0.0
        for cone in case.cones:
            low, high = (70.0, 135.0) if cone.kind == 'keep_in' else (12.0, 50.0)
            assert low <= np.degrees(cone.half_angle_rad) <= high
    assert {len(case.cones) for case in cases} == {1, 2, 3}
    assert {cone.kind for case in cases for cone in case.cones} == {'keep_in', 'keep_out'}
    (bare,) = drawn({key: value for key, value in one.items() if key != 'cones'},
                    controller=limits)
    assert bare.cones == ()
    assert same(bare, cases[0])
    with pytest.raises(ConfigurationError, match=r'cones.*in 1000 draws'):
        drawn(one | {'attitude': {'kind': 'angle', 'angle_deg': [0.0, 1.0]}}, controller=limits)
