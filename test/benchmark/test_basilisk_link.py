# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Between Basilisk's numbers and ours: attitudes, references, inertias, and lines on a pipe.

The runs in Basilisk itself are those of `make basilisk`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / 'benchmarks' / 'basilisk'))

import link

from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.lie import so3

#: Says the description's attitude again, turned by a command, and ends without one.
STAND_IN = """
import json, sys
given = json.loads(sys.stdin.readline())
state = {'time_s': 0.0, 'sigma_BN': given['sigma_BN'], 'omega_BN_B': [0.0] * 3,
         'measured_sigma_BN': [0.0, 0.0, 0.0]}
print(json.dumps(state), flush=True)
for line in sys.stdin:
    asked = json.loads(line)
    if not asked['command']:
        sys.exit(3)
    state['time_s'] += 0.5
    state['omega_BN_B'] = asked['command']
    print(json.dumps(state), flush=True)
"""


def textbook(sigma: np.ndarray) -> np.ndarray:
    """Return R_NB of MRP by the formula for the direction cosines [BN], transposed."""
    s, square = so3.hat(sigma), float(sigma @ sigma)
    return (np.eye(3) + (8.0 * s @ s - 4.0 * (1.0 - square) * s) / (1.0 + square) ** 2).T


@pytest.mark.parametrize('seed', range(20))
def test_attitudes_are_those_of_the_textbook_and_come_back(seed: int) -> None:
    sigma = np.random.default_rng(seed).uniform(-0.5, 0.5, 3)
    R_NB = link.rotation_of(sigma)
    np.testing.assert_allclose(R_NB, textbook(sigma), atol=1e-14)
    shadow = -sigma / (sigma @ sigma)
    np.testing.assert_allclose(link.rotation_of(shadow), R_NB, atol=1e-13)
    np.testing.assert_allclose(link.sigma_of(R_NB), sigma if sigma @ sigma <= 1.0 else shadow,
                               atol=1e-14)


def test_half_a_turn_is_of_length_one() -> None:
    sigma = link.sigma_of(so3.exp([0.0, np.pi, 0.0]))
    np.testing.assert_allclose(np.abs(sigma), [0.0, 1.0, 0.0], atol=1e-15)


def test_a_reference_has_rate_and_its_derivative_in_inertial_axes() -> None:
    omega, alpha, d = np.array([0.02, -0.05, 0.03]), np.array([1e-3, 2e-3, -3e-3]), 1e-4
    R = so3.exp([0.4, -1.1, 0.6])
    sigma, rate_N, change_N = link.reference_of(R, omega, alpha)
    np.testing.assert_allclose(textbook(np.array(sigma)), R, atol=1e-14)
    later, earlier = (R @ so3.exp(t * omega + t * t / 2.0 * alpha) for t in (d, -d))
    np.testing.assert_allclose(
        so3.hat(np.array(rate_N)), (later - earlier) / (2.0 * d) @ R.T, atol=1e-8)
    np.testing.assert_allclose(
        change_N, (later @ (omega + d * alpha) - earlier @ (omega - d * alpha)) / (2.0 * d),
        atol=1e-8)


def test_the_inertia_of_the_hub_has_that_of_the_wheels_about_their_axes() -> None:
    body, spin = np.diag([0.05, 0.06, 0.02]), 2e-3
    wheels = WheelArray(np.eye(3), 1e-3, 1e-2, inertia_kg_m2=spin)
    np.testing.assert_allclose(link.hub_inertia(body, None), body.ravel())
    np.testing.assert_allclose(link.hub_inertia(body, wheels), (body + spin * np.eye(3)).ravel())


def test_lines_go_and_come_and_a_plant_that_ends_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    stand_in = tmp_path / 'stand_in.py'
    stand_in.write_text(STAND_IN, encoding='utf-8')
    monkeypatch.setattr(link, 'PLANT', stand_in)
    R_NB = so3.exp([0.3, -0.2, 0.9])
    with link.BasiliskProcess({'sigma_BN': link.sigma_of(R_NB)}, Path(sys.executable)) as plant:
        np.testing.assert_allclose(plant.state.R_NB, R_NB, atol=1e-14)
        state = plant.advance(command=np.array([1e-3, 0.0, -2e-3]))
        assert state.time_s == 0.5
        assert state.omega_BN_B.tolist() == [1e-3, 0.0, -2e-3]
        assert state.measured_R_NB.tolist() == np.eye(3).tolist()
        assert state.wheel_speed_rad_s.size == 0
        with pytest.raises(SystemExit, match='ended with 3'):
            plant.advance(command=[])
