# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The stage cost is the formula's, near the target too, and the solver agrees with it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from strategies import INERTIAS, generator, rates

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.lgvi import step_rotation
from manifold_mpc_ros.lab.reference.stage_cost import direction_B, stage_costs
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

POINTING = {'target': 'pointing', 'pointing_axis_B': (0.6, 0.0, 0.8), 'pointing_weight': 3.0}


def config(**changed: Any) -> AttitudeMpcConfig:
    values: dict[str, Any] = {
        'inertia_kg_m2': INERTIAS['off_diagonal'], 'step_s': 0.5, 'horizon': 5,
        'attitude_weight': (1.0, 2.0, 1.5), 'rate_weight': (0.3, 0.4, 0.6),
        'torque_weight': (2.0, 1.0, 3.0)}
    return AttitudeMpcConfig(**{**values, **changed})


@pytest.mark.parametrize('target', [{}, POINTING])
def test_it_is_the_formula(target: dict[str, Any]) -> None:
    problem, rng = config(**target), generator('stage cost')
    R, omega = so3.random_rotations(rng, 50), rates(rng, 50, 0.5)
    tau = rng.normal(size=(50, 3))
    for found, g, w, t in zip(stage_costs(problem, R, omega, tau), R, omega, tau, strict=True):
        f, u = step_rotation(w, problem.inertia_kg_m2, 0.5), so3.hat(t)
        error = np.trace(problem.attitude_weight @ (np.eye(3) - g))
        if problem.target == 'pointing':
            axis = problem.pointing_axis_B
            error = 3.0 * (1.0 - axis @ g.T @ axis)
        assert found == pytest.approx(
            error + np.trace(problem.rate_weight @ (np.eye(3) - f)) / 0.25
            + np.trace(u.T @ problem.torque_weight @ u) / 2, rel=1e-13)


def test_near_the_target_it_is_the_quadratic_form() -> None:
    rng, size = generator('near'), 1e-5
    phi, tau = size * rng.normal(size=(20, 3)), size * rng.normal(size=(20, 3))
    for problem in (config(), config(**POINTING)):
        weights = [np.trace(Q) * np.eye(3) - Q
                   for Q in (problem.error_weight, problem.torque_weight)]
        expected = sum(np.einsum('ni,ij,nj->n', v, W, v) / 2
                       for v, W in zip((phi, tau), weights, strict=True))
        found = stage_costs(problem, so3.exp(phi), np.zeros((20, 3)), tau)
        assert np.allclose(found, expected, rtol=1e-4, atol=0.0)


def test_the_direction_is_the_target_seen_from_the_body() -> None:
    b = np.array([0.6, 0.0, 0.8])
    R = so3.random_rotations(generator('direction'), 10)
    assert np.allclose(direction_B(b, R), [g.T @ b for g in R], rtol=0.0, atol=1e-15)


def test_what_the_solver_promises_is_its_value_less_this_cost() -> None:
    """The solver's own stage cost comes from quaternions and CasADi."""
    problem, rng = config(max_torque_n_m=0.3), generator('promise')
    mpc = AttitudeMpc(problem)
    for R, omega in zip(so3.random_rotations(rng, 3), rates(rng, 3, 0.2), strict=True):
        plan = mpc.solve(R, omega)
        paid = stage_costs(problem, R[None], omega[None], plan.torque_B_n_m[None])[0]
        assert plan.cost - plan.promised_cost == pytest.approx(paid, rel=1e-11)
        mpc.reset()
