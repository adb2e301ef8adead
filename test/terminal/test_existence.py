# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Each existence condition broken on purpose gives the error that names it, and its margin."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from cases import configuration
from linear_cases import linear_problem, linearisation, random_cases

from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.design import design_terminal
from manifold_mpc_ros.terminal.existence import check_existence, symplectic_pencil
from manifold_mpc_ros.terminal.linearisation import linearise
from manifold_mpc_ros.terminal.problem_of import attitude_problem, pointing_problem
from manifold_mpc_ros.terminal.riccati import solve_riccati
from manifold_mpc_ros.terminal.rigid_body import quadratic, trace_hessian

TURN = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])


def message(A: Array, B: Array, hessian: Array) -> str:
    """Return what the solution of a linear-quadratic problem is refused with."""
    with pytest.raises(DesignError) as caught:
        solve_riccati(linearisation(A, B, hessian))
    return str(caught.value)


@pytest.mark.parametrize('mode', [1.0, -1.0, 1.3, -2.0])
def test_an_unstable_mode_that_no_input_reaches(mode: float) -> None:
    """PBH: the eigenvalue and the direction are in the message."""
    text = message(np.diag([0.5, mode]), np.array([[1.0], [0.0]]), np.eye(3))
    assert 'not stabilisable' in text
    assert f'eigenvalue {mode:.6g} along xi = (0, 1)' in text


def test_an_unstable_pair_that_no_input_reaches() -> None:
    A = np.block([[1.1 * TURN, np.zeros((2, 1))], [np.zeros((1, 2)), 0.5]])
    text = message(A, np.array([[0.0], [0.0], [1.0]]), np.eye(4))
    assert 'not stabilisable' in text
    assert re.search(r'eigenvalue 0\.84\d+[+-]0\.70\d+j', text)


def test_a_stable_mode_may_be_out_of_reach() -> None:
    found = solve_riccati(linearisation(np.diag([1.2, 0.5]), np.array([[1.0], [0.0]]), np.eye(3)))
    assert found.existence.unstable_modes == 1
    assert found.existence.reachability > 0.1


@pytest.mark.parametrize(('A', 'where'), [
    (np.diag([0.5, 1.0]), '1 '), (np.diag([0.5, -1.0]), '-1 '),
])
def test_a_mode_on_the_unit_circle_that_costs_nothing(A: Array, where: str) -> None:
    """Reachable, but L does not see it: the pencil has it as an eigenvalue."""
    text = message(A, np.ones((2, 1)), np.diag([1.0, 0.0, 1.0]))
    assert f'symplectic pencil has an eigenvalue on the unit circle, {where}' in text
    assert 'along xi = (0, 1)' in text


def test_an_oscillation_that_costs_nothing() -> None:
    text = message(TURN, np.array([[0.0], [1.0]]), np.diag([0.0, 0.0, 1.0]))
    assert 'symplectic pencil has an eigenvalue on the unit circle' in text
    assert re.search(r'circle, 0\.76\d+[+-]0\.64\d+j', text)


def test_a_cost_that_a_definite_hessian_alone_does_not_describe() -> None:
    """An unstable mode that costs nothing: no eigenvalue on the circle, P > 0 exists.

    Paper (3b) still forbids it, L has to be positive away from the equilibrium, and so the
    Hessian's error comes, with the direction.
    """
    A, B, H = np.diag([0.5, 2.0]), np.ones((2, 1)), np.diag([1.0, 0.0, 1.0])
    text = message(A, B, H)
    assert 'Hessian [[Q, N], [N^T, R]] of L at the equilibrium is not positive definite' in text
    assert 'along xi = (0, 1), eta = (0)' in text


@pytest.mark.parametrize(('hessian', 'direction'), [
    (np.diag([1.0, 1.0, 0.0]), 'xi = (0, 0), eta = (1)'),
    (np.diag([1.0, -0.1, 1.0]), 'xi = (0, 1), eta = (0)'),
    (np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 1.0]]),
     'xi = (0.707, 0), eta = (-0.707)'),
    (np.array([[1.0, 0.0, 1.1], [0.0, 1.0, 0.0], [1.1, 0.0, 1.0]]),
     'xi = (0.707, 0), eta = (-0.707)'),
])
def test_an_indefinite_hessian(hessian: Array, direction: str) -> None:
    """In the input, in the state, and across: Q > 0 and R > 0 are not enough with N."""
    text = message(np.diag([0.5, 0.9]), np.ones((2, 1)), hessian)
    assert 'not positive definite' in text
    assert direction in text


def test_the_roll_of_a_pointing_task_on_so3_is_a_free_direction() -> None:
    """tr(Q (I - g)) with Q = w b b^T does not see the roll: no P on SO(3), but one on S^2."""
    config = configuration(target='pointing')
    problem = attitude_problem(config)
    hessian = trace_hessian(config.error_weight)
    free = replace(problem, stage_cost=lambda x, u: (
        problem.stage_cost(ca.vertcat(1, 0, 0, 0, x[4:8]), u) + 2 * quadratic(hessian, x[1:4])))
    with pytest.raises(DesignError, match='symplectic pencil') as caught:
        design_terminal(free)
    assert 'along xi = (0, 0, 1, 0, 0, 0)' in str(caught.value)
    assert 'free direction' in str(caught.value)
    margins = solve_riccati(linearise(pointing_problem(config))).existence
    assert margins.pencil_distance > 0.1
    assert margins.hessian_definiteness > 0.01


@pytest.mark.parametrize(('changes', 'match'), [
    ({'step': lambda x, u: x + u + 1e-3}, r'f\(x_e, u_e\) is not x_e \(off by 0.001'),
    ({'stage_cost': lambda x, u: ca.sumsqr(x) + ca.sumsqr(u) + 0.1}, r'L\(x_e, u_e\) is not 0'),
    ({'stage_cost': lambda x, u: ca.sumsqr(x + 0.1) + ca.sumsqr(u) - 0.02},
     'gradient of L at .* is not 0'),
    ({'stage_cost': lambda x, u: ca.sumsqr(x) + ca.sumsqr(u) + 0.1 * u[0]},
     'gradient of L at .* is not 0'),
    ({'stage_cost': lambda x, u: ca.norm_2(x) + ca.sumsqr(u)}, 'not differentiable'),
])
def test_an_origin_that_is_no_equilibrium(changes: dict[str, Any], match: str) -> None:
    problem = linear_problem(np.eye(2), np.eye(2), np.eye(4), **changes)
    with pytest.raises(DesignError, match=match) as caught:
        design_terminal(problem)
    assert str(caught.value).startswith('linear: ')


@pytest.mark.parametrize('index', range(12))
def test_the_margins_by_other_means(index: int) -> None:
    """The pencil's spectrum is that of A + B K and its mirror image; PBH by every mode."""
    A, B, H = random_cases(12)[index]
    linear = linearisation(A, B, H)
    found, margins = solve_riccati(linear), check_existence(linear)
    closed = np.abs(np.linalg.eigvals(A + B @ found.K))
    mirrored = np.concatenate([closed, 1 / closed])
    assert margins.pencil_distance == pytest.approx(np.abs(mirrored - 1).min(), rel=1e-6)
    modes = [mu for mu in np.linalg.eigvals(A) if abs(mu) >= 1]
    assert margins.unstable_modes == len(modes)
    if modes:
        least = min(np.linalg.svd(np.hstack([A - mu * np.eye(len(A)), B]))[1][-1] for mu in modes)
        assert margins.reachability == pytest.approx(least)
    values = np.linalg.eigvalsh(H)
    assert margins.hessian_definiteness == pytest.approx(values[0] / values[-1])
    values = np.linalg.eigvalsh(found.P)
    assert found.existence.P_definiteness == pytest.approx(values[0] / values[-1])
    left, right = symplectic_pencil(linear)
    assert left.shape == right.shape == (2 * len(A) + B.shape[1],) * 2


def test_margins_vanish_as_a_condition_is_approached() -> None:
    """Each figure is a distance: it shrinks with what it measures, by about as much."""
    def margins(A: Array, B: Array, H: Array) -> Any:
        return check_existence(linearisation(A, B, H))
    for small in (1e-2, 1e-3, 1e-4):
        B = np.array([[1.0], [small]])
        assert margins(np.diag([0.5, 1.5]), B, np.eye(3)).reachability == pytest.approx(
            small, rel=0.5)
        H = np.diag([1.0, small, 1.0])
        assert margins(np.diag([0.5, 0.9]), np.ones((2, 1)), H).hessian_definiteness == (
            pytest.approx(small))
        H = np.diag([1.0, small ** 2, 1.0])
        distance = margins(np.diag([0.5, 1.0]), np.ones((2, 1)), H).pencil_distance
        assert 0.1 * small < distance < 2 * small
