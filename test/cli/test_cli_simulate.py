# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The offline closed loop: its result, its exit status, its pictures and data."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from manifold_mpc_ros.lab.closed_loop import ClosedLoopLog

Command = Callable[..., tuple[int, str, str]]
ROTATED_60_DEG = [0.0, 0.0, 0.5, 0.8660254037844386]  # about z
FILES = {'closed_loop.npz', 'closed_loop.csv', 'response.png', 'orientation.png'}


def test_a_slew_that_settles(
    command: Command, quick_controller: Path, write_config: Callable[..., Path], tmp_path: Path,
) -> None:
    simulator = write_config('simulator', **{
        'plant.initial_attitude_xyzw': ROTATED_60_DEG, 'plant.step_s': 0.05})
    folder = tmp_path / 'made' / 'on demand'
    status, out, err = command(
        'simulate', '--controller-config', quick_controller, '--simulator-config', simulator,
        '--duration', 20, '--output', folder)
    assert (status, err) == (0, '')
    assert 'settled at' in out
    assert 'NOT' not in out
    assert {path.name for path in folder.iterdir()} == FILES
    for name in FILES:
        assert str(folder / name) in out
        if name.endswith('.png'):
            assert (folder / name).read_bytes().startswith(b'\x89PNG')
    log = ClosedLoopLog.load(folder / 'closed_loop.npz')
    assert np.isclose(np.degrees(log.attitude_error_rad[0]), 60.0)
    settled_s = log.settled_at(np.radians(0.1), 1e-3)
    assert f'{settled_s:.2f} s' in out
    assert np.all(np.abs(log.torque_B_n_m) <= 0.3 + 1e-12)
    assert_csv_holds(folder / 'closed_loop.csv', log)


def assert_csv_holds(path: Path, log: ClosedLoopLog) -> None:
    """Every number of the archive is in the CSV to its last digit."""
    with path.open(encoding='utf-8') as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(log.time_s)
    for column, values in {
        'time_s': log.time_s, 'attitude_error_rad': log.attitude_error_rad,
        'omega_BN_B_z_rad_s': log.omega_BN_B[:, 2], 'torque_B_x_n_m': log.torque_B_n_m[:, 0],
        'R_NB_21': log.R_NB[:, 1, 0], 'cost': log.cost,
    }.items():
        assert np.array_equal([float(row[column]) for row in rows], values)
    assert [row['status'] for row in rows] == log.status.tolist()


def test_by_a_profile_half_a_turn_settles_sooner(
    command: Command, write_config: Callable[..., Path], tmp_path: Path,
) -> None:
    settled_s = []
    for part in (0.9, 0.0):
        controller = write_config('controller', **{'slew_profile.torque_fraction': part})
        folder = tmp_path / f'{part}'
        status, _, err = command('simulate', '--controller-config', controller,
                                 '--duration', 20, '--output', folder)
        assert (status, err) == (0, '')
        log = ClosedLoopLog.load(folder / 'closed_loop.npz')
        assert set(log.status) == {'converged'}
        settled_s.append(log.settled_at(np.radians(0.1), 1e-3))
    assert settled_s[0] < 10.0 < settled_s[1]


def test_a_horizon_that_is_too_short_is_named(
    command: Command, write_config: Callable[..., Path], tmp_path: Path,
) -> None:
    controller = write_config('controller', **{'mpc.horizon': 5})
    _, out, err = command(
        'simulate', '--controller-config', controller, '--duration', 4, '--output', tmp_path)
    assert err == ''
    assert 'WARNING: no plan has reached the terminal set for 5 ticks' in out


def test_a_slew_that_has_no_time_to_settle(
    command: Command, quick_controller: Path, tmp_path: Path,
) -> None:
    status, out, err = command(
        'simulate', '--controller-config', quick_controller, '--duration', 2, '--output',
        tmp_path / 'out')
    assert (status, err) == (1, '')
    assert 'NOT settled' in out
    assert {path.name for path in (tmp_path / 'out').iterdir()} == FILES


@pytest.mark.parametrize('frame', ['body', 'inertial'])
def test_a_disturbance_is_felt_and_reported(
    command: Command, quick_controller: Path, write_config: Callable[..., Path],
    tmp_path: Path, frame: str,
) -> None:
    simulator = write_config('simulator', **{
        'plant.disturbance_torque_n_m': [0.0, 0.0, 0.05], 'limits.max_torque_n_m': [0.1] * 3,
        'plant.initial_attitude_xyzw': ROTATED_60_DEG, 'plant.step_s': 0.05})
    status, out, _ = command(
        'simulate', '--controller-config', quick_controller, '--simulator-config', simulator,
        '--duration', 3, '--disturbance-frame', frame, '--output', tmp_path / 'out')
    assert status == 1
    log = ClosedLoopLog.load(tmp_path / 'out/closed_loop.npz')
    clipped = np.clip(log.torque_B_n_m, -0.1, 0.1)
    gained = 0.6 * np.diff(log.omega_BN_B[:, 2]) / 0.5
    assert np.allclose(gained, clipped[:-1, 2] + 0.05, atol=1e-9)
    saturated = 10 * int(np.sum(np.any(log.torque_B_n_m[:-1] != clipped[:-1], axis=1)))
    assert saturated > 0
    assert f'{saturated} saturated' in out
