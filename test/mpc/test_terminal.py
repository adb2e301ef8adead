# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Linearisation, Riccati solution and local law against their definitions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cases import LIMITS, configuration
from reference import advance, chart, chart_state, stage_cost
from strategies import INERTIAS

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.design import TerminalDesign
from manifold_mpc_ros.terminal.problem_of import terminal_design

CASES: dict[str, dict[str, Any]] = {
    'identity': {'inertia_kg_m2': np.eye(3)},
    'paper': LIMITS,
    'symmetric': {**LIMITS, 'forcing': 'symmetric'},
    'off_diagonal': {
        **LIMITS, 'forcing': 'symmetric', 'inertia_kg_m2': INERTIAS['off_diagonal'],
        'attitude_weight': np.diag([1.0, 2.0, 3.0]) + 0.2,
        'torque_weight': np.diag([2.0, 1.0, 3.0]) + 0.1},
    'cubesat': {'forcing': 'symmetric', 'inertia_kg_m2': INERTIAS['cubesat'], 'step_s': 0.1,
                'torque_weight': 1e4 * np.eye(3)},
}
in_cases = pytest.mark.parametrize('case', sorted(CASES))


@pytest.fixture(scope='module')
def designs() -> Callable[[str], tuple[AttitudeMpcConfig, TerminalDesign]]:
    """Return ``get(case)``: configuration and design, made once."""
    made: dict[str, tuple[AttitudeMpcConfig, TerminalDesign]] = {}

    def get(case: str) -> tuple[AttitudeMpcConfig, TerminalDesign]:
        if case not in made:
            config = configuration(**CASES[case])
            made[case] = config, terminal_design(config)
        return made[case]
    return get


Designs = Callable[[str], tuple[AttitudeMpcConfig, TerminalDesign]]


def balanced(config: AttitudeMpcConfig) -> tuple[Array, float]:
    """Return units of xi (6,) and of the torque in which every matrix is of order one."""
    h = config.step_s
    units = np.array([1.0, 1.0, 1.0, 1 / h, 1 / h, 1 / h])
    return units, float(np.trace(config.inertia_kg_m2)) / 3 / h**2


@in_cases
def test_linearisation_is_the_derivative_of_the_step_in_the_chart(
        designs: Designs, case: str) -> None:
    """Central differences of xi -> xi+ at the equilibrium, for both forcings."""
    config, design = designs(case)
    units, torque_unit = balanced(config)

    def following(z: Array) -> Array:
        state = chart_state(config, z[:6] * units)
        return chart(config, *advance(config, *state, z[6:] * torque_unit)) / units

    step = 1e-4
    columns = [(following(step * e) - following(-step * e)) / (2 * step) for e in np.eye(9)]
    scaled = np.hstack([design.A * units / units[:, None],
                        design.B * torque_unit / units[:, None]])
    assert np.abs(np.array(columns).T - scaled).max() < 1e-7


@in_cases
def test_hessians_are_those_of_the_stage_cost(designs: Designs, case: str) -> None:
    """Second differences of L / lambda in (xi, tau): blocks Q and R, nothing across."""
    config, design = designs(case)
    units, torque_unit = balanced(config)

    def cost(z: Array) -> float:
        state = chart_state(config, z[:6] * units)
        return float(stage_cost(config, *state, z[6:] * torque_unit)) / config.terminal_scale

    step, e = 1e-3, np.eye(9)
    numeric = np.array([[
        (cost(step * (a + b)) - cost(step * (a - b)) - cost(step * (b - a))
         + cost(-step * (a + b))) / (4 * step**2) for a in e] for b in e])
    exact = np.zeros((9, 9))
    exact[:6, :6] = design.Q * np.outer(units, units)
    exact[6:, 6:] = design.R * torque_unit**2
    assert np.abs(numeric - exact).max() < 1e-5 * np.abs(exact).max()


@in_cases
def test_riccati_equation(designs: Designs, case: str) -> None:
    """P = A^T P A + Q - A^T P B (B^T P B + R)^-1 B^T P A, K its law, A + B K stable."""
    _, d = designs(case)
    inner = d.B.T @ d.P @ d.B + d.R
    cross = d.A.T @ d.P @ d.B
    residual = d.A.T @ d.P @ d.A + d.Q - cross @ np.linalg.solve(inner, cross.T) - d.P
    assert np.abs(residual).max() < 1e-12 * np.abs(d.P).max()
    assert d.riccati_residual == pytest.approx(
        np.abs(residual).max() / np.abs(d.P).max(), abs=1e-13)
    assert np.abs(d.K + np.linalg.solve(inner, cross.T)).max() < 1e-12 * np.abs(d.K).max()
    assert np.array_equal(d.P, d.P.T)
    assert np.linalg.eigvalsh(d.P)[0] > 0
    radius = np.abs(np.linalg.eigvals(d.A + d.B @ d.K)).max()
    assert radius < 1
    assert d.closed_loop_radius == pytest.approx(radius)


@in_cases
def test_value_iteration_gives_the_same_cost_and_law(designs: Designs, case: str) -> None:
    """The Riccati recursion from zero: optimal costs of ever longer horizons."""
    _, d = designs(case)
    P, K = np.zeros((6, 6)), np.zeros((3, 6))
    for _ in range(400):
        K = -np.linalg.solve(d.B.T @ P @ d.B + d.R, d.B.T @ P @ d.A)
        P = d.Q + d.A.T @ P @ (d.A + d.B @ K)
    assert np.abs(P - d.P).max() < 1e-9 * np.abs(d.P).max()
    assert np.abs(K - d.K).max() < 1e-9 * np.abs(d.K).max()


def test_an_impossible_weight_is_a_design_error() -> None:
    """Torque so dear that the closed loop is nearer to standing still than rounding tells."""
    assert terminal_design(configuration(torque_weight=1e14 * np.eye(3))).closed_loop_radius < 1
    with pytest.raises(DesignError, match=r'Riccati|stabilisable'):
        terminal_design(configuration(torque_weight=1e26 * np.eye(3)))
