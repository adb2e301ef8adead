# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The terminal set of pointing against paper eq. (8), in numpy, with the body's roll kept.

States of the set are given attitudes with any roll; the law, the integrator and the costs are
those of the whole body, so nothing of the reduction to S^2 is used.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest
from cases import LIMITS, configuration
from strategies import INERTIAS, generator

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.lgvi import legendre, lgvi_step, step_rotation
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.design import TerminalDesign
from manifold_mpc_ros.terminal.manifold import tangent_basis
from manifold_mpc_ros.terminal.problem_of import terminal_design

SYMMETRIC: dict[str, Any] = {'forcing': 'symmetric', 'target': 'pointing'}
# What ends the set in each of them.
CASES: dict[str, tuple[str, dict[str, Any]]] = {
    'free': ('step', SYMMETRIC),
    'limited': ('rate', {**LIMITS, **SYMMETRIC}),
    'limited_paper': ('rate', {**LIMITS, 'target': 'pointing'}),
    'off_diagonal': ('torque', {
        **LIMITS, **SYMMETRIC, 'inertia_kg_m2': INERTIAS['off_diagonal'], 'step_s': 0.25,
        'pointing_axis_B': [1.0, -2.0, 0.7]}),
    'tight': ('decrease', {**LIMITS, **SYMMETRIC, 'terminal_scale': 0.99}),
}
in_cases = pytest.mark.parametrize('case', sorted(CASES))
SAMPLES = 10000


@functools.cache
def designed(case: str) -> tuple[AttitudeMpcConfig, TerminalDesign]:
    """Return configuration and design of a case, made once."""
    config = configuration(**CASES[case][1])
    return config, terminal_design(config)


def on_level(P: Array, level: Array, directions: Array) -> Array:
    """Return states (n, 5) with xi^T P xi = level along whitened unit directions (n, 5)."""
    return np.sqrt(level)[:, None] * directions @ np.linalg.inv(np.linalg.cholesky(P))


def unit(n: int) -> Array:
    """Return n directions (n, 5)."""
    v = generator('five').standard_normal((n, 5))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def bodies(config: AttitudeMpcConfig, xi: Array) -> tuple[Array, Array]:
    """Return attitudes of chart states with any roll, and rates."""
    h, J, axis = config.step_s, config.inertia_kg_m2, config.pointing_axis_B
    roll = generator('roll').uniform(-np.pi, np.pi, len(xi))
    R = so3.exp(roll[:, None] * axis) @ so3.exp(xi[:, :2] @ tangent_basis(axis).T)
    momentum = legendre(so3.cayley_inverse(so3.exp(h * xi[:, 2:])), J) / h
    return R, momentum @ np.linalg.inv(J)


def chart(config: AttitudeMpcConfig, R: Array, omega: Array) -> Array:
    """Return ``(E^T x, Log f / h)`` of bodies: the angle from b to Gamma, along Gamma x b."""
    axis = config.pointing_axis_B
    seen = np.einsum('nji,j->ni', R, axis)
    across = np.cross(seen, axis)
    sine = np.linalg.norm(across, axis=1)
    x = np.arctan2(sine, seen @ axis)[:, None] * across / np.maximum(sine, 1e-300)[:, None]
    f = step_rotation(omega, config.inertia_kg_m2, config.step_s)
    return np.hstack([x @ tangent_basis(axis), so3.log(f) / config.step_s])


def stage_cost(config: AttitudeMpcConfig, R: Array, omega: Array, tau: Array) -> Array:
    """Return ``w (1 - b . Gamma) + tr(Qf (I - f)) / h^2 + tau^T (tr(R) I - R) tau / 2``."""
    axis, h = config.pointing_axis_B, config.step_s
    off = np.einsum('nji,j->ni', R, axis) - axis
    f = step_rotation(omega, config.inertia_kg_m2, h)
    rates = np.einsum('ij,nij->n', config.rate_weight, np.eye(3) - f) / h**2
    weight = np.trace(config.torque_weight) * np.eye(3) - config.torque_weight
    return (config.pointing_weight * np.sum(off * off, axis=1) / 2 + rates
            + np.einsum('ni,ij,nj->n', tau, weight, tau) / 2)


def outcome(config: AttitudeMpcConfig, d: TerminalDesign, xi: Array) -> tuple[Array, ...]:
    """Return torques, rates, levels of xi+ and ``(F(xi+) - F(xi) + L) / L`` of chart states."""
    R, omega = bodies(config, xi)
    tau = xi @ d.K.T
    after = lgvi_step(R, omega, tau, inertia_kg_m2=config.inertia_kg_m2, step_s=config.step_s,
                      forcing='paper' if config.forcing == 'paper' else 'symmetric')
    following = chart(config, *after)
    level = np.einsum('ni,ij,nj->n', following, d.P, following)
    before = np.einsum('ni,ij,nj->n', xi, d.P, xi)
    paid = stage_cost(config, R, omega, tau)
    return tau, omega, level, (level / 2 - before / 2 + paid) / paid


def limit(box: Array | None) -> Array:
    """Return a box (3,), infinite where there is none."""
    return np.full(3, np.inf) if box is None else box


@in_cases
def test_the_chart_of_the_states_drawn(case: str) -> None:
    config, design = designed(case)
    xi = on_level(design.P, np.full(500, design.c), unit(500))
    assert np.abs(chart(config, *bodies(config, xi)) - xi).max() < 1e-11 / config.step_s


@in_cases
def test_the_three_conditions_hold_in_the_set(case: str) -> None:
    config, design = designed(case)
    assert design.report.limiting == CASES[case][0]
    fraction = np.concatenate([np.ones(SAMPLES // 2), np.logspace(-6, 0, SAMPLES // 2)])
    xi = on_level(design.P, fraction * design.c, unit(SAMPLES))
    torque, rate, level, decrease = outcome(config, design, xi)
    assert (np.abs(torque) <= limit(config.max_torque_n_m)).all()
    assert (np.abs(rate) <= limit(config.max_rate_rad_s)).all()
    assert level.max() <= design.c
    assert decrease.max() <= 0
    assert design.report.worst_decrease == pytest.approx(decrease.max(), abs=0.3)


@pytest.mark.parametrize('case', ['limited', 'tight'])
def test_beyond_the_set_what_ends_it_breaks(case: str) -> None:
    """1 % beyond the edge, which is 2 % beyond c, climbing finds the violation."""
    config, design = designed(case)
    limiting = CASES[case][0]

    def violation(xi: Array) -> Array:
        _, rate, _, decrease = outcome(config, design, xi)
        return decrease if limiting == 'decrease' else np.max(
            np.abs(rate) / limit(config.max_rate_rad_s), axis=1) - 1

    for level, broken in ((1.01 * design.report.limits[limiting], True), (design.c, False)):
        rng, best = generator('climb'), unit(4000)
        for reach in np.geomspace(0.5, 0.005, 25):
            values = violation(on_level(design.P, np.full(len(best), level), best))
            top = best[np.argsort(values)[-4:]]
            near = np.repeat(top, 40, axis=0) + reach * rng.standard_normal((160, 5))
            best = np.vstack([top, near / np.linalg.norm(near, axis=1, keepdims=True)])
        worst = violation(on_level(design.P, np.full(len(best), level), best)).max()
        assert (worst > 0) == broken
