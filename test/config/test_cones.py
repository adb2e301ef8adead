# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cones: what is refused, and by how much they are tightened."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from cases import CERTIFIED, configuration
from strategies import generator, unit_vectors

from manifold_mpc_ros.config.cones import (
    Between,
    Cone,
    best_margin_rad,
    between_samples,
    directions,
)
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3

SUN: dict[str, Any] = {'name': 'sun', 'axis_B': (2.0, 0.0, 0.0), 'direction_N': (0.0, 1.0, 1.0),
                       'half_angle_rad': 0.5}


@pytest.mark.parametrize(('changes', 'key'), [
    ({'axis_B': (0.0, 0.0, 0.0)}, 'cones.sun.axis_B'),
    ({'axis_B': (1.0, 0.0)}, 'cones.sun.axis_B'),
    ({'direction_N': (0.0, np.nan, 1.0)}, 'cones.sun.direction_N'),
    ({'half_angle_rad': 0.0}, 'cones.sun.half_angle_rad'),
    ({'half_angle_rad': np.pi}, 'cones.sun.half_angle_rad'),
    ({'half_angle_rad': 'wide'}, 'cones.sun.half_angle_rad'),
    ({'kind': 'keep_near'}, 'cones.sun.kind'),
    ({'name': 'the sun'}, 'cones.names'),
])
def test_what_is_no_cone_is_named(changes: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigurationError, match=f'^{re.escape(key)}: '):
        Cone(**{**SUN, **changes})


@pytest.mark.parametrize(('changes', 'expected'), [
    ({'cones': [Cone(**SUN), Cone(**SUN)]}, 'names of their own'),
    ({'cones': ['sun']}, 'names of their own'),
    ({'max_torque_n_m': None}, 'limits on torque and rate'),
    ({'max_rate_rad_s': (0.6, np.inf, 0.6)}, 'limits on torque and rate'),
    ({'cones': [Cone(**{**SUN, 'half_angle_rad': 3.1})]}, 'leaves some direction allowed'),
    ({'cones': [Cone(**{**SUN, 'half_angle_rad': 2.0}),
                Cone(**{**SUN, 'name': 'sensor', 'half_angle_rad': 1.0, 'kind': 'keep_in'})]},
     'some attitude keeps together .the best one misses by'),
])
def test_cones_that_cannot_be_kept_are_refused(changes: dict[str, Any], expected: str) -> None:
    with pytest.raises(ConfigurationError, match=expected):
        configuration(**{**CERTIFIED, 'cones': [Cone(**SUN)], **changes})


def test_the_best_margin_of_two_cones_is_what_geometry_says() -> None:
    """Axis in a cone of 0.4 about s, out of one of 0.9 about the same s: missed by 0.25 each."""
    given = [Cone('a', (1, 0, 0), (0, 0, 1), 0.4, 'keep_in'), Cone('b', (1, 0, 0), (0, 0, 1), 0.9)]
    assert best_margin_rad(given) == pytest.approx(-0.25, abs=1e-4)
    assert best_margin_rad(given[:1]) == pytest.approx(0.4, abs=1e-4)


def test_rates_and_accelerations_stay_below_their_bounds_until_the_next_sample() -> None:
    J, rng = np.diag([1.0, 0.9, 0.6]), generator('motion bounds')
    torque, rate, step, fine = 0.3, 0.6, 0.5, 100
    bend, swing = between_samples(J, torque / 0.6, rate, step)
    omega = rate * unit_vectors(rng, 500)
    tau = torque * unit_vectors(rng, 500)
    for _ in range(fine):
        change = (tau - np.cross(omega, omega @ J)) @ np.linalg.inv(J)
        assert np.linalg.norm(change, axis=1).max() <= 8 * swing / step ** 2
        omega = omega + step / 2 / fine * change
        assert np.linalg.norm(omega, axis=1).max() <= (8 * bend) ** 0.5 / step
    with pytest.raises(ConfigurationError, match='step_s'):
        between_samples(J, torque / 0.6, 50.0, step)


@pytest.mark.parametrize(('angle', 'kind'), [
    (0.3, 'keep_out'), (1.0, 'keep_out'), (2.0, 'keep_out'), (2.8, 'keep_in'), (1.2, 'keep_in')])
def test_a_cone_kept_at_samples_is_kept_between_them(angle: float, kind: str) -> None:
    """Turns at the largest rate that touch the tightened cone at both samples, the worst ones."""
    cone = Cone('sun', (1, 0, 0), (0, 0, 1), angle, kind)
    kept = cone.tightened(Between(0.4 ** 2 / 8, 0.0))
    assert kept.margins_rad(np.eye(3)) < cone.margins_rad(np.eye(3))
    start = np.array([0.0, kept.half_angle_rad - np.pi / 2, 0.0])
    axes = unit_vectors(generator('between', angle, kind), 3000)
    turns = so3.exp(np.linspace(0.0, 0.4, 41)[:, None, None] * axes) @ so3.exp(start)
    held = (kept.margins_rad(turns[[0, -1]]) >= -1e-9).all(axis=0)
    between = cone.margins_rad(turns[:, held])
    assert held.sum() > 100
    assert between.min() >= -1e-9
    if kind == 'keep_out' and angle < 0.5:  # and it is needed
        assert kept.margins_rad(turns[:, held]).min() < -1e-3


def test_directions_are_by_name_and_for_every_node() -> None:
    cones = [Cone(**SUN), Cone(**{**SUN, 'name': 'earth'})]
    moving = np.array([[1.0, 0.1 * k, 0.0] for k in range(4)])
    found = directions(cones, {'earth': moving, 'sun': [0, 0, 2]}, 3)
    np.testing.assert_allclose(found[:, 0], np.tile([0, 0, 1], (4, 1)))
    np.testing.assert_allclose(found[:, 1], moving / np.linalg.norm(moving, axis=1)[:, None])
    for wrong in ({'moon': (1, 0, 0)}, {'sun': (0, 0, 0)}, {'sun': moving[:3]},
                  {'sun': (np.inf, 0, 0)}):
        with pytest.raises(ConfigurationError, match='directions_N'):
            directions(cones, wrong, 3)
