# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether a design exists, and its gains, do not depend on the units of inertia and torque."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import LIMITS, configuration
from strategies import INERTIAS

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.terminal.design import TerminalDesign
from manifold_mpc_ros.terminal.linearisation import linearise
from manifold_mpc_ros.terminal.problem_of import problem_of, terminal_design
from manifold_mpc_ros.terminal.riccati import RiccatiSolution, solve_riccati


def riccati(config: AttitudeMpcConfig) -> RiccatiSolution:
    return solve_riccati(linearise(problem_of(config)))


def scaled(config: AttitudeMpcConfig, mass: float, cost: float, **changes: Any
           ) -> AttitudeMpcConfig:
    """Return the same body in other units: inertia and torque times mass, the cost times cost."""
    limit = config.max_torque_n_m
    return configuration(
        inertia_kg_m2=mass * config.inertia_kg_m2, forcing=config.forcing,
        attitude_weight=cost * config.attitude_weight, rate_weight=cost * config.rate_weight,
        torque_weight=cost / mass ** 2 * config.torque_weight,
        max_torque_n_m=None if limit is None else mass * limit,
        max_rate_rad_s=config.max_rate_rad_s, target=config.target,
        pointing_weight=cost * config.pointing_weight, **changes)


@pytest.mark.parametrize('forcing', ['paper', 'symmetric'])
@pytest.mark.parametrize('body', sorted(INERTIAS))
@pytest.mark.parametrize(('mass', 'cost'), [
    (1e-6, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6), (1e6, 1e-6), (1e-6, 1e6), (3.7e-4, 2.9e3)])
def test_gains_scale(forcing: str, body: str, mass: float, cost: float) -> None:
    config = configuration(inertia_kg_m2=INERTIAS[body], forcing=forcing)
    one, other = riccati(config), riccati(scaled(config, mass, cost))
    np.testing.assert_allclose(other.K / mass, one.K, rtol=0, atol=1e-9 * np.abs(one.K).max())
    np.testing.assert_allclose(other.P / cost, one.P, rtol=0, atol=1e-9 * np.abs(one.P).max())


@pytest.mark.parametrize('target', ['attitude', 'pointing'])
def test_the_whole_design_scales(target: str) -> None:
    config = configuration(**LIMITS, forcing='symmetric', target=target)
    one: TerminalDesign = terminal_design(config)
    other = terminal_design(scaled(config, 1e5, 1e-3))
    assert other.c / 1e-3 == pytest.approx(one.c, rel=1e-6)
    assert other.report.limiting == one.report.limiting


def test_a_station_with_small_weights_of_its_torque_has_the_gains_of_the_scalar_equation() -> None:
    """J = 4.2e6 kg m^2, h = 10 s, cost theta^2 + omega^2 / 2 + 2 tau^2 about each axis."""
    config = configuration(
        inertia_kg_m2=4.2e6 * np.ones(3), step_s=10.0, forcing='symmetric',
        attitude_weight=np.eye(3) / 2, rate_weight=np.eye(3) / 4, torque_weight=np.eye(3))
    config_of_the_cost = configuration(
        inertia_kg_m2=4.2e6 * np.ones(3), step_s=10.0, forcing='symmetric',
        attitude_weight=np.eye(3), rate_weight=np.eye(3) / 2, torque_weight=2 * np.eye(3))
    for each in (config, config_of_the_cost):
        found = riccati(each)
        np.testing.assert_allclose(-np.diag(found.K[:, :3]), 0.70506, rtol=1e-4)
        np.testing.assert_allclose(-np.diag(found.K[:, 3:]), 2433.6, rtol=1e-4)
        assert found.closed_loop_radius == pytest.approx(0.997103, abs=1e-6)


@pytest.mark.parametrize(('inertia', 'step_s'), [
    ((4.2e6, 4.0e6, 3.9e6), 10.0), ((31046, 77217, 78754), 10.0), ((0.04, 0.04, 0.007), 0.5),
    ((1.2e8, 1.1e8, 6e7), 60.0), ((2e-3, 2e-3, 1.1e-3), 0.01)])
def test_bodies_of_all_sizes_have_a_design_with_the_shipped_weights(
        inertia: tuple[float, float, float], step_s: float) -> None:
    found = riccati(configuration(inertia_kg_m2=inertia, step_s=step_s, forcing='symmetric',
                                  rate_weight=(0.25, 0.35, 0.65), torque_weight=(2, 2, 2)))
    assert found.closed_loop_radius < 1
    assert found.residual < 1e-9
