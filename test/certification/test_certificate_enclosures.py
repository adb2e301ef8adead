# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ball arithmetic holds what it must: coefficient functions, jets, definiteness, plane bounds."""

from __future__ import annotations

from collections.abc import Callable
from math import acos, atan, cos, pi, sin, sqrt

import numpy as np
import pytest
from flint import arb, arb_mat
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import generator

from manifold_mpc_ros.dynamics import scalar_form
from manifold_mpc_ros.lab.certification import even_functions as functions
from manifold_mpc_ros.lab.certification.box_test import concave_bound
from manifold_mpc_ros.lab.certification.enclosure import definiteness, exact, upper
from manifold_mpc_ros.lab.certification.jets import Jet, chain, coordinates, root, squared_norm

Function = Callable[[Jet], Jet]
Plain = Callable[[float], float]


def half_sine(s: float) -> float:
    return sin(sqrt(s) / 2) / sqrt(s) if s > 1e-12 else 0.5


def angle_over_sine(w: float) -> float:
    return 2 * acos(w) / sqrt(1 - w * w) if abs(w) < 1 - 1e-12 else 2.0


def double_arctangent(q: float) -> float:
    return 2 * atan(sqrt(q)) / sqrt(q) if q > 1e-12 else 2.0


# Function, the same in floats, and the range of its argument.
CASES: dict[str, tuple[Function, Plain, float, float]] = {
    'half_sine': (functions.half_sine, half_sine, 0.0, 39.0),
    'half_cosine': (functions.half_cosine, lambda s: cos(sqrt(s) / 2), 0.0, 39.0),
    'angle_over_sine': (functions.angle_over_sine, angle_over_sine, -0.8, 1.0),
    'double_arctangent': (functions.double_arctangent, double_arctangent, 0.0, 1.0),
    'inverse_root': (functions.inverse_root, lambda q: 1 / sqrt(1 + q), 0.0, 3.0),
    'root_of_half': (functions.root_of_half, lambda u: sqrt((1 + u) / 2), -0.9, 1.0),
}


def widened(ball: arb, tolerance: float) -> arb:
    return ball + arb(0, tolerance)


@pytest.mark.parametrize('name', CASES)
@pytest.mark.parametrize('width', [0.0, 1e-9, 1e-3, 0.3, 1.0])
def test_coefficient_functions_and_their_derivatives(name: str, width: float) -> None:
    function, plain, low, high = CASES[name]
    rng = generator(name, width)
    span = high - low
    for start in [low, high - width * span, *rng.uniform(low, high - width * span, 12)]:
        end = min(start + width * span, high)
        jet = function(coordinates([arb(start).union(arb(end))])[0])
        for x in np.linspace(start, end, 7):
            step = 1e-3 * span
            if not low + 2 * step < x < high - 2 * step:
                assert widened(jet.value, 1e-9).contains(plain(x))
                continue
            before, at, after = (plain(x + k * step) for k in (-1, 0, 1))
            # Differences of fourth order: what is left is below the tolerance.
            far = plain(x + 2 * step) - plain(x - 2 * step)
            first = (8 * (after - before) - far) / (12 * step)
            scale = abs(upper(abs(jet.gradient[0, 0]))) + abs(upper(abs(jet.hessian[0, 0])))
            assert widened(jet.value, 1e-12).contains(at)
            assert widened(jet.gradient[0, 0], 1e-4 * scale).contains(first)
            assert widened(jet.hessian[0, 0], 3e-2 * scale).contains(
                (after - 2 * at + before) / step ** 2)


def test_wide_arguments_cost_nothing_but_width() -> None:
    jet = functions.half_sine(coordinates([arb(0).union(arb(1))])[0])
    assert abs(upper(jet.value) - 0.5) < 1e-9
    assert abs(float(jet.value.lower()) - sin(0.5)) < 1e-8


def test_outside_of_their_range_they_say_nothing() -> None:
    assert not functions.half_sine(coordinates([arb(45, 1)])[0]).value.is_finite()
    assert not functions.angle_over_sine(coordinates([arb(-1, 0.1)])[0]).value.is_finite()


def test_past_180_degrees_the_logarithm_is_continued() -> None:
    w = cos((pi + 0.2) / 2)
    jet = functions.angle_over_sine(coordinates([arb(w)])[0])
    assert widened(jet.value, 1e-12).contains((pi + 0.2) / sin((pi + 0.2) / 2))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2 ** 32 - 1), st.sampled_from([0.0, 1e-9, 1e-2, 0.3]))
def test_jets_hold_value_gradient_and_hessian(seed: int, radius: float) -> None:
    rng = np.random.default_rng(seed)
    centre = rng.uniform(0.5, 1.5, 3)
    inertia = ((1.0, 0.1, 0.0), (0.1, 0.9, 0.2), (0.0, 0.2, 0.6))

    def formula(x: list) -> list:
        m = scalar_form.momentum_from_cayley(tuple(x), inertia)
        return [m[0] * m[1] - 2 / m[2], 1 - m[0] / (3 + m[1] * m[1]) + 0.5 * x[2]]

    jets = formula(coordinates([arb(c, radius) for c in centre.tolist()]))
    point = centre + radius * rng.uniform(-1, 1, 3)
    for jet, thin in zip(jets, formula(coordinates([arb(x) for x in point.tolist()]))):
        pairs = [(jet.value, thin.value), *zip(jet.gradient.entries(), thin.gradient.entries()),
                 *zip(jet.hessian.entries(), thin.hessian.entries())]
        assert all(wide.overlaps(narrow) for wide, narrow in pairs)
    # The thin jets are right: central differences of the same formula in floats.
    step = 1e-5
    for i in range(3):
        moved = [formula((point + sign * step * np.eye(3)[i]).tolist()) for sign in (1, -1)]
        slopes = formula(coordinates([arb(x) for x in point.tolist()]))
        for j, jet in enumerate(slopes):
            assert float(jet.gradient[0, i].mid()) == pytest.approx(
                (moved[0][j] - moved[1][j]) / (2 * step), rel=1e-6, abs=1e-6)


def test_chain_is_composition() -> None:
    x = coordinates([arb(0.3), arb(-0.2), arb(0.5)])
    inner = [squared_norm(x), x[0] * x[1]]
    outer = coordinates([jet.value for jet in inner])
    composed, direct = chain(outer[0] * outer[1] / (1 + outer[0]), inner), (
        inner[0] * inner[1] / (1 + inner[0]))
    for one, other in ((composed.gradient, direct.gradient), (composed.hessian, direct.hessian)):
        assert max(float(abs(e).upper()) for e in (one - other).entries()) < 1e-14


def test_root_of_a_ball_that_reaches_below_zero() -> None:
    assert root(arb(0.25)).contains(0.5)
    wide = root(arb(0.0, 1.0))
    assert wide.is_finite()
    assert wide.contains(0.0)
    assert wide.contains(1.0)


@pytest.mark.parametrize('seed', range(20))
def test_definiteness_is_never_claimed_wrongly(seed: int) -> None:
    rng = generator('definite', seed)
    vectors = np.linalg.qr(rng.normal(size=(5, 5)))[0]
    values = np.array([rng.choice([-1e-6, 1e-6]), *rng.uniform(0.1, 3.0, 4)])
    matrix = (vectors * values) @ vectors.T
    matrix = (matrix + matrix.T) / 2
    assert (definiteness(exact(matrix)) > 0) == (values[0] > 0)
    spread = arb_mat(5, 5, [arb(0, 1e-5)] * 25)
    assert not definiteness(exact(matrix) + spread) > 0


@pytest.mark.parametrize('seed', range(20))
def test_the_bound_of_a_concave_function_is_one_and_is_tight(seed: int) -> None:
    rng = generator('concave', seed)
    n = 4
    root_matrix = rng.normal(size=(n, n))
    hessian = -(root_matrix @ root_matrix.T + 0.1 * np.eye(n))
    hessian = (hessian + hessian.T) / 2
    gradient, radius = rng.normal(size=n), rng.uniform(0.1, 2.0, n)
    bound = upper(concave_bound(arb(0.7), exact(gradient).transpose(), hessian, radius))
    points = radius * rng.uniform(-1, 1, size=(20_000, n))
    points[:4000] = np.sign(points[:4000]) * radius
    values = 0.7 + points @ gradient + np.einsum('ki,ij,kj->k', points, hessian, points) / 2
    assert values.max() <= bound
    assert bound <= values.max() + 0.3 * (1 + abs(values.max()))
