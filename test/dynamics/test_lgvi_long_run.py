# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A million free steps of one body: attitude stays a rotation, momentum and energy stay put.

The formulas of `scalar_form`, which `lgvi_step` runs on floats, are compiled into a CasADi
function here, with a fixed number of Newton steps; it is compared with `lgvi_step` first.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np
import pytest
import strategies
from strategies import INERTIAS, Array

from manifold_mpc_ros.dynamics import lgvi, scalar_form
from manifold_mpc_ros.lie import so3

CHUNK = 10_000
MILLION = 1_000_000
NEWTON_STEPS = 5


class Tumble(NamedTuple):
    """Body, start and step of one free run."""

    inertia: Array
    omega: Array
    step_s: float


# The rates keep h |omega| near 0.06 to 0.1 rad; the bodies turn about all of their axes.
TUMBLES = {
    'asymmetric': Tumble(INERTIAS['asymmetric'], np.array([0.3, 0.5, -0.2]), 0.1),
    'off_diagonal': Tumble(INERTIAS['off_diagonal'], np.array([0.1, 1.0, 0.05]), 0.1),
}


def free_steps(tumble: Tumble, n: int) -> ca.Function:
    """Return the map from (R, raw R, omega) to n steps of it, (21, n).

    R is re-normalised in each step as `lgvi_step` does; raw R never is.
    """
    x = ca.SX.sym('x', 21)
    R, raw = (tuple(tuple(x[k + 3 * i + j] for j in range(3)) for i in range(3)) for k in (0, 9))
    omega = (x[18], x[19], x[20])
    J = tuple(tuple(row) for row in tumble.inertia.tolist())
    Pi = scalar_form.apply(J, omega)
    m = tuple(tumble.step_s * entry for entry in Pi)
    c = (0.0, 0.0, 0.0)
    for _ in range(NEWTON_STEPS):
        c = scalar_form.add(c, scalar_form.newton_step(c, m, J))
    G = scalar_form.rotation_increment(c)
    change = scalar_form.solve(J, scalar_form.apply_transposed(G, Pi))
    R = scalar_form.renormalised(scalar_form.add_increment(R, G))
    raw = scalar_form.add_increment(raw, G)
    entries = [e for matrix in (R, raw) for row in matrix for e in row]
    end = ca.vertcat(*entries, *scalar_form.add(omega, change))
    return ca.Function('free_step', [x], [end]).mapaccum(n)


def start(tumble: Tumble) -> Array:
    R = so3.random_rotations(strategies.generator('long run'), 1)[0].ravel()
    return np.concatenate([R, R, tumble.omega])


def run(tumble: Tumble, steps: int) -> Array:
    """Return, for each chunk, the largest figures within it.

    Columns: orthogonality of R, of raw R, change of R Pi, highest and lowest change of the
    energy, the last three relative to the start.
    """
    function, x, J = free_steps(tumble, CHUNK), start(tumble), tumble.inertia
    Pi = lgvi.inertial_momentum(x[:9].reshape(3, 3), tumble.omega, J)
    energy = lgvi.kinetic_energy(tumble.omega, J)
    figures = []
    for _ in range(steps // CHUNK):
        states = function(x).full().T
        R, raw = states[:, :9].reshape(-1, 3, 3), states[:, 9:18].reshape(-1, 3, 3)
        momentum_error = np.linalg.norm(lgvi.inertial_momentum(R, states[:, 18:], J) - Pi, axis=-1)
        energy_error = lgvi.kinetic_energy(states[:, 18:], J) / energy - 1.0
        figures.append([
            orthogonality(R), orthogonality(raw), np.max(momentum_error) / np.linalg.norm(Pi),
            np.max(energy_error), np.min(energy_error),
        ])
        x = states[-1]
    return np.array(figures)


def orthogonality(R: Array) -> float:
    return float(np.max(np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3))))


@pytest.mark.parametrize('name', sorted(TUMBLES))
def test_compiled_free_step_is_lgvi_step(name: str) -> None:
    tumble = TUMBLES[name]
    x = start(tumble)
    states = free_steps(tumble, 1000)(x).full().T
    R, omega = x[:9].reshape(3, 3), tumble.omega
    for state in states:
        R, omega = lgvi.lgvi_step(
            R, omega, np.zeros(3), inertia_kg_m2=tumble.inertia, step_s=tumble.step_s
        )
        assert np.max(np.abs(state[:9] - R.ravel())) < 1e-12
        assert np.max(np.abs(state[18:] - omega)) < 1e-12
    # The body does tumble: its rate is not the one it started with.
    assert np.max(np.abs(states[:, 18:] - tumble.omega)) > 0.1


@pytest.mark.parametrize('name', sorted(TUMBLES))
def test_million_free_steps_keep_rotation_momentum_and_energy(name: str) -> None:
    """Measured: orthogonality 5e-16 (raw 1.3e-13), momentum 1.7e-13, energy 1e-13 relative.

    A free LGVI step conserves the energy exactly, so its error is rounding as well: no
    oscillation to hide a drift in, and the bound holds at every step of the run.
    """
    figures = run(TUMBLES[name], MILLION)
    renormalised, raw, momentum, energy_above, energy_below = figures.T
    assert len(figures) == MILLION // CHUNK
    assert np.max(renormalised) < 4e-15
    assert np.max(raw) < 1e-12
    assert np.max(momentum) < 1e-11
    assert np.max(np.abs([energy_above, energy_below])) < 1e-11


def test_renormalisation_is_there_for_the_steady_spin() -> None:
    """A spin about a principal axis repeats one rounding error: raw R drifts in proportion."""
    drift = []
    for rate in (8.7, 9.0, 9.2):
        spin = Tumble(INERTIAS['asymmetric'], np.array([0.0, 0.0, rate]), 0.1)
        figures = run(spin, 10 * CHUNK)
        assert np.max(figures[:, 0]) < 4e-15
        drift.append(figures[-1, 1])
    assert max(drift) > 1e-12
