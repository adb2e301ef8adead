# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""References that move over the horizon, followed by a body that is not the model."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from cases import CERTIFIED, configuration

from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.closed_loop import ModelPlant
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.reference import Reference, reference_torque
from manifold_mpc_ros.mpc.scaling import scaling_of
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus
from manifold_mpc_ros.mpc.stages.reference import REFERENCE
from manifold_mpc_ros.sim.plant import Plant

H, N = 0.1, 30
CONFIG = configuration(**{**CERTIFIED, 'step_s': H, 'horizon': N})
CLOSE = so3.quaternion_from_rotation(so3.exp([0.05, -0.05, 0.1]))[[1, 2, 3, 0]]
Path = Callable[[float], Reference]
AXIS = np.array([1.0, 0.5, -0.3]) / np.linalg.norm([1.0, 0.5, -0.3])


@pytest.fixture(scope='module')
def mpc() -> AttitudeMpc:
    return AttitudeMpc(CONFIG, moving=True)


def spin(omega: list[float]) -> Path:
    """Turn at a constant rate [rad/s] from the identity."""
    rate = np.array(omega)
    return lambda time_s: Reference(
        so3.exp((time_s + H * np.arange(N + 1))[:, None] * rate), np.tile(rate, (N + 1, 1)))


def swing(angle_rad: float, period_s: float) -> Path:
    """Swing about a skew axis."""
    w = 2.0 * np.pi / period_s

    def path(time_s: float) -> Reference:
        times = (time_s + H * np.arange(N + 1))[:, None]
        return Reference(so3.exp(angle_rad * np.sin(w * times) * AXIS),
                         angle_rad * w * np.cos(w * times) * AXIS)

    return path


class Tracked(NamedTuple):
    error_deg: np.ndarray
    rate_rad_s: np.ndarray
    torque_n_m: np.ndarray
    solutions: list[AttitudeMpcSolution]


def track(mpc: AttitudeMpc, path: Path, duration_s: float) -> Tracked:
    """Follow a path with a body that steps 10 times finer; it starts close, at rest."""
    mpc.reset()
    body = Plant(SimulatorConfig(
        inertia_kg_m2=CONFIG.inertia_kg_m2, max_torque_n_m=CONFIG.max_torque_n_m, step_s=H / 10,
        initial_attitude_xyzw=CLOSE, control_period_s=H, state_period_s=H))
    rows, solutions = [], []
    for tick in range(round(duration_s / H)):
        reference = path(tick * H)
        R_NB, omega = body.measure()
        solution = mpc.solve(R_NB, omega, reference=reference)
        rows.append((np.rad2deg(so3.angle(reference.R_ND[0].T @ R_NB)), omega,
                     solution.torque_B_n_m))
        solutions.append(solution)
        for _ in range(10):
            body.step(solution.torque_B_n_m)
    return Tracked(*map(np.array, zip(*rows)), solutions)


@pytest.mark.parametrize(('path', 'largest_deg'), [
    (spin([0.0, 0.0, np.deg2rad(0.06)]), 1e-3),
    (spin([0.01, -0.01, np.deg2rad(0.9)]), 1e-3),
    (swing(0.5, 40.0), 1e-2),
])
def test_what_moves_is_followed_without_lag_within_the_limits_and_one_search(
    mpc: AttitudeMpc, path: Path, largest_deg: float,
) -> None:
    tracked = track(mpc, path, 15.0)
    assert tracked.error_deg[0] > 5.0
    assert (tracked.error_deg[-20:] < largest_deg).all()
    assert (np.abs(tracked.rate_rad_s) < 0.6 * (1.0 + 1e-3)).all()
    assert {s.status for s in tracked.solutions} == {SolveStatus.CONVERGED}
    assert [s.searched for s in tracked.solutions].count(True) == 1
    values = [(s.cost, s.promised_cost) for s in tracked.solutions]
    assert all(cost <= bound + 0.1 * (before - bound) + 1e-6
               for (before, bound), (cost, _) in itertools.pairwise(values))


def test_without_its_rate_the_same_target_is_followed_behind(mpc: AttitudeMpc) -> None:
    path = spin([0.0, 0.0, np.deg2rad(0.9)])

    def without(time_s: float) -> Reference:
        return Reference.fixed(path(time_s).R_ND[0], N)

    assert track(mpc, without, 10.0).error_deg[-1] > 0.5


def test_a_direction_that_moves_is_followed_whatever_the_roll() -> None:
    config = configuration(**{**CERTIFIED, 'target': 'pointing'})
    mpc, n = AttitudeMpc(config, moving=True), config.horizon
    body, omega = ModelPlant(config, so3.exp([0.3, -0.2, 2.0])), np.array([0.02, 0.03, 0.01])
    for tick in range(50):
        times = (config.step_s * (tick + np.arange(n + 1)))[:, None]
        reference = Reference(so3.exp(times * omega), np.tile(omega, (n + 1, 1)))
        off = np.cross(body.R_NB[:, 2], reference.R_ND[0][:, 2])
        body.step(mpc.solve(*body.measure(), reference=reference).torque_B_n_m)
    assert np.rad2deg(np.linalg.norm(off)) < 5e-3


def test_beyond_the_limits_it_is_said_and_no_limit_is_broken(mpc: AttitudeMpc) -> None:
    tracked = track(mpc, spin([0.0, 0.0, 0.8]), 1.0)
    assert tracked.solutions[-1].status is SolveStatus.INFEASIBLE
    assert (np.abs(tracked.rate_rad_s) < 0.6 * (1.0 + 1e-2)).all()
    assert (np.abs(tracked.torque_n_m) <= 0.3 * (1.0 + 1e-9)).all()


def test_a_fixed_reference_is_the_fixed_target(mpc: AttitudeMpc) -> None:
    R_ND, R_NB, omega = so3.exp([0.3, -0.2, 0.1]), so3.exp([0.2, -0.3, 0.2]), np.full(3, 0.01)
    plain = AttitudeMpc(CONFIG)
    mpc.reset()
    tracked = mpc.solve(R_NB, omega, reference=Reference.fixed(R_ND, N))
    fixed = plain.solve(R_NB, omega, R_ND)
    np.testing.assert_allclose(tracked.torques_B_n_m, fixed.torques_B_n_m, atol=1e-5)
    mpc.reset()
    back = mpc.solve(R_NB, omega, R_ND)
    np.testing.assert_allclose(back.torques_B_n_m, fixed.torques_B_n_m, atol=1e-5)
    assert mpc.terminal_share == 1.0


def test_one_that_rests_at_the_end_leaves_the_terminal_set_whole(mpc: AttitudeMpc) -> None:
    turning = np.append(np.full(N // 2, 0.3), np.zeros(N + 1 - N // 2))
    angles = np.append(0.0, np.cumsum((turning[1:] + turning[:-1]) / 2.0 * CONFIG.step_s))
    omega = turning[:, None] * np.eye(3)[2]
    mpc.reset()
    mpc.solve(np.eye(3), omega[0], reference=Reference(
        so3.exp(angles[:, None] * np.eye(3)[2]), omega))
    assert (mpc.terminal_share, mpc.limits_used > 0.5) == (1.0, True)
    omega[-1] = [0.0, 0.0, 0.1]
    mpc.solve(np.eye(3), omega[0], reference=Reference(
        so3.exp(angles[:, None] * np.eye(3)[2]), omega))
    assert mpc.terminal_share == max(0.01, 1.0 - mpc.limits_used) ** 2


@pytest.mark.parametrize('forcing', ['symmetric', 'paper'])
def test_the_torque_of_a_reference_is_the_lgvis(forcing: str) -> None:
    config = configuration(**{**CERTIFIED, 'forcing': forcing})
    rng, R, omega, steps = np.random.default_rng(5), np.eye(3), np.full(3, 0.1), []
    torques = rng.uniform(-0.1, 0.1, (6, 3))
    for torque in [*torques, np.zeros(3)]:
        steps.append((R, omega))
        R, omega = lgvi_step(R, omega, torque, inertia_kg_m2=config.inertia_kg_m2,
                             step_s=config.step_s, forcing=config.forcing)  # type: ignore[arg-type]
    reference = Reference(*map(np.array, zip(*steps)))
    np.testing.assert_allclose(reference_torque(reference, config), torques, atol=1e-12)


def test_the_solver_gets_attitudes_free_steps_rates_and_torques(mpc: AttitudeMpc) -> None:
    """As NumPy has them, more than a half turn away too."""
    rng, unit = np.random.default_rng(6), scaling_of(CONFIG)
    R_ND = np.array(list(itertools.accumulate(so3.exp(rng.normal(size=(N + 1, 3))), np.matmul)))
    omega = rng.normal(size=(N + 1, 3))
    omega[3] = 0.0
    torque = reference_torque(Reference(R_ND, omega), CONFIG)
    free = so3.quaternion_from_rotation(so3.exp(H * omega))
    mpc.solver.set_reference(np.eye(3), R_ND[0], Reference(R_ND, omega))
    (margin,) = CONFIG.rate_margins
    used = np.append(np.abs(torque).max(axis=0) / CONFIG.max_torque_n_m,
                     np.abs(omega).max(axis=0) / CONFIG.max_rate_rad_s + [*margin.values()])
    assert mpc.solver.limits_used == pytest.approx(used.max(), rel=1e-12)
    got = mpc.solver.field(REFERENCE)
    assert (np.sum(got[1:, :4] * got[:-1, :4], axis=1) >= 0.0).all()
    np.testing.assert_allclose(so3.rotation_from_quaternion(got[:, :4]), R_ND[0].T @ R_ND,
                               atol=1e-12)
    np.testing.assert_allclose(got[:, 4:], np.hstack([
        free, omega / unit.rate_rad_s, np.vstack([torque, torque[-1]]) / unit.torque_n_m]),
        rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(('R_ND', 'omega'), [
    (np.tile(np.eye(3), (N, 1, 1)), np.zeros((N, 3))),
    (np.tile(np.eye(3), (N + 1, 1, 1)), np.zeros((N, 3))),
    (np.tile(np.eye(3), (N + 1, 1, 1)), np.full((N + 1, 3), np.nan)),
    (np.tile(np.diag([1.0, 1.0, -1.0]), (N + 1, 1, 1)), np.zeros((N + 1, 3))),
])
def test_what_is_no_reference_is_refused(
    mpc: AttitudeMpc, R_ND: np.ndarray, omega: np.ndarray,
) -> None:
    with pytest.raises(ConfigurationError, match='reference'):
        mpc.solve(np.eye(3), np.zeros(3), reference=Reference(R_ND, omega))
