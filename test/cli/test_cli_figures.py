# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's figures: both rotations, their discontinuity, the files."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from manifold_mpc_ros.cli.main import main
from manifold_mpc_ros.dynamics.inertia import nonstandard_inertia
from manifold_mpc_ros.lab.discontinuity.findings import paper_config
from manifold_mpc_ros.lab.discontinuity.verb_figures import CASES

NAMES = {
    'figure_1_torque_z.png', 'figure_2_rate_z.png', 'figure_3_orientation_180.png',
    'figure_4_orientation_minus_0.99x180.png', 'rotation_180.csv', 'rotation_minus_0.99x180.csv',
}


class Outcome(NamedTuple):
    status: int
    folder: Path
    out: str


@pytest.fixture(scope='module')
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """Run the verb once, as it is shipped."""
    folder = tmp_path_factory.mktemp('figures')
    with pytest.MonkeyPatch.context() as patch:
        lines: list[str] = []
        patch.setattr('sys.stdout.write', lines.append, raising=False)
        status = main(['figures', '--output', str(folder)])
    return Outcome(status, folder, ''.join(lines))


def column(path: Path, name: str) -> np.ndarray:
    with path.open(encoding='utf-8') as file:
        return np.array([float(row[name]) for row in csv.DictReader(file)])


def test_the_configuration_is_the_papers() -> None:
    config = paper_config()
    assert np.array_equal(config.attitude_weight, np.eye(3))
    assert np.array_equal(config.rate_weight, nonstandard_inertia(config.inertia_kg_m2))
    assert np.array_equal(config.torque_weight, 2.0 * np.eye(3))
    assert (config.terminal_scale, config.horizon, config.forcing) == (0.1, 10, 'paper')
    assert config.max_torque_n_m is None
    assert config.max_rate_rad_s is None
    assert config.terminal_constraint
    assert [case.angle_rad for case in CASES] == [np.pi, -0.99 * np.pi]


def test_both_rotations_end_at_rest_at_the_identity(outcome: Outcome) -> None:
    for case in CASES:
        path = outcome.folder / f'rotation_{case.file_name}.csv'
        assert column(path, 'time_s')[-1] == 20.0
        assert np.isclose(column(path, 'attitude_error_rad')[0], abs(case.angle_rad))
        assert column(path, 'attitude_error_rad')[-1] < 1e-4
        assert abs(column(path, 'omega_BN_B_z_rad_s')[-1]) < 1e-4


def test_the_law_is_discontinuous_between_them(outcome: Outcome) -> None:
    """Almost the same attitude, almost opposite torques and rates, as the paper shows."""
    assert outcome.status == 0
    first, second = (outcome.folder / f'rotation_{case.file_name}.csv' for case in CASES)
    torques = [column(path, 'torque_B_z_n_m') for path in (first, second)]
    assert np.isclose(abs(torques[0][0]), 1.1788, atol=1e-4)
    assert torques[0][0] < 0.0 < torques[1][0]
    assert np.allclose(torques[0], -torques[1], atol=0.01)
    rates = [column(path, 'omega_BN_B_z_rad_s') for path in (first, second)]
    assert np.allclose(rates[0], -rates[1], atol=0.02)
    for axis in 'xy':
        assert np.allclose(column(first, f'torque_B_{axis}_n_m'), 0.0, atol=1e-6)


def test_the_choices_the_directions_and_the_files_are_printed(outcome: Outcome) -> None:
    text = ' '.join(outcome.out.split())
    assert 'Our choice' in text
    assert 'J = I kg m^2' in text
    assert 'h = 0.5 s' in text
    assert 'clockwise, 180.0 deg' in text
    assert 'counter-clockwise, 178.2 deg' in text
    assert 'discontinuous' in text
    assert {path.name for path in outcome.folder.iterdir()} == NAMES
    for name in NAMES:
        assert name in text
        if name.endswith('.png'):
            assert (outcome.folder / name).read_bytes().startswith(b'\x89PNG')
