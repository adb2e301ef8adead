# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Gravity gradient against the attraction of point masses, the dipole, the circular orbit."""

from __future__ import annotations

import numpy as np
import pytest

from manifold_mpc_ros.config.orbit import EARTH_GM_M3_S2, CircularOrbit
from manifold_mpc_ros.dynamics.environment import dipole_field_N, gravity_gradient_B
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3

ORBIT = CircularOrbit(500e3, 1.7, 0.4, 0.3)


def test_the_torque_is_that_of_point_masses() -> None:
    """Six masses of a large body (100 m: differences of their attraction keep digits)."""
    rng = np.random.default_rng(2)
    masses, places_B = rng.uniform(1.0, 3.0, 6), 100.0 * rng.normal(size=(6, 3))
    places_B -= masses @ places_B / masses.sum()
    J = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, places_B))
    R_NB, r_N = so3.exp([0.3, -1.2, 0.8]), ORBIT.position_N_m(0.0)
    pulls_N = [-EARTH_GM_M3_S2 * m * (r_N + R_NB @ p) / np.linalg.norm(r_N + R_NB @ p) ** 3
               for m, p in zip(masses, places_B)]
    expected = sum(np.cross(p, R_NB.T @ f) for p, f in zip(places_B, pulls_N))
    torque = gravity_gradient_B(R_NB, r_N, J)
    assert np.linalg.norm(torque - expected) < 1e-4 * np.linalg.norm(expected)


def test_a_batch_is_what_each_gets_alone() -> None:
    R, r = so3.exp(np.arange(12.0).reshape(4, 3)), 7e6 * np.arange(1.0, 13.0).reshape(4, 3)
    for one, each in zip(gravity_gradient_B(R, r, np.diag([1.0, 2.0, 2.5])), range(4)):
        np.testing.assert_allclose(
            one, gravity_gradient_B(R[each], r[each], np.diag([1.0, 2.0, 2.5])), rtol=1e-12)


def test_the_dipole_points_north_falls_with_the_cube_and_has_no_sources() -> None:
    assert dipole_field_N([6371.2e3, 0, 0]) == pytest.approx([0, 0, 2.98e-5])
    assert dipole_field_N([0, 0, 2 * 6371.2e3]) == pytest.approx([0, 0, -2 * 2.98e-5 / 8])
    r, d = ORBIT.position_N_m(700.0), 100.0
    slopes = np.array([(dipole_field_N(r + d * e) - dipole_field_N(r - d * e)) / (2 * d)
                       for e in np.eye(3)])
    assert abs(np.trace(slopes)) < 1e-6 * np.abs(slopes).max()
    assert np.abs(slopes - slopes.T).max() < 1e-6 * np.abs(slopes).max()


def test_the_orbit_is_a_fall_round_the_earth() -> None:
    before, now, after = (ORBIT.position_N_m(900.0 + t) for t in (-1.0, 0.0, 1.0))
    expected = -EARTH_GM_M3_S2 * now / np.linalg.norm(now) ** 3
    assert np.linalg.norm(now) == pytest.approx(ORBIT.radius_m)
    np.testing.assert_allclose(after - 2 * now + before, expected, rtol=1e-4)
    assert np.degrees(np.arccos(np.cross(now, after)[2] / np.linalg.norm(
        np.cross(now, after)))) == pytest.approx(np.degrees(1.7))
    with pytest.raises(ConfigurationError, match=r'^orbit.altitude_m: '):
        CircularOrbit(0.0)
