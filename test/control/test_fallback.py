# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The fallback law: within the limits, never adding energy, and home from everywhere."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from cases import configuration
from hypothesis import given
from hypothesis import strategies as st
from properties import PROPERTY, finite_vector, rotations
from strategies import INERTIAS, generator

from manifold_mpc_ros.control.fallback_law import ATTITUDE_SHARE, FallbackLaw
from manifold_mpc_ros.dynamics.lgvi import kinetic_energy, lgvi_step
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.target import error_angle

LIMIT = np.array([0.3, 0.2, 0.1])
CONFIGS = {
    'attitude': configuration(max_torque_n_m=LIMIT),
    'free': configuration(max_torque_n_m=None),
    'pointing': configuration(max_torque_n_m=LIMIT, target='pointing',
                              pointing_axis_B=np.array([0.6, 0.0, 0.8])),
    'off_diagonal': configuration(inertia_kg_m2=INERTIAS['off_diagonal'], max_torque_n_m=0.3),
    'fast': configuration(step_s=0.01, max_torque_n_m=0.3),
}
LAWS = {name: FallbackLaw(config) for name, config in CONFIGS.items()}
names = st.sampled_from(sorted(CONFIGS))


def fresh(name: str) -> FallbackLaw:
    """Return a law that remembers nothing."""
    LAWS[name].reset()
    return LAWS[name]


def potential(law: FallbackLaw, config: Any, R_NB: np.ndarray, R_ND: np.ndarray) -> float:
    """Return 4 k (1 - cos(theta/2)) [J]."""
    angle = float(error_angle(config, so3.attitude_error_B(R_ND, R_NB)))
    return 8.0 * law._stiffness_n_m * np.sin(angle / 4.0) ** 2


@PROPERTY
@given(name=names, R_NB=rotations(), R_ND=rotations(), omega=finite_vector.map(np.array))
def test_every_torque_is_finite_and_within_the_limits(
    name: str, R_NB: np.ndarray, R_ND: np.ndarray, omega: np.ndarray,
) -> None:
    config = CONFIGS[name]
    torque = fresh(name).torque(R_NB, omega, R_ND)
    assert np.isfinite(torque).all()
    if config.max_torque_n_m is not None:
        assert (np.abs(torque) <= config.max_torque_n_m * (1.0 + 1e-12)).all()


@PROPERTY
@given(name=names, R_NB=rotations(), R_ND=rotations(),
       omega=st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(np.array))
def test_the_energy_of_body_and_law_never_rises(
    name: str, R_NB: np.ndarray, R_ND: np.ndarray, omega: np.ndarray,
) -> None:
    """V = omega^T J omega / 2 + 4 k (1 - cos(theta/2)) along a short step of the body.

    Within 0.1 rad of 180 degrees the side may change, where cos(theta/2) has a corner.
    """
    config, law = CONFIGS[name], fresh(name)
    if float(error_angle(config, so3.attitude_error_B(R_ND, R_NB))) > np.pi - 0.1:
        return
    J, step_s = config.inertia_kg_m2, 1e-5
    torque = law.torque(R_NB, omega, R_ND)
    before = kinetic_energy(omega, J)
    R_1, omega_1 = lgvi_step(R_NB, omega, torque, inertia_kg_m2=J, step_s=step_s)
    change = kinetic_energy(omega_1, J) - before
    if not law.beyond_guard(omega):  # beyond it the torque brakes, and the energy alone falls
        change += potential(law, config, R_1, R_ND) - potential(law, config, R_NB, R_ND)
    assert change <= 1e-12 + 10.0 * step_s ** 2 * (1.0 + before)


@pytest.mark.parametrize('name', sorted(CONFIGS))
@pytest.mark.parametrize('rate', [0.0, 0.2, 5.0])
def test_it_brings_the_body_home_from_everywhere(name: str, rate: float) -> None:
    """The torque held for 0.1 s; 180 degrees and a tumble included."""
    config = CONFIGS[name]
    rng = generator('home', name, rate)
    half_turn = so3.exp(np.pi * np.array([0.0, 0.6, 0.8]))
    for R_NB in [half_turn, *so3.random_rotations(rng, 1)]:
        law, omega = FallbackLaw(config), rate * rng.uniform(-1.0, 1.0, 3)
        step_s = 0.1
        for _ in range(round(300.0 / step_s)):
            torque = law.torque(R_NB, omega, np.eye(3))
            R_NB, omega = substeps(config, R_NB, omega, torque, step_s)
            left = float(error_angle(config, R_NB))
            if left < 1e-2 and np.linalg.norm(omega) < 1e-2:
                break
        assert left < 1e-2, (name, rate)


def substeps(
    config: Any, R_NB: np.ndarray, omega: np.ndarray, torque: np.ndarray, step_s: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the state after a control step, with enough plant steps for its rate."""
    number = 1 + int(10.0 * step_s * np.linalg.norm(omega))
    for _ in range(number):
        R_NB, omega = lgvi_step(R_NB, omega, torque, inertia_kg_m2=config.inertia_kg_m2,
                                step_s=step_s / number)
    return R_NB, omega


@pytest.mark.parametrize('name', ['attitude', 'pointing'])
def test_the_side_of_a_half_turn_is_kept_under_noise(name: str) -> None:
    """About y: any axis of the body but the pointing one turns to its opposite."""
    config = CONFIGS[name]
    law, rng = FallbackLaw(config), generator('side', name)
    half_turn = so3.exp([0.0, np.pi, 0.0])
    noisy = [half_turn @ so3.exp(1e-3 * rng.standard_normal(3)) for _ in range(50)]
    torques = np.array([law.torque(R, np.zeros(3), np.eye(3)) for R in noisy])
    assert (torques @ torques[0] > 0.0).all()
    forgetful = np.array([fresh(name).torque(R, np.zeros(3), np.eye(3)) for R in noisy])
    assert (forgetful @ forgetful[0] < 0.0).any()  # it would chatter otherwise


def test_opposite_pointing_has_a_way_out() -> None:
    config = CONFIGS['pointing']
    flip = so3.exp(np.pi * np.array([0.0, 1.0, 0.0]))
    torque = FallbackLaw(config).torque(flip, np.zeros(3), np.eye(3))
    assert np.linalg.norm(torque) > 1e-3
    assert abs(torque @ config.pointing_axis_B) < 1e-12
    assert not FallbackLaw(config).torque(np.eye(3), np.zeros(3), np.eye(3)).any()


@pytest.mark.parametrize('part', [0.999, 1.001])
def test_the_guard_is_where_the_implicit_step_stops_being_guaranteed(part: float) -> None:
    config = CONFIGS['attitude']
    rate = part * 0.6 / (config.step_s * 1.0)
    law, omega = FallbackLaw(config), np.array([rate, 0.0, 0.0])
    assert law.beyond_guard(omega) == (part > 1.0)
    assert law.beyond_guard(np.array([np.nan, 0.0, 0.0]))
    braking = law.torque(so3.exp([0.0, 1.0, 0.0]), omega, np.eye(3))
    assert (abs(braking[0]) == pytest.approx(0.3)) == (part > 1.0)
    assert (braking[1:] == 0.0).all() == (part > 1.0)


def test_the_attitude_gets_half_of_the_smallest_limit_at_most() -> None:
    weak = dataclasses.replace(CONFIGS['attitude'], max_torque_n_m=np.full(3, 0.01))
    torque = FallbackLaw(weak).torque(so3.exp([np.pi, 0.0, 0.0]), np.zeros(3), np.eye(3))
    np.testing.assert_allclose(np.abs(torque), [ATTITUDE_SHARE * 0.01, 0.0, 0.0], atol=1e-12)
    strong = FallbackLaw(CONFIGS['free']).torque(
        so3.exp([1.0, 0.0, 0.0]), np.zeros(3), np.eye(3))
    np.testing.assert_allclose(strong, [-0.6 / 4.0 ** 2 * 2.0 * np.sin(0.5), 0.0, 0.0], atol=1e-12)


def test_from_rest_a_rate_ellipsoid_is_kept_and_would_be_broken_without() -> None:
    """The stiffness is bounded by the largest energy that keeps the limit."""
    E = 400.0 * np.eye(3)
    limited, free = (configuration(max_torque_n_m=0.3, rate_ellipsoid_s2=E_s2)
                     for E_s2 in (E, None))
    largest = []
    for config in (limited, free):
        law, R, omega = FallbackLaw(config), so3.exp(np.array([0.0, 0.0, 3.0])), np.zeros(3)
        forms = []
        for _ in range(4000):
            torque = law.torque(R, omega, np.eye(3))
            R, omega = lgvi_step(R, omega, torque, inertia_kg_m2=config.inertia_kg_m2,
                                 step_s=0.02, forcing='symmetric')
            forms.append(float(omega @ E @ omega))
        largest.append(max(forms))
    assert largest[0] <= 1.0
    assert largest[1] > 1.0
