# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rate ellipsoid holds where it is given and would be broken without; energy limits too."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cases import CERTIFIED, LIMITED, configuration, random_states, rest_states
from reference import closed_loop

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.rate_limits import RateBox, RateEllipsoid, rates_beyond
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.solution import SolveStatus

Make = Callable[..., AttitudeMpc]
ELLIPSOID = np.array([[9.0, 1.0, 0.0], [1.0, 8.0, -0.5], [0.0, -0.5, 10.0]])
# J. Guid. Control Dyn. G007456: inertia [kg m^2] and energy limit omega^T Je omega <= 5.0917e-5 J.
B1_INERTIA = np.diag([0.167174901, 0.125963211, 0.0612346508])
B1_ELLIPSOID_S2 = np.diag([0.16715194, 0.12594025, 0.06121169]) / 5.0917e-5


def b1(**changes: Any) -> AttitudeMpcConfig:
    """Return the public problem's body and energy limit, with torques inside its wheels'."""
    values: dict[str, Any] = {
        'inertia_kg_m2': B1_INERTIA, 'step_s': 2.0, 'horizon': 60, 'attitude_weight': np.eye(3),
        'rate_weight': 20.0 * np.eye(3), 'torque_weight': 1e6 * np.eye(3),
        'max_torque_n_m': 5e-4, 'rate_ellipsoid_s2': B1_ELLIPSOID_S2,
        'terminal_constraint': False}
    return AttitudeMpcConfig(**{**values, **changes})


def largest_form(plan_rates: np.ndarray, E: np.ndarray) -> float:
    """Return the largest omega^T E omega over rates (n, 3)."""
    return float(np.einsum('ni,ij,nj->n', plan_rates, E, plan_rates).max())


@pytest.mark.parametrize('forcing', ['paper', 'symmetric'])
def test_plans_keep_it_and_would_break_it(controller: Make, forcing: str) -> None:
    limited = controller(**LIMITED, forcing=forcing, rate_ellipsoid_s2=ELLIPSOID)
    free = controller(**LIMITED, forcing=forcing)
    for R, omega in [*rest_states(2), *random_states('ellipsoid', 3, 0.1)]:
        limited.reset()
        free.reset()
        plan, without = limited.solve(R, omega), free.solve(R, omega)
        assert plan.status == SolveStatus.CONVERGED
        assert largest_form(plan.omega_BN_B[1:], ELLIPSOID) <= 1 + 1e-6
        assert largest_form(without.omega_BN_B[1:], ELLIPSOID) > 1.05
        assert plan.cost >= without.cost * (1 - 1e-9)


def test_a_wide_ellipsoid_changes_nothing_but_rounding(controller: Make) -> None:
    wide, free = controller(**LIMITED, rate_ellipsoid_s2=ELLIPSOID / 100), controller(**LIMITED)
    for R, omega in random_states('wide ellipsoid', 3, 0.1):
        wide.reset()
        free.reset()
        np.testing.assert_allclose(wide.solve(R, omega).cost, free.solve(R, omega).cost,
                                   rtol=1e-7)


def test_norm_and_energy_are_ellipsoids(controller: Make) -> None:
    """A limit given as a norm or as an energy gives the plan of its ellipsoid."""
    J = np.diag([1.0, 0.9, 0.6])
    R, omega = rest_states(1)[-1]
    for named, E in (({'max_rate_norm_rad_s': 0.35}, np.eye(3) / 0.35 ** 2),
                     ({'max_kinetic_energy_j': 0.04}, J / 0.08)):
        one = controller(**LIMITED, **named).solve(R, omega)
        other = controller(**LIMITED, rate_ellipsoid_s2=E).solve(R, omega)
        np.testing.assert_allclose(one.torques_B_n_m, other.torques_B_n_m, atol=1e-9)


def test_the_public_energy_limit_is_kept_in_closed_loops() -> None:
    """At every node of the loop and of every plan: omega^T E omega at most 1 + 1e-6."""
    mpc = AttitudeMpc(b1())
    for R, omega in [*rest_states(1), *((so3.exp(v), np.zeros(3)) for v in (
            np.array([0.0, 0.0, 1.6]), np.array([1.2, -1.0, 0.9])))]:
        mpc.reset()
        ticks = closed_loop(mpc, R, omega, 60)
        measured = np.array([tick.plan.omega_BN_B[0] for tick in ticks])
        assert largest_form(measured, B1_ELLIPSOID_S2) <= 1 + 1e-6
        assert largest_form(measured, B1_ELLIPSOID_S2) > 0.9  # the limit is active
        for tick in ticks:
            assert tick.plan.status == SolveStatus.CONVERGED
            assert largest_form(tick.plan.omega_BN_B[1:], B1_ELLIPSOID_S2) <= 1 + 1e-6


def test_the_terminal_set_is_cut_by_it(controller: Make) -> None:
    """The design stops at the ellipsoid, and every sampled rate of the set keeps it."""
    tight = configuration(**CERTIFIED, rate_ellipsoid_s2=100 * ELLIPSOID)
    terminal = AttitudeMpc(tight).terminal
    assert terminal.report.limiting == 'rate ellipsoid'
    assert terminal.c < controller(**CERTIFIED).terminal.c
    root = np.linalg.cholesky(np.linalg.inv(terminal.P))
    unit = np.random.default_rng(1).normal(size=(2000, 6))
    states = np.sqrt(terminal.c) * unit / np.linalg.norm(unit, axis=1, keepdims=True) @ root.T
    # the chart's rate is Log f / h, which differs from omega in the third order of the step
    assert largest_form(states[:, 3:], 100 * ELLIPSOID) <= 1.01


def test_numbers_of_the_limits_agree_with_brute_force() -> None:
    rng = np.random.default_rng(2)
    J = np.array([[1.0, 0.1, 0.0], [0.1, 0.9, 0.05], [0.0, 0.05, 0.6]])
    limit = RateEllipsoid(ELLIPSOID)
    unit = rng.normal(size=(200_000, 3))
    form = np.einsum('ni,ij,nj->n', unit, ELLIPSOID, unit)
    edge = unit / np.sqrt(form)[:, None]
    assert np.linalg.norm(edge, axis=1).max() == pytest.approx(limit.largest_rate_rad_s, rel=1e-3)
    assert np.linalg.norm(edge @ J, axis=1).max() == pytest.approx(
        limit.largest_momentum_n_m_s(J), rel=1e-3)
    assert (np.einsum('ni,ij,nj->n', edge, J, edge) / 2).min() == pytest.approx(
        limit.largest_energy_j(J), rel=1e-3)
    assert not rates_beyond([limit, RateBox(np.array([1.0, np.inf, 1.0]))], edge, 1e-9).any()
    assert rates_beyond([limit], 1.01 * edge, 1e-3).all()


@pytest.mark.parametrize(('changes', 'key'), [
    ({'rate_ellipsoid_s2': np.diag([1.0, 1.0, 0.0])}, 'rate_ellipsoid_s2'),
    ({'rate_ellipsoid_s2': np.diag([1.0, 1.0, -1.0])}, 'rate_ellipsoid_s2'),
    ({'rate_ellipsoid_s2': np.ones((2, 2))}, 'rate_ellipsoid_s2'),
    ({'max_rate_norm_rad_s': 0.0}, 'max_rate_norm_rad_s'),
    ({'max_kinetic_energy_j': float('nan')}, 'max_kinetic_energy_j'),
    ({'max_rate_rad_s': None, 'max_rate_norm_rad_s': 4.0}, 'max_rate_norm_rad_s'),
])
def test_what_is_no_limit_is_named(changes: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigurationError, match=f'^{key}: '):
        configuration(**{**LIMITED, **changes})
