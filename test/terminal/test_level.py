# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The largest level where it is known exactly, and the batches it is searched with."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from linear_cases import linear_problem
from scipy.optimize import brentq
from strategies import generator

from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.terminal.batched_evaluation import Batch
from manifold_mpc_ros.terminal.design import TerminalDesign, design_terminal
from manifold_mpc_ros.terminal.level import largest_level
from manifold_mpc_ros.terminal.manifold import Euclidean, Product, RotationGroup, Sphere

A, B = np.array([[1.0, 0.5], [0.0, 1.0]]), np.array([[0.125], [0.5]])


def designed(**changes: Any) -> TerminalDesign:
    """Return the design of a double integrator with changes."""
    return design_terminal(linear_problem(A, B, np.eye(3), **changes))


def test_a_linear_system_without_limits_is_ended_by_the_search_alone() -> None:
    """Then F(xi+) - F(xi) = -L / lambda exactly; c keeps each coordinate within 100 units."""
    design = designed(state_units=np.array([1.0, 3.0]))
    assert design.report.limiting == 'search'
    assert design.report.limits['decrease'] == np.inf
    assert design.report.worst_decrease == pytest.approx(1 - 1 / 0.5, abs=1e-9)
    largest = np.sqrt(design.c / 0.99 * np.diag(np.linalg.inv(design.P))) / [1.0, 3.0]
    assert largest.max() == pytest.approx(100.0)


def test_the_control_box_touches_the_set() -> None:
    """The largest |K xi| is sqrt(c K P^-1 K^T), the limit but for the 1 % that is kept."""
    design = designed(control_limits=np.array([0.3]), control_name='force')
    assert design.report.limiting == 'force'
    spread = (design.K @ np.linalg.inv(design.P) @ design.K.T).item()
    assert np.sqrt(design.c / 0.99 * spread) == pytest.approx(0.3, rel=1e-12)
    assert 'search' not in design.report.limits


def test_the_tightest_axis_of_a_box_counts_and_free_axes_do_not() -> None:
    problem = linear_problem(np.eye(2), np.eye(2), np.eye(4),
                             control_limits=np.array([0.3, np.inf]))
    design = design_terminal(problem)
    spread = np.diag(design.K @ np.linalg.inv(design.P) @ design.K.T)
    assert design.c == pytest.approx(0.99 * 0.09 / spread[0], rel=1e-12)
    tighter = design_terminal(replace(problem, control_limits=np.array([0.3, 0.1])))
    assert tighter.c == pytest.approx(0.99 * 0.01 / spread[1], rel=1e-12)


def test_a_linear_state_limit_is_found_by_the_search() -> None:
    """The largest |x_2| over the set is sqrt(c (P^-1)_22)."""
    design = designed(control_limits=np.array([10.0]),
                      state_limits={'speed': lambda x: ca.fabs(x[1]) / 0.2 - 1})
    assert design.report.limiting == 'speed'
    exact = 0.04 / np.linalg.inv(design.P)[1, 1]
    assert design.report.limits['speed'] == pytest.approx(exact, rel=1e-6)
    assert design.report.limits['speed'] >= exact * (1 - 1e-12)


def test_several_entries_of_a_state_limit() -> None:
    both = designed(control_limits=np.array([10.0]), state_limits={
        'box': lambda x: ca.vertcat(ca.fabs(x[0]) / 0.1, ca.fabs(x[1]) / 0.2) - 1})
    covariance = np.diag(np.linalg.inv(both.P))
    assert both.report.limits['box'] == pytest.approx(
        min(0.01 / covariance[0], 0.04 / covariance[1]), rel=1e-6)


def test_the_existence_of_the_step_ends_the_set() -> None:
    """A step that is only defined where |x_1 + 2 u| < 1, 0.999 of which may be used."""
    design = designed(existence=lambda x, u: ca.fabs(x[0] + 2 * u), control_limits=np.array([9.]))
    row = np.array([1.0, 0.0]) + 2 * design.K[0]
    exact = 0.999 ** 2 / (row @ np.linalg.inv(design.P) @ row)
    assert design.report.limiting == 'step'
    assert design.report.limits['step'] == pytest.approx(exact, rel=1e-6)


def test_a_step_that_is_not_a_number_beyond_its_domain_ends_the_set() -> None:
    def step(x: ca.SX, u: ca.SX) -> ca.SX:
        return ca.DM(A) @ x + ca.DM(B) @ u + 1e-9 * (ca.sqrt(1 - ca.sumsqr(x)) - 1)
    design = designed(step=step, control_limits=np.array([100.0]))
    assert design.report.limiting == 'decrease'
    assert design.report.limits['decrease'] == pytest.approx(
        np.linalg.eigvalsh(design.P)[0], rel=1e-2)


def test_the_decrease_of_a_nonlinear_scalar_system() -> None:
    """x+ = x + u + x^3: (8c) along the one dimension, against a root of its formula."""
    problem = linear_problem(
        np.eye(1), np.eye(1), np.eye(2), step=lambda x, u: x + u + x ** 3,
        control_limits=np.array([100.0]), terminal_scale=0.7)
    design = design_terminal(problem)
    p, k = design.P.item(), design.K.item()

    def excess(x: float) -> float:
        return p * ((x + k * x + x ** 3) ** 2 - x * x) / 2 + (x * x + (k * x) ** 2) / 2
    exact = brentq(excess, 0.05, 3.0)
    assert design.report.limiting == 'decrease'
    assert np.sqrt(design.report.limits['decrease'] / p) == pytest.approx(exact, rel=1e-9)
    assert design.report.worst_decrease < 0
    assert excess(np.sqrt(design.c / p)) < 0
    assert np.sqrt(design.report.limits['control'] / p) > 100 * exact  # seen from far away


@pytest.mark.parametrize('states', [
    Sphere([0.0, 0.0, 1.0]), Product(Euclidean(1), RotationGroup(scale=0.5))])
def test_the_chart_ends_the_set_at_its_radius(states: Any) -> None:
    """Kinematics on the manifold, nothing else in the way: the longest factor reaches 0.999."""
    n = states.dimension
    problem = linear_problem(
        np.eye(n), np.eye(n), np.eye(2 * n), states=states, terminal_scale=0.2,
        step=lambda x, u: states.retract(x, 0.3 * u),
        stage_cost=lambda x, u: (ca.sumsqr(states.coordinates(x)) + ca.sumsqr(u)) / 2)
    design = design_terminal(problem)
    curved = [(d, r) for d, r in states.chart_radii if np.isfinite(r)]
    block = np.linalg.inv(design.P)[-curved[0][0]:, -curved[0][0]:]
    reach = np.sqrt(design.report.limits['chart'] * np.linalg.eigvalsh(block)[-1])
    assert reach == pytest.approx(0.999 * curved[0][1])
    assert design.report.limiting == 'chart'


def test_a_law_that_does_not_stabilise_has_no_level() -> None:
    problem = linear_problem(A, B, np.eye(3))
    P = design_terminal(problem).P
    with pytest.raises(DesignError, match=r"condition 'decrease' near .*fails there$"):
        largest_level(problem, P, np.array([[0.1, 0.1]]))


def test_a_state_limit_at_the_equilibrium_has_no_level() -> None:
    with pytest.raises(DesignError, match=r"condition 'wall' near the equilibrium$"):
        designed(state_limits={'wall': lambda x: x[0]}, control_limits=np.array([1.0]))


def test_batches_give_what_the_virtual_machine_gives() -> None:
    """Every kind of instruction, more points than a pass takes, and few of them."""
    x = ca.SX.sym('x', 3)
    value = (ca.if_else(x[0] > 0.2, ca.sqrt(ca.fabs(x[1])), ca.exp(x[2])) + ca.fmin(x[0], x[1])
             * ca.atan2(x[1], x[2]) / (2 + ca.sin(x[0]) * ca.cos(x[1])) - 2 * x[2] ** 3
             + ca.if_else(ca.logic_and(x[0] < 0, ca.logic_not(x[1] <= 0)), 1 / x[0], x[1] * 0.1)
             + ca.sign(x[2]) * ca.fmax(x[0], ca.tanh(x[1])) + ca.tan(x[0]) + x[1] ** 1.5)
    batch = Batch(x, value)
    reference = ca.Function('f', [x], [value])
    points = generator('batch').standard_normal((9001, 3))
    points[:, 1] = np.abs(points[:, 1])
    expected = np.array(reference.map(len(points))(points.T))[0]
    for count in (1, 40, 200, 4000, 4001, 9001):
        assert np.allclose(batch(points[:count]), expected[:count], rtol=1e-12, atol=1e-12)
    # What is not selected may be anything.
    hidden = Batch(x, ca.if_else(x[0] > 100, ca.log(-ca.sumsqr(x)), x[0]))
    assert np.array_equal(hidden(points), points[:, 0])


def test_an_instruction_that_is_not_known_falls_back() -> None:
    x = ca.SX.sym('x', 2)
    points = generator('erf').standard_normal((500, 2))
    expected = np.array(ca.Function('f', [x], [ca.erf(x[0]) * x[1]]).map(500)(points.T))[0]
    assert np.array_equal(Batch(x, ca.erf(x[0]) * x[1])(points), expected)
