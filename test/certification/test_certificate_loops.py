# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The enclosed loops hold the plant's loop and its derivatives at every point of a box."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from flint import arb, arb_mat
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import INERTIAS

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lab.certification.enclosure import ClosedLoop, Loop, MeanValueForms
from manifold_mpc_ros.lab.certification.enclosures import describe, loop_maker
from manifold_mpc_ros.lab.certification.jets import coordinates
from manifold_mpc_ros.lab.certification.rigid_body_enclosure import (
    RigidBodyEnclosure,
    lowest_eigenvalue,
)
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.design import TerminalDesign
from manifold_mpc_ros.terminal.problem_of import problem_of, terminal_design

BODY = np.diag([1.0, 0.9, 0.6])
CASES: dict[str, dict[str, Any]] = {
    'attitude': {},
    'attitude, paper forcing': {'forcing': 'paper'},
    'attitude, off diagonal': {'inertia_kg_m2': INERTIAS['off_diagonal'],
                               'max_torque_n_m': (0.1, 0.2, 0.3)},
    'pointing': {'target': 'pointing'},
    'pointing, skew axis': {'target': 'pointing', 'pointing_axis_B': np.array([0.6, -0.48, 0.64]),
                            'forcing': 'paper'},
}


def configuration(**changes: Any) -> AttitudeMpcConfig:
    J = np.asarray(changes.get('inertia_kg_m2', BODY))
    values: dict[str, Any] = {
        'inertia_kg_m2': J, 'step_s': 0.5, 'horizon': 20, 'attitude_weight': np.ones(3),
        'rate_weight': np.trace(J) / 2 * np.eye(3) - J, 'torque_weight': 2 * np.ones(3),
        'max_torque_n_m': 0.3}
    return AttitudeMpcConfig(**{**values, **changes})


@functools.cache
def loop_of(case: str) -> tuple[ClosedLoop, TerminalDesign, Callable[..., Any]]:
    """Return the enclosure, the design, and the plant's (xi+, d xi+, L) in CasADi."""
    config = configuration(**CASES[case])
    design, problem = terminal_design(config), problem_of(config)
    xi = ca.SX.sym('xi', problem.states.dimension)
    x, u = problem.states.point(xi), problem.controls.point(ca.DM(design.K) @ xi)
    following = problem.states.coordinates(problem.step(x, u))
    plant = ca.Function('plant', [xi], [following, ca.jacobian(following, xi),
                                        problem.stage_cost(x, u)])
    return loop_maker(*describe(config), design.K)(), design, plant


def enclosed(loop: ClosedLoop, centre: Array, radius: Array) -> Loop:
    forms = MeanValueForms()
    middle = loop.advance(coordinates([arb(x) for x in centre.tolist()], second=False), forms)
    forms.refine('following', middle.following)
    forms.offsets = arb_mat(len(centre), 1, [arb(0, r) for r in radius.tolist()])
    box = [arb(x, r) for x, r in zip(centre.tolist(), radius.tolist())]
    result = loop.advance(coordinates(box), forms)
    return Loop(forms.refine('following', result.following), result.ratios)


@pytest.mark.parametrize('case', CASES)
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_the_plants_loop_is_inside(case: str, data: st.DataObject) -> None:
    loop, design, plant = loop_of(case)
    rng = np.random.default_rng(data.draw(st.integers(0, 2 ** 32 - 1)))
    half = np.sqrt(design.c * np.diag(np.linalg.inv(design.P)))
    where = data.draw(st.sampled_from([0.0, 1e-9, 0.3, 0.7]))
    size = data.draw(st.sampled_from([1e-9, 1e-4, 0.05, 0.2]))
    centre, radius = where * half * rng.uniform(-1, 1, len(half)), size * half
    result = enclosed(loop, centre, radius)
    for point in (centre, *(centre + radius * rng.uniform(-1, 1, (4, len(half)))),
                  centre + radius * rng.choice([-1, 1], len(half))):
        value, slope, _ = (np.array(part) for part in plant(point))
        bends = [np.array(plant(point + 1e-5 * axis)[1]) - np.array(plant(point - 1e-5 * axis)[1])
                 for axis in np.eye(len(half))]
        for i, jet in enumerate(result.following):
            assert (jet.value + arb(0, 1e-11)).contains(float(value[i, 0]))
            for j in range(len(half)):
                assert (jet.gradient[0, j] + arb(0, 1e-9)).contains(float(slope[i, j]))
                for k, bend in enumerate(bends):
                    assert (jet.hessian[j, k] + arb(0, 1e-5)).contains(float(bend[i, j]) / 2e-5)


@pytest.mark.parametrize('case', CASES)
def test_small_boxes_are_enclosed_tightly(case: str) -> None:
    loop, design, _ = loop_of(case)
    half = np.sqrt(design.c * np.diag(np.linalg.inv(design.P)))
    widths = []
    for size in (1e-3, 1e-4):
        result = enclosed(loop, 0.3 * half, size * half)
        widths.append(max(float(entry.rad()) for jet in result.following
                          for entry in jet.gradient.entries()))
    assert widths[1] == pytest.approx(widths[0] / 10, rel=0.1)


@pytest.mark.parametrize('case', CASES)
def test_the_weight_bounds_the_stage_cost(case: str) -> None:
    loop, design, plant = loop_of(case)
    weight = np.array([float(entry.mid()) for entry in loop.weight.entries()])
    weight = weight.reshape(len(design.P), -1)
    assert loop.check_cost() is None
    rng = np.random.default_rng(5)
    scale = configuration().terminal_scale
    assert np.allclose(weight / scale, design.Q + design.K.T @ design.R @ design.K, rtol=1e-9)
    for xi in rng.normal(size=(300, len(design.P))) * rng.uniform(0, 1, (300, 1)):
        assert float(plant(xi)[2]) <= xi @ weight @ xi / 2 * (1 + 1e-12)


@pytest.mark.parametrize('name', INERTIAS)
def test_the_guard_is_not_above_the_smallest_moment(name: str) -> None:
    smallest = float(np.linalg.eigvalsh(INERTIAS[name])[0])
    guard = float(lowest_eigenvalue(INERTIAS[name]).mid())
    assert smallest * (1 - 1e-8) < guard < smallest * (1 + 1e-15)


@pytest.mark.parametrize(('rate', 'broken'), [
    ((0.5, 0.0, 0.0), []), ((1.6, 0.0, 0.0), ['free step']),
    ((0.0, 0.0, 3.3), ['branch of the free step']),
])
def test_beyond_guard_and_branch_the_step_is_not_claimed(
    rate: tuple[float, float, float], broken: list[str],
) -> None:
    config = configuration(max_torque_n_m=None)
    loop = loop_maker(*describe(config), terminal_design(config).K)()
    ratios = enclosed(loop, np.array([0.0, 0.0, 0.0, *rate]), np.full(6, 1e-6)).ratios
    exceeded = [name for name, ratio in ratios.items() if not ratio < 1]
    assert set(broken) <= set(exceeded)
    assert bool(exceeded) == bool(broken)


def test_a_momentum_box_without_a_root_gives_nothing() -> None:
    body = RigidBodyEnclosure(configuration(), np.zeros((3, 6)))
    found = body._root([arb(0.1, 1e-3), arb(-0.05, 1e-3), arb(0.02, 1e-3)])
    assert all(entry.is_finite() and entry.rad() < 2e-3 for entry in found)
    assert not any(entry.is_finite() for entry in body._root([arb(0, 5)] * 3))
