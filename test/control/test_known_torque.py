# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Torques that are known: plans count on them, and only the rest is estimated."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import CERTIFIED, configuration

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.orbit import KnownTorque
from manifold_mpc_ros.config.parameter import resolve_parameters
from manifold_mpc_ros.config.tables import CONTROLLER_PARAMETERS
from manifold_mpc_ros.control.response.known_torque import known_torque_B
from manifold_mpc_ros.control.response.observer import ResponseObserver, ResponseSettings
from manifold_mpc_ros.control.target import FixedTarget
from manifold_mpc_ros.dynamics.environment import gravity_gradient_B
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.tracking.body import ContinuousBody
from manifold_mpc_ros.lab.tracking.flight import fly
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

CONFIG = configuration(**{**CERTIFIED, 'step_s': 0.5, 'horizon': 20})
TORQUE = np.array([0.01, -0.01, 0.01])
REST = np.array([0.002, 0.001, -0.003])


def known(**given: Any) -> KnownTorque:
    values = resolve_parameters(CONTROLLER_PARAMETERS, {
        name.replace('__', '.'): value for name, value in given.items()}, complete=False)
    found = ControllerConfig.from_parameters(values).known_torque
    assert found is not None
    return found


def test_nothing_is_known_as_shipped() -> None:
    shipped = resolve_parameters(CONTROLLER_PARAMETERS, {}, complete=False)
    assert ControllerConfig.from_parameters(shipped).known_torque is None


def test_a_constant_that_is_known_leaves_no_offset_and_nothing_to_estimate() -> None:
    mpc = AttitudeMpc(CONFIG, disturbed=True)
    told = known(disturbance__known__constant_n_m=TORQUE.tolist())
    for acting, at_most_deg in ((TORQUE, 1e-6), (TORQUE + REST, 1e-3)):
        watch = ResponseObserver(CONFIG, ResponseSettings(
            1e-5, 1e-5, 1e-3, np.full(3, np.inf), True), 0.0)
        body = ContinuousBody(CONFIG.inertia_kg_m2, step_s=0.025, max_torque_n_m=np.full(3, 0.3),
                              disturbance=lambda _time, _R: acting)  # noqa: B023
        flight = fly(mpc, body, FixedTarget(np.eye(3)), 20.0, observer=watch, known=told)
        assert np.degrees(flight.error_rad[-1]) < at_most_deg
        np.testing.assert_allclose(watch.disturbance_B_n_m, acting - TORQUE, atol=1e-6)
        np.testing.assert_allclose(flight.torque_n_m[-1], -acting, atol=1e-6)
    # Without an estimate a known torque is planned with as well.
    body = ContinuousBody(CONFIG.inertia_kg_m2, step_s=0.025, max_torque_n_m=np.full(3, 0.3),
                          disturbance=lambda _time, _R: TORQUE)
    flight = fly(mpc, body, FixedTarget(np.eye(3)), 20.0, known=told)
    assert np.degrees(flight.error_rad[-1]) < 1e-6


def test_the_table_is_linear_in_the_angle_and_periodic_and_gravity_gradient_is_added() -> None:
    rows = np.arange(12.0).reshape(4, 3) * 1e-3
    given = {'disturbance__known__table_n_m': rows.ravel().tolist(), 'orbit__altitude_m': 5e5,
             'orbit__phase_deg': 90.0, 'orbit__epoch_s': 100.0}
    told = known(**given)
    assert told.orbit is not None
    quarter_s = 0.5 * np.pi / told.orbit.rate_rad_s
    for quarters, expected in ((0.0, rows[1]), (0.5, (rows[1] + rows[2]) / 2), (2.0, rows[3]),
                               (2.5, (rows[3] + rows[0]) / 2), (4.0, rows[1])):
        at_ns = round((100.0 + quarters * quarter_s) * 1e9)
        np.testing.assert_allclose(known_torque_B(told, at_ns, np.eye(3)), expected, atol=1e-9)
    both = known(**given, disturbance__known__gravity_gradient=True)
    np.testing.assert_allclose(
        known_torque_B(both, 100 * 10**9, np.eye(3)), rows[1] + gravity_gradient_B(
            np.eye(3), told.orbit.position_N_m(0.0), told.inertia_kg_m2), atol=1e-12)


@pytest.mark.parametrize(('given', 'key'), [
    ({'disturbance__known__table_n_m': [0.0, 0.1]}, 'disturbance.known.table_n_m'),
    ({'disturbance__known__gravity_gradient': True}, 'orbit.altitude_m'),
    ({'disturbance__known__table_n_m': [0.1] * 6}, 'orbit.altitude_m'),
])
def test_what_does_not_fit_is_refused(given: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        known(**given)
    assert refused.value.key == key
