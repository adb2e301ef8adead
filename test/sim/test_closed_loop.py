# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The loop asks at the control step, holds in between, and logs what happened."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import pytest

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig, SimulatorConfig
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.errors import ConfigurationError, StepExistenceError
from manifold_mpc_ros.lab.closed_loop import (
    ClosedLoopLog,
    ModelPlant,
    Tick,
    run_closed_loop,
    settling_time,
)
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.sim.plant import Plant

CONFIG = SimulatorConfig(
    inertia_kg_m2=(1.0, 0.9, 0.6), step_s=0.025, max_torque_n_m=1.0,
    initial_attitude_xyzw=(0.5, -0.5, 0.1, 0.7), initial_rate_rad_s=(0.05, -0.1, 0.02))
TILTED = so3.exp([0.2, 0.4, -0.3])


@dataclass
class Answer:
    torque_B_n_m: np.ndarray
    cost: float
    iterations: int = 1
    status: str = 'converged'
    solve_time_s: float = 0.0


class ProportionalDamping:
    """A textbook law, here so that the loop can be tested without an optimiser."""

    def __init__(self) -> None:
        self.asked: list[tuple[np.ndarray, np.ndarray]] = []

    def solve(
        self, R_NB: np.ndarray, omega_BN_B: np.ndarray, R_ND: np.ndarray | None = None,
    ) -> Answer:
        self.asked.append((R_NB, omega_BN_B))
        assert R_ND is not None
        phi = so3.log(so3.attitude_error_B(R_ND, R_NB))
        return Answer(-0.5 * phi - 1.2 * omega_BN_B, cost=float(phi @ phi))


@pytest.fixture(scope='module')
def log() -> ClosedLoopLog:
    return run_closed_loop(ProportionalDamping(), Plant(CONFIG), 30.0, 0.1, TILTED)


def test_every_array_has_one_row_for_each_control_step(log: ClosedLoopLog) -> None:
    assert {len(getattr(log, field.name)) for field in fields(log)} == {301}
    assert np.allclose(log.time_s, 0.1 * np.arange(301))
    assert log.R_NB.shape == (301, 3, 3)
    assert log.omega_BN_B.shape == log.torque_B_n_m.shape == (301, 3)
    assert set(log.status) == {'converged'}


def test_the_law_brings_the_body_to_the_commanded_attitude(log: ClosedLoopLog) -> None:
    assert np.allclose(log.R_NB[-1], TILTED, atol=1e-4)
    settled = log.settled_at(1e-2, 1e-2)
    assert settled is not None
    assert 0.0 < settled < 30.0
    assert np.all(log.attitude_error_rad[log.time_s >= settled] < 1e-2)
    before = np.flatnonzero(log.time_s < settled)[-1]
    assert log.attitude_error_rad[before] >= 1e-2 or log.rate_rad_s[before] >= 1e-2
    assert log.settled_at(1e-30, 1e-2) is None


def test_torque_is_held_between_control_steps(log: ClosedLoopLog) -> None:
    """Each logged state follows from the one before by plant steps under one torque."""
    for k in range(20):
        R_NB, omega = log.R_NB[k], log.omega_BN_B[k]
        for _ in range(4):
            R_NB, omega = lgvi_step(
                R_NB, omega, np.clip(log.torque_B_n_m[k], -1.0, 1.0),
                inertia_kg_m2=CONFIG.inertia_kg_m2, step_s=CONFIG.step_s)
        assert np.allclose(R_NB, log.R_NB[k + 1], rtol=0.0, atol=1e-13)
        assert np.allclose(omega, log.omega_BN_B[k + 1], rtol=0.0, atol=1e-13)


def test_the_law_sees_the_sensors_and_the_log_holds_the_truth() -> None:
    law = ProportionalDamping()
    noisy = replace(CONFIG, rate_noise_std_rad_s=0.01)
    log = run_closed_loop(law, Plant(noisy), 1.0, 0.1, TILTED)
    seen = np.array([omega for _, omega in law.asked])
    assert len(seen) == 11
    assert 1e-3 < np.std(seen - log.omega_BN_B) < 0.05
    sensors = Plant(noisy)
    assert np.array_equal(seen[0], sensors.measure()[1])


def test_ticks_are_reported_in_order(log: ClosedLoopLog) -> None:
    ticks: list[Tick] = []
    run_closed_loop(ProportionalDamping(), Plant(CONFIG), 1.0, 0.1, TILTED, ticks.append)
    assert [tick.index for tick in ticks] == list(range(11))
    assert {tick.last_index for tick in ticks} == {10}
    assert np.array_equal([tick.attitude_error_rad for tick in ticks],
                          log.attitude_error_rad[:11])
    assert np.allclose([tick.rate_rad_s for tick in ticks], log.rate_rad_s[:11], rtol=1e-14)


def test_the_default_attitude_is_the_identity() -> None:
    log = run_closed_loop(ProportionalDamping(), Plant(CONFIG), 0.5, 0.1)
    assert np.allclose(log.attitude_error_rad, so3.angle(log.R_NB), rtol=0.0, atol=1e-15)


@pytest.mark.parametrize(('duration_s', 'control_step_s', 'named'), [
    (1.0, 0.11, 'duration_s'), (1.1, 0.11, 'control_step_s'), (1.0, 0.01, 'control_step_s'),
    (0.0, 0.1, 'duration_s'), (float('nan'), 0.1, 'duration_s'),
    (float('inf'), 0.1, 'duration_s'), (-1.0, 0.1, 'duration_s'),
])
def test_periods_that_do_not_divide_are_refused(
    duration_s: float, control_step_s: float, named: str,
) -> None:
    law = ProportionalDamping()
    with pytest.raises(ConfigurationError, match=named):
        run_closed_loop(law, Plant(CONFIG), duration_s, control_step_s)
    assert not law.asked


def test_a_log_reads_back_what_it_wrote(log: ClosedLoopLog, tmp_path: Path) -> None:
    log.save(tmp_path / 'run.npz')
    again = ClosedLoopLog.load(tmp_path / 'run.npz')
    for field in fields(log):
        assert np.array_equal(getattr(log, field.name), getattr(again, field.name))


def test_a_file_that_is_no_log_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / 'other.npz', time_s=np.zeros(3))
    (tmp_path / 'text.npz').write_text('not an archive')
    for name in ('other.npz', 'text.npz', 'missing.npz'):
        with pytest.raises(ConfigurationError, match=name):
            ClosedLoopLog.load(tmp_path / name)


@pytest.mark.parametrize(('below', 'expected'), [
    ([True, True, True], 0.0), ([False, True, True], 1.0), ([True, False, True], 2.0),
    ([True, True, False], None), ([False, False, False], None),
])
def test_settling_time_counts_from_the_last_violation(
    below: list[bool], expected: float | None,
) -> None:
    assert settling_time(np.arange(3.0), np.array(below)) == expected


@pytest.mark.parametrize('forcing', ['paper', 'symmetric'])
def test_model_plant_is_the_model_of_the_controller(forcing: str) -> None:
    config = AttitudeMpcConfig(
        inertia_kg_m2=(1.0, 0.9, 0.6), step_s=0.1, horizon=3, attitude_weight=(1, 1, 1),
        rate_weight=(0.25, 0.35, 0.65), torque_weight=(2, 2, 2), forcing=forcing)
    plant = ModelPlant(config, TILTED, (0.1, 0.2, 0.3))
    plant.step([0.3, 0.2, 0.1])
    R_NB, omega = lgvi_step(
        TILTED, [0.1, 0.2, 0.3], [0.3, 0.2, 0.1], inertia_kg_m2=config.inertia_kg_m2,
        step_s=0.1, forcing=forcing)  # type: ignore[arg-type]
    assert np.array_equal(plant.measure()[0], R_NB)
    assert np.array_equal(plant.measure()[1], omega)
    with pytest.raises(StepExistenceError):
        ModelPlant(config, TILTED, (9.0, 0.0, 0.0)).step(np.zeros(3))
