# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Arrays of reaction wheels: checks, and the zonotopes of what they give."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from wheel_cases import PYRAMID, wheels

from manifold_mpc_ros.config.checks import CORNERS
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.parameter import resolve_parameters
from manifold_mpc_ros.config.tables import CONTROLLER_PARAMETERS
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.errors import ConfigurationError


@pytest.mark.parametrize('n', [3, 4, 6])
def test_the_facets_are_those_of_the_convex_hull(n: int) -> None:
    """Against the hull of all sums of +-limits, an independent construction."""
    rng = np.random.default_rng(n)
    array = WheelArray(rng.normal(size=(n, 3)), rng.uniform(0.5, 2.0, n), rng.uniform(1, 3, n))
    for zonotope, limits in ((array.torques, array.max_torque_n_m),
                             (array.momenta, array.max_momentum_n_m_s)):
        signs = 2.0 * ((np.arange(2 ** n)[:, None] >> np.arange(n)) & 1) - 1.0
        hull = ConvexHull((signs * limits) @ array.axes_B)
        faces = np.unique(np.round(hull.equations, 9), axis=0)
        assert len(faces) == 2 * len(zonotope.normals) == n * (n - 1)
        for normal, bound in zip(zonotope.normals, zonotope.bounds):
            match = np.abs(faces[:, :3] @ normal) > 1 - 1e-9
            assert match.sum() == 2
            np.testing.assert_allclose(-faces[match, 3], bound, rtol=1e-8)
        corners = hull.points[hull.vertices]
        np.testing.assert_allclose([zonotope.gauge(each) for each in corners], 1.0, rtol=1e-9)


def test_coplanar_wheels_share_a_facet_and_parallel_ones_give_none() -> None:
    array = WheelArray([1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 0, 1, 0, 0, -1], 1.0, 1.0)
    assert len(array.normals) == 4
    assert array.torques.gauge(np.array([0.0, 0.0, 2.0])) == pytest.approx(1.0)


def test_the_box_is_inside_and_touches() -> None:
    torques = wheels().torques
    gauges = [torques.gauge(torques.box * corner) for corner in CORNERS]
    assert max(gauges) == pytest.approx(1.0)
    assert torques.gauge(torques.box * np.array([1.0, 0.0, 0.0])) < 0.8  # more than the box


def test_wheels_that_fail_leave_the_set_of_the_others() -> None:
    array = wheels()
    failed = np.array([False, True, False, False])
    three = array.without(failed)
    assert len(three.normals) == 3
    assert not three.matrix[:, 1].any()
    np.testing.assert_allclose(three.torques.bounds, WheelArray(
        PYRAMID[~failed], array.max_torque_n_m[0], 1.0).torques.bounds)
    with pytest.raises(ConfigurationError, match=r'wheels\.axes_B: .*three dimensions'):
        three.without(np.array([True, False, False, False]))


@pytest.mark.parametrize(('changes', 'key'), [
    ({'axes_B': [[1, 0, 0], [0, 1, 0]]}, 'axes_B'),
    ({'axes_B': [[1, 0, 0], [0, 1, 0], [0, 0, 0]]}, 'axes_B'),
    ({'axes_B': [[1, 0, 0], [0, 1, 0], [1, 1, 0]]}, 'axes_B'),
    ({'max_torque_n_m': 0.0}, 'max_torque_n_m'),
    ({'max_torque_n_m': [1.0, 1.0]}, 'max_torque_n_m'),
    ({'max_momentum_n_m_s': float('inf')}, 'max_momentum_n_m_s'),
    ({'inertia_kg_m2': -1.0}, 'inertia_kg_m2'),
    ({'available': [True]}, 'available'),
    ({'null_space': 'none'}, 'null_space'),
])
def test_what_is_no_array_is_named(changes: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigurationError, match=rf'^wheels\.{key}: '):
        wheels(**changes)


def test_wheels_from_a_parameter_file_and_errors_by_their_parameter() -> None:
    def controller(**changes: Any) -> AttitudeMpcConfig:
        given = {f'actuators.wheels.{name}': value for name, value in changes.items()}
        return AttitudeMpcConfig.from_parameters(resolve_parameters(
            CONTROLLER_PARAMETERS, {'actuators.kind': 'wheels', **given}, complete=False))

    array = controller(failed=['wheel_2'], max_torque_n_m=[1, 2, 3, 4]).wheels
    assert array is not None
    np.testing.assert_allclose(np.linalg.norm(array.axes_B, axis=1), 1.0)
    assert array.available.tolist() == [True, False, True, True]
    assert array.max_torque_n_m.tolist() == [1, 2, 3, 4]
    box = controller().wheels
    assert box is not None
    assert (box.torques.box >= 0.3).all()  # the shipped wheels give the shipped torque box
    for name, value in (('failed', ['other']), ('axes_B', [1.0, 2.0]), ('names', ['a', 'a']),
                        ('failed', ['wheel_1', 'wheel_3'])):
        with pytest.raises(ConfigurationError, match=r'^actuators\.wheels\.') as error:
            controller(**{name: value})
        assert error.value.key.startswith('actuators.wheels.')
