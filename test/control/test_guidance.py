# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Guidance: orbits, the Sun, places on the ground, and attitudes with their rates."""

from __future__ import annotations

import datetime as dt
import math
import sys
from typing import Any

import numpy as np
import pytest

from manifold_mpc_ros.config.guidance import GUIDANCE_PARAMETERS, MODES, GuidanceConfig
from manifold_mpc_ros.config.orbit import EARTH_GM_M3_S2
from manifold_mpc_ros.config.parameter import resolve_parameters
from manifold_mpc_ros.control.guidance.laws import Guidance
from manifold_mpc_ros.control.guidance.orbit import ground_N_m, orbit_of, sun_direction_N
from manifold_mpc_ros.errors import ConfigurationError, ManifoldMpcError
from manifold_mpc_ros.lie import so3

#: Of the International Space Station, from the test cases of Vallado and others.
TLE = ['1 25544U 98067A   08264.51782528 -.00002182  00000-0 -11606-4 0  2927',
       '2 25544  51.6416 247.4627 0006703 130.5360 325.0288 15.72125391563537']
NOW_NS = 1_800_000_000 * 10**9
TIMES_NS = NOW_NS + np.arange(0, 6000, 7) * 10**9


def utc_ns(*parts: int) -> np.ndarray:
    stamp = dt.datetime(*parts, tzinfo=dt.timezone.utc).timestamp()  # type: ignore[arg-type,misc]
    return np.array([round(stamp) * 10**9])


def config(**changes: Any) -> GuidanceConfig:
    return GuidanceConfig.from_parameters(resolve_parameters(
        GUIDANCE_PARAMETERS, {'orbit.epoch_s': NOW_NS / 1e9, **changes}, complete=False))


def test_the_sun_is_where_vallado_has_it() -> None:
    """Example 5-1 of Fundamentals of Astrodynamics and Applications: 2006-04-02."""
    place = np.array([0.9771945, 0.1924424, 0.0834308])
    sun = sun_direction_N(utc_ns(2006, 4, 2))[0]
    assert math.degrees(math.acos(min(1.0, sun @ place / np.linalg.norm(place)))) < 0.01


def test_the_ground_turns_as_vallado_has_it() -> None:
    """Example 3-5: Greenwich is at 152.578788 degrees on 1992-08-20 at 12:14; its ellipsoid."""
    x, y, z = ground_N_m(config(), utc_ns(1992, 8, 20, 12, 14))[0]
    assert math.degrees(math.atan2(y, x)) == pytest.approx(152.578788, abs=1e-4)
    assert (math.hypot(x, y), z) == (pytest.approx(6378137.0), 0.0)
    pole = ground_N_m(config(**{'target.latitude_deg': 90.0, 'target.altitude_m': 100.0}),
                      TIMES_NS)
    np.testing.assert_allclose(pole[:, 2], 6356752.314245 + 100.0, atol=1e-3)


def test_keplers_ellipse_obeys_gravity_and_keeps_energy_and_plane() -> None:
    one = config(**{'orbit.eccentricity': 0.3, 'orbit.semi_major_axis_m': 1e7,
                    'orbit.perigee_deg': 40.0, 'orbit.ascending_node_deg': 20.0})
    orbit, h = orbit_of(one), 10**9
    before, now, after = (orbit(TIMES_NS + k * h) for k in (-1, 0, 1))
    distance = np.linalg.norm(now, axis=1, keepdims=True)
    np.testing.assert_allclose(
        after - 2.0 * now + before, -EARTH_GM_M3_S2 * now / distance ** 3, atol=1e-4)
    momentum = np.cross(now, after - before)
    np.testing.assert_allclose(momentum / np.linalg.norm(momentum, axis=1)[:, None],
                               np.tile(momentum[0] / np.linalg.norm(momentum[0]), (858, 1)),
                               atol=1e-9)
    assert momentum[0, 2] / np.linalg.norm(momentum[0]) == pytest.approx(
        math.cos(math.radians(97.4)))


def test_a_tle_is_sgp4s_and_about_its_ellipse() -> None:
    api = pytest.importorskip('sgp4.api')
    at_ns = utc_ns(2008, 9, 20, 12, 25, 40)
    place = orbit_of(config(**{'orbit.tle': TLE}))(at_ns)[0]
    error, expected_km, _ = api.Satrec.twoline2rv(*TLE).sgp4(
        *api.jday(2008, 9, 20, 12, 25, 40.0))
    assert error == 0
    np.testing.assert_allclose(place, 1e3 * np.array(expected_km), atol=1.0)
    with pytest.raises(ManifoldMpcError, match='sgp4 gives no place'):
        orbit_of(config(**{'orbit.tle': TLE}))(utc_ns(2090, 1, 1))


def test_a_missing_sgp4_is_named_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'sgp4.api', None)
    with pytest.raises(ConfigurationError, match=r'package sgp4.*manifold_mpc_ros\[guidance\]'):
        Guidance(config(**{'mode': 'nadir', 'orbit.tle': TLE}))


@pytest.mark.parametrize('mode', MODES)
def test_the_axis_points_and_rates_are_those_of_the_attitudes(mode: str) -> None:
    one = config(mode=mode, axis_B=[0.0, 0.6, 0.8], **{
        'target.latitude_deg': 50.0, 'attitude_xyzw': [0.5, 0.5, 0.5, 0.5]})
    guidance = Guidance(one)
    R_ND, omega, alpha = guidance.points(TIMES_NS)
    assert all(so3.is_rotation(each) for each in R_ND)
    small = 2 * 10**8
    ahead = guidance.points(TIMES_NS + small)
    step = R_ND @ so3.exp(0.2 * omega + 0.02 * alpha)
    assert so3.angle(np.swapaxes(step, 1, 2) @ ahead[0]).max() < 1e-6
    np.testing.assert_allclose(ahead[1], omega + 0.2 * alpha, atol=1e-6)
    place = orbit_of(one)(TIMES_NS)
    aims = {'nadir': -place, 'sun': sun_direction_N(TIMES_NS),
            'velocity': orbit_of(one)(TIMES_NS + 10**6) - orbit_of(one)(TIMES_NS - 10**6),
            'target': ground_N_m(one, TIMES_NS) - place}
    if mode in aims:
        aim = aims[mode] / np.linalg.norm(aims[mode], axis=1)[:, None]
        np.testing.assert_allclose(R_ND @ one.axis_B, aim, atol=1e-6)
    if mode == 'nadir':
        np.testing.assert_allclose(np.linalg.norm(omega, axis=1), math.sqrt(
            EARTH_GM_M3_S2 / 6.878e6 ** 3), rtol=1e-9)
    if mode == 'spin':
        np.testing.assert_allclose(omega, np.tile(0.01 * one.axis_B, (858, 1)), atol=1e-9)


@pytest.mark.parametrize(('changes', 'key'), [
    ({'second_axis_B': [0.0, 0.0, -2.0]}, 'second_axis_B'), ({'orbit.tle': ['x']}, 'orbit.tle'),
    ({'attitude_xyzw': [0.0, 0.0, 0.0, 0.0]}, 'attitude_xyzw'), ({'mode': 'moon'}, 'mode'),
    ({'orbit.eccentricity': 0.2}, 'orbit.eccentricity'),
])
def test_what_makes_no_sense_is_named(changes: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigurationError, match=key):
        config(**changes)
