# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the spacecraft, the Sun and a place on the ground are, in inertial axes.

These are those of SGP4: z along the Earth's axis of date, x to the mean equinox of date. Times
are seconds since 1970 (UTC, taken for UT1: below 1 s, so 0.004 degrees of the Earth's turn), given
as whole nanoseconds so that no digit is lost.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from manifold_mpc_ros.config.guidance import GuidanceConfig
from manifold_mpc_ros.config.orbit import EARTH_GM_M3_S2, EARTH_RADIUS_M
from manifold_mpc_ros.errors import ConfigurationError, ManifoldMpcError
from manifold_mpc_ros.lie.arrays import Array

Times = NDArray[np.int64]
#: Maps times (n,) [ns since 1970] to places (n, 3) [m].
Orbit = Callable[[Times], Array]

_DAY_NS = 86_400 * 10**9
#: 2000-01-01 12:00 UTC [ns since 1970], and its Julian date.
_J2000_NS, _J2000_JD = 946_728_000 * 10**9, 2451545.0
_FLATTENING = 1.0 / 298.257223563
_KEPLER_STEPS = 12


def orbit_of(config: GuidanceConfig) -> Orbit:
    """Return the orbit of a TLE where there is one, else of Kepler's elements.

    Raises ConfigurationError for a TLE without sgp4, and for one that sgp4 does not take.
    """
    if config.tle == ['none']:
        return lambda times_ns: _kepler(config, times_ns)
    try:
        from sgp4.api import Satrec
    except ImportError:
        raise ConfigurationError(
            'orbit.tle', config.tle, 'none, or the package sgp4 installed: pip install '
            "'manifold_mpc_ros[guidance]'") from None
    try:
        satellite = Satrec.twoline2rv(*config.tle)
    except ValueError as error:
        raise ConfigurationError('orbit.tle', config.tle, f'a TLE ({error})') from None

    def places(times_ns: Times) -> Array:
        days, rest = np.divmod(times_ns - _J2000_NS, _DAY_NS)
        error, position_km, _ = satellite.sgp4_array(_J2000_JD + days, rest / _DAY_NS)
        if error.any():
            raise ManifoldMpcError(f'sgp4 gives no place (its error {int(error.max())}): is '
                                   'orbit.tle of about now?')
        return np.asarray(1e3 * position_km)

    return places


def _kepler(config: GuidanceConfig, times_ns: Times) -> Array:
    """Return the places (n, 3) [m] of an ellipse: ``M = E - e sin E``, by Newton's method."""
    a, e = config.semi_major_axis_m, config.eccentricity
    since_s = (times_ns - round(config.epoch_s * 1e9)) / 1e9
    M = math.radians(config.mean_anomaly_deg) + math.sqrt(EARTH_GM_M3_S2 / a ** 3) * since_s
    M = np.remainder(M, 2.0 * np.pi)
    E = M + e * np.sin(M) if e < 0.8 else np.full_like(M, np.pi)
    for _ in range(_KEPLER_STEPS):
        E = E - (E - e * np.sin(E) - M) / (1.0 - e * np.cos(E))
    node, tilt, w = (math.radians(each) for each in (
        config.ascending_node_deg, config.inclination_deg, config.perigee_deg))
    p = np.array([math.cos(node), math.sin(node), 0.0])
    q = np.array([-math.cos(tilt) * math.sin(node), math.cos(tilt) * math.cos(node),
                  math.sin(tilt)])
    perigee, across = math.cos(w) * p + math.sin(w) * q, math.cos(w) * q - math.sin(w) * p
    return np.asarray(a * ((np.cos(E) - e)[:, None] * perigee
                           + (math.sqrt(1.0 - e * e) * np.sin(E))[:, None] * across))


def sun_direction_N(times_ns: Times) -> Array:
    """Return unit vectors (n, 3) to the Sun, within 0.01 degrees from 1950 to 2050.

    The low-precision formula of the Astronomical Almanac.
    """
    days = (times_ns - _J2000_NS) / _DAY_NS
    g = np.deg2rad(357.528 + 0.9856003 * days)
    longitude = np.deg2rad(280.460 + 0.9856474 * days + 1.915 * np.sin(g) + 0.020 * np.sin(2 * g))
    tilt = np.deg2rad(23.439 - 4e-7 * days)
    return np.stack([np.cos(longitude), np.cos(tilt) * np.sin(longitude),
                     np.sin(tilt) * np.sin(longitude)], axis=1)


def ground_N_m(config: GuidanceConfig, times_ns: Times) -> Array:
    """Return the places (n, 3) [m] of the target, which turns with the Earth."""
    latitude = math.radians(config.latitude_deg)
    squared = _FLATTENING * (2.0 - _FLATTENING)
    across = EARTH_RADIUS_M / math.sqrt(1.0 - squared * math.sin(latitude) ** 2)
    equator = (across + config.altitude_m) * math.cos(latitude)
    height = (across * (1.0 - squared) + config.altitude_m) * math.sin(latitude)
    days, rest = np.divmod(times_ns - _J2000_NS, _DAY_NS)  # whole turns leave no rounding
    turn = 280.46061837 + 0.98564736629 * (days + rest / _DAY_NS) + 360.0 * rest / _DAY_NS
    angle = np.deg2rad(turn + config.longitude_deg)
    return np.stack([equator * np.cos(angle), equator * np.sin(angle),
                     np.full(len(angle), height)], axis=1)
