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
    alone,
    best_margin_rad,
    between_samples,
    directions,
    tightened,
)
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.parameter import resolve_parameters
from manifold_mpc_ros.config.tables import CONTROLLER_PARAMETERS
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
    ({'group': 'sensors'}, 'cones.sun.group'),
])
def test_what_is_no_cone_is_named(changes: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigurationError, match=f'^{re.escape(key)}: '):
        Cone(**{**SUN, **changes})


@pytest.mark.parametrize(('changes', 'expected'), [
    ({'cones': [Cone(**SUN), Cone(**SUN)]}, 'names of their own'),
    ({'cones': ['sun']}, 'names of their own'),
    ({'cones': [Cone(**{**SUN, 'kind': 'keep_in', 'group': 'alone'})]}, 'a group of 2 to 4'),
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


def cone_parameters(**changes: Any) -> dict[str, Any]:
    """Return parameters of a controller with slow limits and one cone, changed."""
    given = {'limits.max_rate_rad_s': [0.2], 'cones.names': ['sun'], 'cones.sun.axis_B': [1, 0, 0],
             'cones.sun.half_angle_deg': 25.0, 'cones.sun.direction_N': [0, 2, 0]}
    return {**given, **changes}


def test_cones_in_parameters() -> None:
    values = resolve_parameters(CONTROLLER_PARAMETERS, cone_parameters(), complete=False)
    (cone,) = AttitudeMpcConfig.from_parameters(values).cones
    assert (cone.name, cone.kind) == ('sun', 'keep_out')
    assert cone.half_angle_rad == pytest.approx(np.radians(25.0))
    np.testing.assert_array_equal(cone.direction_N, [0.0, 1.0, 0.0])
    assert AttitudeMpcConfig.from_parameters(
        resolve_parameters(CONTROLLER_PARAMETERS, {}, complete=False)).cones == ()


@pytest.mark.parametrize(('changes', 'key'), [
    ({'cones.sun.half_angle_deg': 180.0}, 'cones.sun.half_angle_deg'),
    ({'cones.sun.axis_B': [0, 0, 0]}, 'cones.sun.axis_B'),
    ({'cones.sun.kind': 'out'}, 'cones.sun.kind'),
    ({'cones.sun.colour': 'red'}, 'cones.sun.colour'),
    ({'cones.moon.axis_B': [1, 0, 0]}, 'cones.moon.axis_B'),
    ({'cones.names': ['sun', 'sun']}, 'cones.names'),
    ({'cones.names': ['sun', '']}, 'cones.names'),
    ({'cones.names': []}, 'cones.names'),
])
def test_mistakes_in_parameters_name_the_full_key(changes: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        AttitudeMpcConfig.from_parameters(resolve_parameters(
            CONTROLLER_PARAMETERS, cone_parameters(**changes), complete=False))
    assert caught.value.key == key


def test_a_parameter_file_gives_all_of_a_cone() -> None:
    given = cone_parameters()
    del given['cones.sun.axis_B']
    full = {spec.name: spec.default for spec in CONTROLLER_PARAMETERS} | given
    with pytest.raises(ConfigurationError, match=r'^cones\.sun\.axis_B: '):
        resolve_parameters(CONTROLLER_PARAMETERS, full, complete=True)


def test_a_first_setpoint_in_a_cone_is_refused_with_the_angle_that_is_missing() -> None:
    ahead = {'cones.sun.direction_N': [1.0, 0.2, 0.0]}
    given = resolve_parameters(CONTROLLER_PARAMETERS, cone_parameters(**ahead), complete=False)
    with pytest.raises(ConfigurationError, match=r'^initial_setpoint: .*degrees are missing'):
        ControllerConfig.from_parameters(given)
    assert ControllerConfig.from_parameters({**given, 'initial_setpoint': 'hold'}).mpc.cones


def test_the_mean_of_a_group_is_no_more_than_its_best_member() -> None:
    """So a plan that keeps the mean keeps a cone; and one that is kept alone makes the mean 1."""
    rng = generator('group')
    shares = rng.uniform(0.0, 2.0, size=(1000, 3))
    mean = np.mean(shares ** 32, axis=1) ** (1 / 32)
    assert (mean <= shares.max(axis=1)).all()
    assert (mean >= 0.96 * shares.max(axis=1)).all()
    given = [Cone(name, (1, 0, 0), (0, 0, 1), angle, 'keep_in', 'any')
             for name, angle in (('a', 1.0), ('b', 1.5), ('c', 0.1))]
    for each, other in zip(given, alone(given)):
        share = (1.0 + np.cos(other.half_angle_rad)) / (1.0 + np.cos(each.half_angle_rad))
        assert share == pytest.approx(3 ** (1 / 32)) or other.half_angle_rad < 1e-8


@pytest.mark.parametrize('arc', [0.0, 0.01])
def test_a_group_kept_at_samples_is_kept_between_them_whoever_takes_over(arc: float) -> None:
    """Of two members each keeps its cone at one end of a step alone, just so.

    Motions within the bounds of rate (at the ends) and acceleration, every second one along them
    and turning the members out; the direction moves on an arc, at once, steadily or at the end.
    """
    rng, n, step, rate, faster, fine = generator('group', arc), 3000, 0.5, 0.4, 0.3, 100
    between = Between(step ** 2 / 8 * (rate + step / 2 * faster) ** 2, step ** 2 / 8 * faster)
    members = [Cone(name, (1, 0, 0), (0, 0, 1), angle, 'keep_in', 'any')
               for name, angle in (('a', 0.5), ('b', 1.3))]
    kept = tightened(members, between, [2.0 * np.sin(arc / 2.0)] * 2)

    worst = np.arange(n) % 2 == 0
    first, second, omega = (each * rng.uniform(size=(n, 1)) for each in (
        faster * unit_vectors(rng, n), faster * unit_vectors(rng, n), rate * unit_vectors(rng, n)))
    along = unit_vectors(rng, n)[worst]
    first[worst], second[worst], omega[worst] = faster * along, -faster * along, rate * along
    may = np.linalg.norm(omega + step / 2 * (first + second), axis=1) <= rate + 1e-12
    R, path = so3.random_rotations(rng, n), []
    axis_N = np.einsum('nij,nj->ni', R, omega / np.linalg.norm(omega, axis=1)[:, None])
    for k in range(fine + 1):
        path.append(R)
        change = first if k < fine // 2 else second
        R = R @ so3.exp(step / fine * (omega + step / fine / 2 * change))
        omega = omega + step / fine * change

    start = np.cross(axis_N, unit_vectors(rng, n))
    start /= np.linalg.norm(start, axis=1)[:, None]
    across = np.where(worst[:, None], axis_N, np.cross(start, unit_vectors(rng, n)))
    across /= np.linalg.norm(across, axis=1)[:, None]  # at right angles to the direction
    place = np.linspace(0.0, 1.0, fine + 1)[:, None] ** rng.choice([0.05, 1.0, 20.0], n)
    seen = np.einsum('knij,nj->kni', so3.exp(-arc * place[:, :, None] * across), start)
    best = np.full((fine + 1, n), -np.inf)
    for cone, each, end, out in zip(members, kept, (0, -1), (1.0, -1.0)):
        edge = so3.exp(out * each.half_angle_rad * across) @ seen[end][:, :, None]
        axes = np.array(path) @ (np.swapaxes(path[end], 1, 2) @ edge)
        cosines = np.einsum('kni,kni->kn', axes[..., 0], seen)
        best = np.maximum(best, cone.half_angle_rad - np.arccos(np.clip(cosines, -1.0, 1.0)))
    assert may.sum() > 0.9 * n
    assert best[:, may].min() >= -1e-6
    assert best[:, worst].min() <= arc + 1e-3  # and it is needed
    with pytest.raises(ConfigurationError, match=r'cones\.a: .*moves by up to .* degrees'):
        tightened(members, Between(0.2, 0.02), [0.0, 0.0])
