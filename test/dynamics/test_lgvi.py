# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The LGVI update against the equations and the symmetries that define it."""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import INERTIAS, Array

from manifold_mpc_ros.dynamics import inertia, lgvi
from manifold_mpc_ros.errors import ConfigurationError, StepExistenceError
from manifold_mpc_ros.lie import so3

in_inertias = pytest.mark.parametrize('name', sorted(INERTIAS))
replayable = settings(derandomize=True, deadline=None, max_examples=150)


def transpose(a: Array) -> Array:
    return np.swapaxes(a, -1, -2)


def largest(difference: Array) -> float:
    return float(np.max(np.abs(difference)))


def test_guard_of_a_step_counts_half_the_torque_with_symmetric_forcing_only() -> None:
    J, h = INERTIAS['symmetric'], 0.5
    omega, tau = np.array([0.0, 0.0, 1.5]), np.array([0.0, 0.0, 1.7])
    arguments = (np.eye(3), omega, tau)
    lgvi.lgvi_step(*arguments, inertia_kg_m2=J, step_s=h, forcing='paper')
    with pytest.raises(StepExistenceError):
        lgvi.lgvi_step(*arguments, inertia_kg_m2=J, step_s=h, forcing='symmetric')


def random_states(key: str, J: Array, n: int, h: float) -> tuple[Array, Array, Array]:
    """Return n attitudes, rates and torques with |h Pi + h^2/2 tau| below 0.6 of the guard."""
    rng = strategies.generator(key)
    bound = np.linalg.eigvalsh(J)[0]
    omega = np.linalg.solve(J, strategies.rates(rng, n, 0.4 * bound / h)[..., None])[..., 0]
    tau = strategies.rates(rng, n, 0.4 * bound / h**2)
    return so3.random_rotations(rng, n), omega, tau


@in_inertias
def test_paper_forcing_satisfies_equation_one_of_the_paper(name: str) -> None:
    """Check f' J_d - J_d f'^T = J_d f - f^T J_d + h^2 tau^x, with g' = g f."""
    J, h = INERTIAS[name], 0.2
    g, omega, tau = random_states(name, J, 100, h)
    f = lgvi.step_rotation(omega, J, h)
    g1, omega1 = lgvi.lgvi_step(g, omega, tau, inertia_kg_m2=J, step_s=h, forcing='paper')
    assert largest(g1 - g @ f) < 2e-15
    J_d = inertia.nonstandard_inertia(J)
    m1 = so3.vee(J_d @ f - transpose(f) @ J_d) + h**2 * tau
    assert largest(h * (J @ omega1[..., None])[..., 0] - m1) < 4e-15 * largest(J)


@in_inertias
def test_symmetric_forcing_is_its_equations(name: str) -> None:
    J, h = INERTIAS[name], 0.2
    R, omega, tau = random_states(name, J, 100, h)
    p = (J @ omega[..., None])[..., 0] + 0.5 * h * tau
    f = so3.cayley(lgvi.cayley_step(h * p, J))
    R1, omega1 = lgvi.lgvi_step(R, omega, tau, inertia_kg_m2=J, step_s=h)
    Pi1 = (transpose(f) @ p[..., None])[..., 0] + 0.5 * h * tau
    assert largest(R1 - R @ f) < 2e-15
    assert largest((J @ omega1[..., None])[..., 0] - Pi1) < 1e-14 * largest(J) / h


def test_step_renormalises_the_attitude() -> None:
    """An orthogonality error e of the attitude is 3/4 e^2 after one step, and its turn is kept."""
    J, h = INERTIAS['off_diagonal'], 0.2
    R, omega, tau = random_states('renormalise', J, 100, h)
    stretch = np.diag([1.0 + 1e-6, 1.0, 1.0 - 1e-6])
    R1, omega1 = lgvi.lgvi_step(R @ stretch, omega, tau, inertia_kg_m2=J, step_s=h)
    expected, expected_omega = lgvi.lgvi_step(R, omega, tau, inertia_kg_m2=J, step_s=h)
    assert so3.is_rotation(R1, 1e-11)
    assert largest(R1 - expected) < 1e-11
    assert np.array_equal(omega1, expected_omega)


@in_inertias
def test_symmetric_forcing_is_reversible_and_the_paper_s_is_not(name: str) -> None:
    """A step, the rate reversed, and the same torque again lead back to the start."""
    J, h = INERTIAS[name], 0.2
    R, omega, tau = random_states(name, J, 100, h)
    back = {}
    for forcing in ('symmetric', 'paper'):
        R1, omega1 = lgvi.lgvi_step(R, omega, tau, inertia_kg_m2=J, step_s=h, forcing=forcing)
        bound = np.linalg.eigvalsh(J)[0]
        small = np.linalg.norm(h * (J @ omega1[..., None])[..., 0], axis=-1) < 0.55 * bound
        assert np.count_nonzero(small) > 20
        R2, omega2 = lgvi.lgvi_step(
            R1[small], -omega1[small], tau[small], inertia_kg_m2=J, step_s=h, forcing=forcing
        )
        back[forcing] = max(largest(R2 - R[small]), largest(omega2 + omega[small]))
    assert back['symmetric'] < 5e-14
    assert back['paper'] > 1e-3


def test_an_unknown_forcing_is_refused_by_name() -> None:
    with pytest.raises(ConfigurationError, match="forcing: 'euler'"):
        lgvi.lgvi_step(np.eye(3), np.zeros(3), np.zeros(3), inertia_kg_m2=np.eye(3), step_s=0.1,
                       forcing='euler')


@pytest.mark.parametrize('forcing', ['symmetric', 'paper'])
def test_each_body_of_a_batch_gets_the_bits_it_gets_alone(forcing: str) -> None:
    """Bodies of a batch need different numbers of Newton steps; each stops at its own."""
    rng = strategies.generator('batch')
    h, n = 0.2, 60
    J = strategies.random_inertias(rng, n)
    bound = np.linalg.eigvalsh(J)[:, :1] / h
    p = bound * np.geomspace(1e-9, 0.95, n)[:, None] * strategies.unit_vectors(rng, n)
    tau = 0.02 * bound / h * strategies.unit_vectors(rng, n)
    omega = np.linalg.solve(J, p[..., None])[..., 0]
    R = so3.random_rotations(rng, n)
    options = {'step_s': h, 'forcing': forcing}
    shape = (3, 4, 5)
    batch = lgvi.lgvi_step(
        R.reshape(*shape, 3, 3), omega.reshape(*shape, 3), tau.reshape(*shape, 3),
        inertia_kg_m2=J.reshape(*shape, 3, 3), **options,
    )
    single = [
        lgvi.lgvi_step(R[i], omega[i], tau[i], inertia_kg_m2=J[i], **options) for i in range(n)
    ]
    assert batch[0].shape == (*shape, 3, 3)
    assert batch[1].shape == (*shape, 3)
    assert np.array_equal(batch[0].reshape(n, 3, 3), [one[0] for one in single])
    assert np.array_equal(batch[1].reshape(n, 3), [one[1] for one in single])


def test_arguments_broadcast_over_leading_dimensions() -> None:
    J, h = INERTIAS['off_diagonal'], 0.1
    _, omega, tau = random_states('broadcast', J, 6, h)
    R1, omega1 = lgvi.lgvi_step(np.eye(3), omega[:, None], tau, inertia_kg_m2=J, step_s=h)
    assert R1.shape == (6, 6, 3, 3)
    alone = lgvi.lgvi_step(np.eye(3), omega[2], tau[4], inertia_kg_m2=J, step_s=h)
    assert np.array_equal(R1[2, 4], alone[0])
    assert np.array_equal(omega1[2, 4], alone[1])
    assert lgvi.cayley_step(np.zeros((0, 3)), J).shape == (0, 3)
    assert lgvi.step_rotation(omega[0], np.stack([J, J]), h).shape == (2, 3, 3)


def drawn_states(J: Array, h: float, seed: int) -> tuple[Array, Array, Array]:
    R, omega, tau = random_states(f'drawn {seed}', J, 2, h)
    return R[1], omega[1], tau[1]


@replayable
@given(strategies.drawn_inertias(), strategies.drawn_rotation_vectors(), st.integers(0, 999))
def test_step_does_not_depend_on_the_inertial_frame(J: Array, phi: Array, seed: int) -> None:
    R, omega, tau = drawn_states(J, 0.2, seed)
    Q = so3.exp(phi)
    R1, omega1 = lgvi.lgvi_step(R, omega, tau, inertia_kg_m2=J, step_s=0.2)
    R2, omega2 = lgvi.lgvi_step(Q @ R, omega, tau, inertia_kg_m2=J, step_s=0.2)
    assert largest(Q @ R1 - R2) < 4e-15
    assert np.array_equal(omega1, omega2)


@replayable
@given(strategies.drawn_inertias(), strategies.drawn_rotation_vectors(), st.integers(0, 999))
def test_step_does_not_depend_on_the_body_frame(J: Array, phi: Array, seed: int) -> None:
    R, omega, tau = drawn_states(J, 0.2, seed)
    Q = so3.exp(phi)
    turned = 0.5 * (Q @ J @ Q.T + (Q @ J @ Q.T).T)
    R1, omega1 = lgvi.lgvi_step(R, omega, tau, inertia_kg_m2=J, step_s=0.2)
    R2, omega2 = lgvi.lgvi_step(R @ Q.T, Q @ omega, Q @ tau, inertia_kg_m2=turned, step_s=0.2)
    assert largest(R1 @ Q.T - R2) < 1e-12
    assert largest(Q @ omega1 - omega2) < 1e-12 * (1.0 + largest(omega1))


@replayable
@given(strategies.drawn_inertias(), st.integers(0, 999))
def test_one_step_changes_inertial_momentum_by_the_torque_impulse(J: Array, seed: int) -> None:
    """R' Pi' - R Pi = h/2 (R + R') tau with symmetric forcing, h R' tau with the paper's."""
    h = 0.2
    R, omega, tau = drawn_states(J, h, seed)
    before = lgvi.inertial_momentum(R, omega, J)
    for forcing in ('symmetric', 'paper'):
        R1, omega1 = lgvi.lgvi_step(R, omega, tau, inertia_kg_m2=J, step_s=h, forcing=forcing)
        impulse = h * R1 @ tau if forcing == 'paper' else 0.5 * h * (R + R1) @ tau
        change = lgvi.inertial_momentum(R1, omega1, J) - before
        assert largest(change - impulse) < 2e-14 * largest(J) / h


@replayable
@given(strategies.drawn_inertias(), st.integers(0, 999))
def test_one_free_step_keeps_momentum_and_energy(J: Array, seed: int) -> None:
    R, omega, _ = drawn_states(J, 0.2, seed)
    R1, omega1 = lgvi.lgvi_step(R, omega, np.zeros(3), inertia_kg_m2=J, step_s=0.2)
    Pi = lgvi.inertial_momentum(R, omega, J)
    assert largest(lgvi.inertial_momentum(R1, omega1, J) - Pi) < 1e-14 * largest(J)
    energy = lgvi.kinetic_energy(omega, J)
    assert abs(lgvi.kinetic_energy(omega1, J) - energy) <= 1e-14 * energy
