# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is true is proved, what is wrong on purpose is not, and the reason is named."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lab.certification.certification import certify_problem, default_margin
from manifold_mpc_ros.lab.certification.certify import Proof, bounding_box, prove
from manifold_mpc_ros.lab.certification.enclosures import configuration_of, describe, loop_maker
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.design import TerminalDesign
from manifold_mpc_ros.terminal.level import LocalLoop
from manifold_mpc_ros.terminal.problem_of import problem_of, terminal_design


def configuration(**changes: Any) -> AttitudeMpcConfig:
    J = np.asarray(changes.get('inertia_kg_m2', np.diag([1.0, 0.9, 0.6])))
    values: dict[str, Any] = {
        'inertia_kg_m2': J, 'step_s': 0.5, 'horizon': 20, 'attitude_weight': np.ones(3),
        'rate_weight': np.trace(J) / 2 * np.eye(3) - J, 'torque_weight': 2 * np.ones(3),
        'max_torque_n_m': 0.05}
    return AttitudeMpcConfig(**{**values, **changes})


@functools.cache
def small() -> tuple[AttitudeMpcConfig, TerminalDesign]:
    config = configuration()
    return config, terminal_design(config)


def attempt(config: AttitudeMpcConfig, P: Array, K: Array, level: float, **options: Any) -> Proof:
    return prove(loop_maker(*describe(config), K), P, K, level, smaller=False, **options)


@pytest.mark.parametrize('changes', [
    {}, {'forcing': 'paper'}, {'target': 'pointing'},
    {'target': 'pointing', 'pointing_axis_B': np.array([0.6, -0.48, 0.64]),
     'max_torque_n_m': 0.03},
    {'max_torque_n_m': (0.04, np.inf, 0.05), 'max_rate_rad_s': 0.4},
    {'inertia_kg_m2': np.diag([3.0, 2.7, 2.0]), 'max_torque_n_m': 0.1},
    {'rate_ellipsoid_s2': np.array([[9.0, 1.0, 0.0], [1.0, 8.0, 0.0], [0.0, 0.0, 10.0]])},
])
def test_small_terminal_sets_are_certified(changes: dict[str, Any]) -> None:
    config = configuration(**changes)
    certificate = certify_problem(*describe(config))
    assert certificate.complete
    assert certificate.evidence['reason'] == ''
    assert certificate.claim() == f'certified on all of X_T (c = {certificate.design_level:.6g})'
    ratios = certificate.evidence['largest_ratios']
    assert {'free step', 'next step'} <= set(ratios)
    assert max(ratios.values()) < 1
    assert any('rate' in name for name in ratios) == bool(config.rate_limits)
    # What is proved is so on samples: F falls by more than (1 + margin) L.
    states = np.random.default_rng(3).normal(size=(2000, len(certificate.P)))
    states *= np.sqrt(certificate.certified_level / np.einsum(
        'ni,ij,nj->n', states, certificate.P, states))[:, None]
    decrease = LocalLoop(problem_of(config), certificate.P, certificate.K).decrease(states)
    assert decrease.max() < -certificate.margin


def test_a_cone_that_cuts_the_set_is_proved_and_a_wider_one_is_not() -> None:
    sun = Cone('sun', (1.0, 0.0, 0.0), (0.8, 0.6, 0.0), 0.58)
    config = configuration(max_rate_rad_s=0.2, cones=(sun,))
    kind, values = describe(config)
    design = terminal_design(config)
    assert design.report.limiting == 'cone sun'
    assert certify_problem(kind, values).complete
    wider = {**values, 'cones': [{**values['cones'][0], 'half_angle_rad': 0.59}]}
    proof = prove(loop_maker(kind, wider, design.K), design.P, design.K, design.c, smaller=False)
    assert proof.reason.startswith('cone sun holds up to')


def test_covering_boxes_and_processes_prove_the_same() -> None:
    """A level that takes a hundred boxes; at 0.08 N m the last bits of K decide how many."""
    config = configuration(max_torque_n_m=0.1)
    design = terminal_design(config)
    alone = attempt(config, design.P, design.K, design.c)
    shared = attempt(config, design.P, design.K, design.c, workers=2)
    assert alone.complete
    assert shared.complete
    assert alone.cover.boxes == shared.cover.boxes > 1


def test_the_papers_printed_b_has_no_certificate() -> None:
    """P and K from B = [0; h I] in place of [0; h J^-1] (docs/theory.md, section 11)."""
    config = configuration(inertia_kg_m2=np.diag([3.0, 2.7, 2.0]), forcing='paper',
                           max_torque_n_m=None)
    design = terminal_design(config)
    printed = np.vstack([np.zeros((3, 3)), config.step_s * np.eye(3)])
    P = solve_discrete_are(design.A, printed, design.Q, design.R)
    P = (P + P.T) / 2
    K = -np.linalg.solve(printed.T @ P @ printed + design.R, printed.T @ P @ design.A)
    proof = attempt(config, P, K, 1e-3)
    assert not proof.complete
    assert proof.level == 0
    assert proof.reason.startswith('decrease at the equilibrium')
    assert attempt(config, design.P, design.K, 1e-3).complete


def test_a_gain_with_a_flipped_sign_is_not_certified() -> None:
    config, design = small()
    for wrong in (-design.K, design.K * np.array([1, 1, 1, 1, -1, 1])):
        proof = attempt(config, design.P, wrong, design.c / 100)
        assert proof.level == 0
        assert proof.reason.startswith('decrease at the equilibrium')


def test_a_level_beyond_the_torque_limit_is_not_certified() -> None:
    config, design = small()
    proof = attempt(config, design.P, design.K, 10 * design.c)
    assert proof.level == 0
    assert proof.reason.startswith('control limit holds up to')
    assert proof.limits['control limit'] == pytest.approx(design.c / 0.99, rel=1e-9)


def test_then_the_largest_level_that_is_proved_is_named() -> None:
    config, design = small()
    larger = TerminalDesign(**{**vars(design), 'c': 10 * design.c})
    certificate = certify_problem(*describe(config), design=larger)
    assert not certificate.complete
    assert certificate.certified_level == pytest.approx(design.c / 0.99, rel=1e-9)
    assert certificate.claim().startswith('certified up to c =')
    assert 'sampled between' in certificate.claim()
    assert 'control limit' in certificate.evidence['reason']


def test_a_terminal_cost_too_small_is_not_certified() -> None:
    config, design = small()
    proof = attempt(config, config.terminal_scale * design.P, design.K, design.c / 100)
    assert proof.level == 0
    assert proof.reason.startswith('decrease at the equilibrium')


@pytest.mark.parametrize('wrong', [-1.0, np.nan])
def test_a_terminal_cost_that_is_not_positive_is_not_certified(wrong: float) -> None:
    config, design = small()
    P = design.P.copy()
    P[0, 0] = wrong
    proof = attempt(config, P, design.K, design.c)
    assert proof.level == 0
    assert 'positive definite' in proof.reason


def test_a_rate_limit_that_is_broken_is_found() -> None:
    config = configuration(max_rate_rad_s=0.02)
    _, design = small()
    proof = attempt(config, design.P, design.K, design.c)
    assert not proof.complete
    assert proof.level == 0
    assert proof.reason.startswith('rate ')


def test_more_margin_than_there_is_is_not_certified() -> None:
    config, design = small()
    assert attempt(config, design.P, design.K, design.c / 100, margin=8.0).complete
    assert not attempt(config, design.P, design.K, design.c / 100, margin=9.1).complete


def test_a_budget_too_small_names_a_smaller_level_or_nothing() -> None:
    config = configuration(max_torque_n_m=None)
    certificate = certify_problem(*describe(config), budget=10)
    assert 0 < certificate.certified_level < certificate.design_level
    assert 'sampled' in certificate.claim()
    assert 'budget' in certificate.evidence['reason']


def test_the_default_margin_leaves_room() -> None:
    assert default_margin({'terminal_scale': 0.1}) == 0.1
    assert default_margin({'terminal_scale': 0.96}) == pytest.approx(0.5 * (1 / 0.96 - 1))


@pytest.mark.parametrize('limits', [{}, {'max_input': 1.0, 'max_velocity': 2.0}])
def test_linear_problems_take_one_box(limits: dict[str, float]) -> None:
    certificate = certify_problem('double integrator', limits)
    assert certificate.complete
    assert certificate.evidence['boxes_of_all_attempts'] == 1


def test_the_bounding_box_holds_the_set() -> None:
    _, design = small()
    half = bounding_box(design.P, design.c)
    exact = np.sqrt(design.c * np.diag(np.linalg.inv(design.P)))
    assert np.all(half >= exact * (1 - 1e-12))
    assert np.allclose(half, exact, rtol=1e-9)


def test_descriptions_round_trip() -> None:
    config = configuration(max_torque_n_m=(0.1, np.inf, 0.3), pointing_axis_B=np.array([1, 2, 3]))
    again = configuration_of(describe(config)[1])
    assert describe(again) == describe(config)
    assert np.array_equal(again.max_torque_n_m, config.max_torque_n_m)
    assert np.array_equal(again.pointing_axis_B, config.pointing_axis_B)
