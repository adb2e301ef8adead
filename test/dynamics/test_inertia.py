# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The existence guard: what is said to exist does, and what is refused is beyond it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import PROPERTY
from strategies import unit_vectors

from manifold_mpc_ros.dynamics import lgvi
from manifold_mpc_ros.dynamics.inertia import (
    existence_guard,
    free_steps_exist,
    largest_guaranteed_rate,
    nonstandard_inertia,
    principal_moments,
)
from manifold_mpc_ros.errors import StepExistenceError
from manifold_mpc_ros.lie import so3

MOMENTS = np.array([0.6, 0.9, 1.0])


@PROPERTY
@given(seed=st.integers(0, 2**32 - 1), step_s=st.floats(0.01, 10.0))
def test_a_free_step_exists_exactly_below_the_guard(seed: int, step_s: float) -> None:
    rng = np.random.default_rng(seed)
    R = so3.random_rotations(rng, 1)[0]
    J = R @ np.diag(MOMENTS) @ R.T
    np.testing.assert_allclose(principal_moments(J), MOMENTS, rtol=1e-12)
    assert existence_guard(J) == pytest.approx(0.6)
    direction = unit_vectors(rng, 1)[0]
    omega = np.linalg.solve(J, direction) * 0.6 / step_s
    assert free_steps_exist([0.999 * omega, 1.001 * omega], J, step_s).tolist() == [True, False]
    lgvi.step_rotation(0.999 * omega, J, step_s)
    with pytest.raises(StepExistenceError):
        lgvi.step_rotation(1.001 * omega, J, step_s)
    assert free_steps_exist(0.999 * largest_guaranteed_rate(J, step_s) * direction, J, step_s)
    fastest = 1.001 * largest_guaranteed_rate(J, step_s) * R[:, 2]
    assert not free_steps_exist(fastest, J, step_s)


def test_rates_that_are_no_numbers_have_no_step() -> None:
    J = np.diag(MOMENTS)
    rates = [[np.nan, 0.0, 0.0], [np.inf, 0.0, 0.0], [0.0, 0.0, 0.0]]
    assert free_steps_exist(rates, J, 0.5).tolist() == [False, False, True]
    np.testing.assert_allclose(principal_moments(nonstandard_inertia(J)), [0.25, 0.35, 0.65])
