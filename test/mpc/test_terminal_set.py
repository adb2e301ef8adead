# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The terminal set against the three conditions of paper eq. (8), on samples of its own.

For every xi with xi^T P xi <= c and tau = K xi: (8a) limits hold, (8b) xi+ is in the set,
(8c) F(xi+) - F(xi) <= -L(xi, tau). Nothing of the package's own check is used.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from cases import LIMITS, configuration
from reference import advance, chart, chart_state, stage_cost
from strategies import INERTIAS, generator, unit_vectors

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.design import TerminalDesign
from manifold_mpc_ros.terminal.problem_of import terminal_design

SYMMETRIC: dict[str, Any] = {'forcing': 'symmetric'}
# What cuts the set in each of them.
CASES: dict[str, tuple[str, dict[str, Any]]] = {
    'unit_inertia': ('chart', {'inertia_kg_m2': np.eye(3)}),
    'free': ('step', SYMMETRIC),
    'limited': ('torque', {**LIMITS, **SYMMETRIC}),
    'limited_paper': ('torque', LIMITS),
    'slow': ('rate', {'max_rate_rad_s': 0.1, **SYMMETRIC}),
    'off_diagonal': ('torque', {
        **LIMITS, **SYMMETRIC, 'inertia_kg_m2': INERTIAS['off_diagonal'], 'step_s': 0.25}),
    'one_axis': ('torque', {'max_torque_n_m': (np.inf, 0.2, np.inf), **SYMMETRIC}),
    'tight': ('decrease', {'terminal_scale': 0.99, **SYMMETRIC}),
}
in_cases = pytest.mark.parametrize('case', sorted(CASES))
SAMPLES = 20000


@functools.cache
def designed(case: str) -> tuple[AttitudeMpcConfig, TerminalDesign]:
    """Return configuration and design of a case, made once."""
    config = configuration(**CASES[case][1])
    return config, terminal_design(config)


class Outcome(NamedTuple):
    """What the local law does at chart states (n, 6)."""

    torque: Array
    rate: Array
    level: Array
    decrease: Array


def on_level(P: Array, level: Array, directions: Array) -> Array:
    """Return states (n, 6) with xi^T P xi = level along whitened unit directions (n, 6)."""
    return np.sqrt(level)[:, None] * directions @ np.linalg.inv(np.linalg.cholesky(P))


def samples(design: TerminalDesign, key: str) -> Array:
    """Return states of the set: half on its boundary, the rest down to a millionth of c."""
    rng = generator('terminal set', key)
    v = rng.standard_normal((SAMPLES, 6))
    fraction = np.concatenate([np.ones(SAMPLES // 2), np.logspace(-6, 0, SAMPLES // 2)])
    return on_level(design.P, fraction * design.c, v / np.linalg.norm(v, axis=1, keepdims=True))


def apply_law(config: AttitudeMpcConfig, d: TerminalDesign, xi: Array) -> Outcome:
    """Return torques, rates, levels of xi+, and ``(F(xi+) - F(xi) + L) / L``."""
    g, omega = chart_state(config, xi)
    tau = xi @ d.K.T
    following = chart(config, *advance(config, g, omega, tau))
    level = np.einsum('ni,ij,nj->n', following, d.P, following)
    before = np.einsum('ni,ij,nj->n', xi, d.P, xi)
    paid = stage_cost(config, g, omega, tau)
    return Outcome(tau, omega, level, (level / 2 - before / 2 + paid) / paid)


def limit(box: Array | None) -> Array:
    """Return a box (3,), infinite where there is none."""
    return np.full(3, np.inf) if box is None else box


@in_cases
def test_the_three_conditions_hold_in_the_set(case: str) -> None:
    config, design = designed(case)
    assert design.report.limiting == CASES[case][0]
    outcome = apply_law(config, design, samples(design, case))
    assert (np.abs(outcome.torque) <= limit(config.max_torque_n_m)).all()
    assert (np.abs(outcome.rate) <= limit(config.max_rate_rad_s)).all()
    assert outcome.level.max() <= design.c
    assert outcome.decrease.max() <= 0
    assert design.report.worst_decrease == pytest.approx(outcome.decrease.max(), abs=0.3)
    worst = steepest(lambda xi: apply_law(config, design, xi).decrease, design, design.c)
    assert worst <= 0


def steepest(score: Callable[[Array], Array], d: TerminalDesign, level: float) -> float:
    """Return the largest score on a level: the best of many directions, then climbing."""
    rng, best = generator('steepest'), unit_six(4000)
    for reach in np.geomspace(0.5, 0.005, 25):
        values = score(on_level(d.P, np.full(len(best), level), best))
        top = best[np.argsort(values)[-4:]]
        near = np.repeat(top, 40, axis=0) + reach * rng.standard_normal((160, 6))
        best = np.vstack([top, near / np.linalg.norm(near, axis=1, keepdims=True)])
    return float(score(on_level(d.P, np.full(len(best), level), best)).max())


@in_cases
def test_the_set_is_as_large_as_what_cuts_it_allows(case: str) -> None:
    """Beyond c the named condition breaks, and c is 99 % of where it does."""
    limiting, (config, design) = CASES[case][0], designed(case)
    edge = design.report.limits[limiting]
    assert min(design.report.limits.values()) == edge
    assert design.c == pytest.approx(0.99 * edge, rel=1e-12)
    assert used_up(config, design, limiting, 1.001 * edge) > 1.0
    assert used_up(config, design, limiting, design.c) < 1.0


def used_up(config: AttitudeMpcConfig, d: TerminalDesign, limiting: str, level: float
                ) -> float:
    """Return how far the worst state found on a level uses up what limits the set."""
    covariance = np.linalg.inv(d.P)
    if limiting == 'chart':
        return float(np.sqrt(level * np.linalg.eigvalsh(covariance[:3, :3])[-1])) / (0.999 * np.pi)
    if limiting == 'torque':
        worst = worst_torques(d, level)
        used = np.abs(np.einsum('ij,ij->i', d.K, worst)) / limit(config.max_torque_n_m)
        return float(used.max())
    scores: dict[str, Callable[[Array], Array]] = {
        'rate': lambda xi: np.max(
            np.abs(chart_state(config, xi)[1]) / limit(config.max_rate_rad_s), axis=1),
        'step': lambda xi: momentum_load(config, d, xi) / 0.999,
        'decrease': lambda xi: 1.0 + apply_law(config, d, xi).decrease}
    return steepest(scores[limiting], d, level)


def unit_six(n: int) -> Array:
    """Return n directions (n, 6)."""
    v = generator('six').standard_normal((n, 6))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def worst_torques(d: TerminalDesign, level: float) -> Array:
    """Return the states (3, 6) of a level with the largest torque about each axis.

    max K_i xi over xi^T P xi = level is at xi = sqrt(level / (K_i S K_i^T)) S K_i^T, S = P^-1.
    """
    directions = np.linalg.solve(d.P, d.K.T).T
    size = np.einsum('ij,jk,ik->i', directions, d.P, directions)
    return np.sqrt(level / size)[:, None] * directions


def momentum_load(config: AttitudeMpcConfig, d: TerminalDesign, xi: Array) -> Array:
    """Return the largest |m| of the free step and of the forced one, over the guard (n,)."""
    h, J = config.step_s, config.inertia_kg_m2
    momentum = h * chart_state(config, xi)[1] @ J
    pushed = momentum + h * h / 2 * xi @ d.K.T
    norms = [np.linalg.norm(m, axis=1) for m in (momentum, pushed)]
    return np.max(norms, axis=0) / np.linalg.eigvalsh(J)[0]


def test_the_torque_limit_alone_shrinks_the_set() -> None:
    """Trap 5: with it the set no longer holds every attitude at rest, without it nearly all."""
    reach = {}
    for name, changes in (('free', {}), ('limited', {'max_torque_n_m': 0.3})):
        design = terminal_design(configuration(inertia_kg_m2=np.eye(3), **changes))
        assert ('torque' in design.report.limits) == (name == 'limited')
        axes = unit_vectors(generator('reach'), 100)
        per_angle = np.einsum('ni,ij,nj->n', axes, design.P[:3, :3], axes)
        reach[name] = float(np.degrees(np.sqrt(design.c / per_angle.max())))
    assert reach['free'] > 120.0
    assert reach['limited'] < 40.0


def test_the_chart_cuts_the_set_at_half_a_turn() -> None:
    """J = I, h = 0.5, no limits: the largest |Log g| in the set is 0.999 pi, c aside."""
    design = terminal_design(configuration(inertia_kg_m2=np.eye(3)))
    assert design.report.limiting == 'chart'
    edge = on_level(design.P, np.full(20000, design.report.limits['chart']), unit_six(20000))
    assert 3.0 < np.linalg.norm(edge[:, :3], axis=1).max() <= 0.999 * np.pi * (1 + 1e-12)
    assert so3.angle(so3.exp(edge[:, :3])).max() < np.pi


def test_a_scale_too_close_to_one_is_certified_or_refused() -> None:
    """Lambda close to 1 leaves little room for the curvature of the step."""
    config = configuration(terminal_scale=0.999999, forcing='symmetric')
    with contextlib.suppress(DesignError):
        design = terminal_design(config)
        assert design.report.worst_decrease <= 0
        worst = steepest(lambda xi: apply_law(config, design, xi).decrease, design, design.c)
        assert worst <= 0
