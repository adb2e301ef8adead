# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The terminal design of the double integrator is the textbook's linear-quadratic regulator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from manifold_mpc_ros.lab.certification.double_integrator import double_integrator_problem
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.design import design_terminal

WEIGHTS = ((1.0, 1.0, 1.0), (1.0, 0.1, 0.2), (4.0, 2.0, 30.0), (0.3, 5.0, 0.01))


def gain_by_spectral_factors(h: float, q: tuple[float, float], r: float) -> Array:
    """Return the gain (2,) from the stable roots of the symmetric root locus.

    With G(z) = (h^2 (z + 1) / (2 (z - 1)^2), h / (z - 1)) the loop's poles are the stable roots
    of ``r + q_1 G_1(z) G_1(1/z) + q_2 G_2(z) G_2(1/z)``; times (z - 1)^2 (1/z - 1)^2 z^2 it is a
    polynomial. No Riccati equation enters.
    """
    minus = np.array([-1.0, 2.0, -1.0])  # z (z - 1) (1/z - 1)
    plus = np.array([1.0, 2.0, 1.0])     # z (z + 1) (1/z + 1)
    polynomial = (r * np.convolve(minus, minus)
                  + q[0] * h**4 / 4 * np.append(np.insert(plus, 0, 0.0), 0.0)
                  + q[1] * h**2 * np.append(np.insert(minus, 0, 0.0), 0.0))
    roots = np.roots(polynomial)
    stable = roots[np.abs(roots) < 1]
    assert len(stable) == 2
    total, product = np.sum(stable).real, np.prod(stable).real
    # z^2 - (2 + h k_2 + h^2 k_1 / 2) z + 1 + h k_2 - h^2 k_1 / 2 is that of A + B k.
    return np.array([(total - 1 - product) / h**2, (total + product - 3) / (2 * h)])


@pytest.mark.parametrize('step_s', [0.1, 0.5, 2.0])
@pytest.mark.parametrize('weights', WEIGHTS)
def test_the_gain_is_the_textbook_s(step_s: float, weights: tuple[float, float, float]) -> None:
    problem = double_integrator_problem(
        step_s=step_s, position_weight=weights[0], velocity_weight=weights[1],
        input_weight=weights[2], terminal_scale=0.6)
    design = design_terminal(problem)
    A, B = np.array([[1.0, step_s], [0.0, 1.0]]), np.array([[step_s**2 / 2], [step_s]])
    assert np.abs(design.A - A).max() < 1e-15
    assert np.abs(design.B - B).max() < 1e-15
    P = solve_discrete_are(A, B, np.diag(weights[:2]) / 0.6, np.array([[weights[2] / 0.6]]))
    assert np.abs(design.P - P).max() < 1e-9 * np.abs(P).max()
    gain = gain_by_spectral_factors(step_s, weights[:2], weights[2])
    assert design.K[0] == pytest.approx(gain, rel=1e-8)


def test_lambda_scales_the_cost_and_not_the_law() -> None:
    """P / lambda: with lambda near 1, F is the cost to go of the regulator itself."""
    half, most = (design_terminal(double_integrator_problem(terminal_scale=scale))
                  for scale in (0.5, 0.999))
    assert np.abs(half.K - most.K).max() < 1e-12
    assert np.abs(half.P * 0.5 - most.P * 0.999).max() < 1e-12 * np.abs(half.P).max()


def test_the_terminal_set_is_the_largest_ellipse_between_the_limits() -> None:
    """On R^n nothing else ends it: (8c) holds everywhere with the ratio 1 - 1 / lambda."""
    design = design_terminal(double_integrator_problem(
        terminal_scale=0.6, max_input=0.4, max_velocity=0.8))
    covariance = np.linalg.inv(design.P)
    by_input = 0.16 / (design.K @ covariance @ design.K.T).item()
    by_velocity = 0.64 / covariance[1, 1]
    assert design.c == pytest.approx(0.99 * min(by_input, by_velocity), rel=1e-6)
    assert design.report.worst_decrease == pytest.approx(1 - 1 / 0.6)
    slow = design_terminal(double_integrator_problem(max_input=4.0, max_velocity=0.05))
    assert slow.report.limiting == 'velocity'
    covariance = np.linalg.inv(slow.P)
    assert slow.c == pytest.approx(0.99 * 0.0025 / covariance[1, 1], rel=1e-6)
