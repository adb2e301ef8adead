# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The general layer on SO(3) gives the numbers of the design derived by hand, to 1e-9."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import LIMITS, configuration
from hand_derived import hand_derived
from strategies import INERTIAS

from manifold_mpc_ros.terminal.design import design_terminal
from manifold_mpc_ros.terminal.problem_of import attitude_problem

SYMMETRIC: dict[str, Any] = {'forcing': 'symmetric'}
WEIGHTS: dict[str, Any] = {
    'attitude_weight': np.diag([1.0, 2.0, 3.0]) + 0.2,
    'torque_weight': np.diag([2.0, 1.0, 3.0]) + 0.1}
# What ends the set in each of them.
CASES: dict[str, tuple[str, dict[str, Any]]] = {
    'unit_inertia': ('chart', {'inertia_kg_m2': np.eye(3)}),
    'free': ('step', SYMMETRIC),
    'limited': ('torque', {**LIMITS, **SYMMETRIC}),
    'limited_paper': ('torque', LIMITS),
    'slow': ('rate', {'max_rate_rad_s': 0.1, 'max_torque_n_m': 0.3}),
    'off_diagonal': ('torque', {
        **LIMITS, **SYMMETRIC, **WEIGHTS, 'inertia_kg_m2': INERTIAS['off_diagonal']}),
    'off_diagonal_paper': ('torque', {
        **LIMITS, **WEIGHTS, 'inertia_kg_m2': INERTIAS['off_diagonal_prolate'],
        'max_rate_rad_s': None, 'max_torque_n_m': 0.1}),
    'one_axis': ('torque', {'max_torque_n_m': (np.inf, 0.2, np.inf), **SYMMETRIC}),
    'tight': ('decrease', {**LIMITS, **SYMMETRIC, 'terminal_scale': 0.99}),
    'cubesat': ('torque', {
        **SYMMETRIC, 'inertia_kg_m2': INERTIAS['cubesat'], 'step_s': 0.1,
        'torque_weight': 1e4 * np.eye(3), 'max_torque_n_m': 1e-3}),
    'station': ('torque', {
        **SYMMETRIC, 'inertia_kg_m2': INERTIAS['station'], 'step_s': 10.0, 'max_torque_n_m': 200.0,
        'rate_weight': 400.0 * np.eye(3), 'torque_weight': 1e-9 * np.eye(3)}),
}


@pytest.mark.parametrize('case', sorted(CASES))
def test_every_number_of_the_design(case: str) -> None:
    limiting, changes = CASES[case]
    config = configuration(**changes)
    expected, design = hand_derived(config), design_terminal(attitude_problem(config))
    for name in ('A', 'B', 'Q', 'R', 'P', 'K'):
        wanted = getattr(expected, name)
        assert np.abs(getattr(design, name) - wanted).max() <= 1e-9 * np.abs(wanted).max(), name
    units = np.abs(design.Q).max() * np.abs(design.R).max()
    assert np.abs(design.N).max() <= 1e-12 * np.sqrt(units)
    assert design.c == pytest.approx(expected.c, rel=1e-9)
    assert design.report.limiting == limiting
    assert design.report.limits == pytest.approx(expected.limits, rel=1e-9)


def test_a_wrong_inertia_would_be_seen() -> None:
    """The comparison is no tautology: the paper's B, or another forcing, is far off."""
    design = design_terminal(attitude_problem(configuration(**LIMITS)))
    other = hand_derived(configuration(**LIMITS, **SYMMETRIC))
    assert np.abs(design.B - other.B).max() > 0.05
    assert np.abs(design.P - other.P).max() > 0.01 * np.abs(design.P).max()
    assert abs(design.c / other.c - 1) > 1e-3
