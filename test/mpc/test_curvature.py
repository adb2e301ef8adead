# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Gradients and Hessians of a stage against automatic differentiation of what they belong to.

Tangent coordinates z = (d theta_B, d omega_B) of a node, and d u of a torque.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np
import pytest
from cases import configuration
from numpy.typing import NDArray
from strategies import INERTIAS, generator, rates, unit_vectors

from manifold_mpc_ros.dynamics.symbolic import cayley_step, lgvi_step, step_derivative
from manifold_mpc_ros.lie.symbolic import quaternion_product
from manifold_mpc_ros.mpc import curvature, stage
from manifold_mpc_ros.mpc.scaling import Parameters, flat_parameters, unpack

Array = NDArray[np.float64]

in_forcings = pytest.mark.parametrize('symmetric', [False, True], ids=['paper', 'symmetric'])


def parameters(target: str = 'attitude') -> Parameters:
    """Return a dimensionless problem without any symmetry."""
    rng = generator('weights')
    config = configuration(
        inertia_kg_m2=INERTIAS['off_diagonal'], attitude_weight=weight(rng),
        rate_weight=weight(rng), torque_weight=weight(rng), target=target,
        pointing_axis_B=rng.standard_normal(3))
    n = {'attitude': 6, 'pointing': 5}[target]
    root = rng.standard_normal((n, n))
    flat = flat_parameters(config, root @ root.T + np.eye(n), rng.standard_normal((3, n)), 1.0)
    return unpack(ca.SX(flat))


def weight(rng: np.random.Generator) -> Array:
    """Return a positive definite weight (3, 3)."""
    root = rng.standard_normal((3, 3))
    return root @ root.T + 0.5 * np.eye(3)


class Symbols(NamedTuple):
    """Attitude, rate and torque at which to differentiate, multipliers, and the increments."""

    q: ca.SX
    omega: ca.SX
    torque: ca.SX
    multipliers: ca.SX
    z: ca.SX
    u: ca.SX


def symbols() -> Symbols:
    """Return fresh symbols."""
    sizes = {'q': 4, 'omega': 3, 'torque': 3, 'multipliers': 6, 'z': 6, 'u': 3}
    return Symbols(**{name: ca.SX.sym(name, size) for name, size in sizes.items()})


def node(s: Symbols, p: Parameters, z: ca.SX) -> ca.SX:
    """Return the node moved by z; the half angle is exact to third order."""
    turn, omega = z[0:3], s.omega + z[3:6]
    q = quaternion_product(s.q, ca.vertcat(1 - ca.dot(turn, turn) / 8, turn / 2))
    return ca.vertcat(q, omega, cayley_step(p.inertia @ omega, p.inertia, p.inertia_inverse))


def largest_difference(s: Symbols, ours: ca.SX, exact: ca.SX) -> float:
    """Return the largest difference at z = u = 0, over random states and near ends of the Log."""
    function = ca.Function('difference', list(s), [ca.densify(ours - exact), ca.densify(exact)])
    rng, worst = generator('stages'), 0.0
    angles = [1e-9, 1e-5, 1e-3, 0.3, 1.0, 2.0, 3.0, np.pi - 1e-3, np.pi - 1e-9]
    for angle, axis in zip(angles, unit_vectors(rng, len(angles))):
        q = np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis])
        omega, torque = rates(rng, 2, 0.5)[1], rates(rng, 2, 0.3)[1]
        parts = function(q, omega, torque, rng.standard_normal(6), np.zeros(6), np.zeros(3))
        difference, exact_value = (np.array(part) for part in parts)
        assert np.abs(exact_value).max() > 1e-3
        worst = max(worst, float(np.abs(difference).max()))
    return worst


@pytest.mark.parametrize('target', ['attitude', 'pointing'])
def test_gradient_of_the_state_cost(target: str) -> None:
    s, p = symbols(), parameters(target)
    moved = node(s, p, s.z)
    ours = stage.state_cost(moved, stage.free_step_derivative(moved, p), p).gradient
    exact = ca.gradient(stage.state_cost_value(moved, p), s.z)
    assert largest_difference(s, ours, exact) < 1e-13


@pytest.mark.parametrize('target', ['attitude', 'pointing'])
def test_value_and_gradient_of_the_terminal_form(target: str) -> None:
    s, p, pointing = symbols(), parameters(target), target == 'pointing'
    moved = node(s, p, s.z)
    form = stage.terminal_form(moved, stage.free_step_derivative(moved, p), pointing, p)
    xi = stage.terminal_coordinates(moved, pointing, p)
    value = ca.dot(xi, p.terminal_weight @ xi) / 2
    assert largest_difference(s, form.gradient, ca.gradient(value, s.z)) < 1e-13
    total = form.hessian + curvature.terminal_curvature(
        moved, stage.free_step_derivative(moved, p), p.terminal_weight @ xi, pointing, p)
    assert largest_difference(s, total, ca.hessian(value, s.z)[0]) < 1e-12


@in_forcings
def test_exact_hessian_of_a_stage(symmetric: bool) -> None:
    """Of state cost plus multipliers times the next node, in (d theta, d omega, d u)."""
    s, p = symbols(), parameters()

    def following(z: ca.SX, u: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        q, omega, _ = stage.split_node(node(s, p, z))
        step = lgvi_step(q, omega, s.torque + u, p.inertia, p.inertia_inverse, ca.SX(1),
                         symmetric)
        return ca.vertcat(step.quaternion, step.omega), step.cayley, step.momentum

    start, cayley, momentum = following(ca.SX.zeros(6), ca.SX.zeros(3))
    change = stage.tangent_difference(following(s.z, s.u)[0], start)
    value = stage.state_cost_value(node(s, p, s.z), p) + ca.dot(s.multipliers, change)
    exact = ca.hessian(value, ca.vertcat(s.z, s.u))[0]
    here = node(s, p, ca.SX.zeros(6))
    blocks = curvature.stage_curvature(
        here, cayley, stage.free_step_derivative(here, p),
        step_derivative(cayley, momentum, p.inertia), s.multipliers, p, symmetric)
    ours = ca.vertcat(ca.horzcat(blocks.state, blocks.cross.T),
                      ca.horzcat(blocks.cross, blocks.torque))
    assert largest_difference(s, ours, exact) < 1e-11


def test_gauss_newton_hessians_are_positive_and_exact_at_the_target() -> None:
    """tr(S) I - S, S = g^T Qg g; at g = f = I it is the exact Hessian."""
    s, p = symbols(), parameters()
    moved = node(s, p, s.z)
    ours = stage.state_cost(moved, stage.free_step_derivative(moved, p), p).hessian
    exact = ca.hessian(stage.state_cost_value(moved, p), s.z)[0]
    function = ca.Function('hessians', [s.q, s.omega, s.z], [ours, exact])
    both = function([1, 0, 0, 0], np.zeros(3), np.zeros(6))
    assert np.abs(np.array(both[0] - both[1])).max() < 1e-12
    half_turn = function([0, 0.6, 0, 0.8], [0.3, -0.2, 0.1], np.zeros(6))
    assert np.linalg.eigvalsh(np.array(half_turn[0]))[0] > 0.01
    assert np.linalg.eigvalsh(np.array(half_turn[1]))[0] < -0.01
