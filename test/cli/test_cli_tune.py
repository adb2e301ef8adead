# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The file that tune writes is a controller that flies its slew as it says."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.control.moving.slew_profile import SlewPlanner
from manifold_mpc_ros.lab.batch.model_loop import LoopingMpc
from manifold_mpc_ros.lab.tune.rule import bang_bang_time_s
from manifold_mpc_ros.lab.tune.trial import Flyer, Slew, fly

Command = Callable[..., tuple[int, str, str]]

CUBESAT = """\
/**/attitude_controller:
  ros__parameters:
    spacecraft: {inertia_kg_m2: [0.13, 0.10, 0.05]}
    limits: {max_torque_n_m: [0.001, 0.001, 0.001], max_rate_rad_s: [0.1, 0.1, 0.1]}
    state_source: imu
"""


def test_a_cubesat_settles_near_the_bound_with_the_file_written(
        command: Command, tmp_path: Path) -> None:
    (tmp_path / 'mine.yaml').write_text(CUBESAT, encoding='utf-8')
    path = tmp_path / 'controller.yaml'
    status, out, err = command('tune', tmp_path / 'mine.yaml', '-o', path, '--slew', 60, -30, 60)
    assert (status, err) == (0, ''), out
    controller = ControllerConfig.from_yaml(path)
    config, slews = controller.mpc, SlewPlanner.from_config(controller)
    text = path.read_text(encoding='utf-8')
    assert 'state_source: imu' in text
    assert '# hardest slew: 90 deg about (0.667, -0.333, 0.667): ' in text
    assert 'keep_rate_between_samples: true' in text
    assert '# rate limits: kept between samples too' in text
    assert 'torque_fraction: 0.97' in text
    vector = np.radians([60.0, -30.0, 60.0])
    bound = bang_bang_time_s(config, vector / (np.pi / 2), np.pi / 2)
    assert config.horizon * config.step_s > bound
    (outcome,) = fly(Flyer(LoopingMpc(config, moving=True), slews),
                     [Slew(vector)], np.radians(0.1))
    assert outcome.infeasible == 0
    assert not outcome.broken
    assert outcome.settled_s < 1.1 * bound
    assert outcome.peak_torque < 0.98
    assert (tmp_path / 'controller.png').stat().st_size > 10_000


@pytest.mark.parametrize('missing', ['limits.max_torque_n_m', 'spacecraft.inertia_kg_m2'])
def test_what_tune_starts_from_has_to_be_given(
        command: Command, tmp_path: Path, missing: str) -> None:
    lines = [line for line in CUBESAT.splitlines() if missing.split('.')[0] not in line]
    (tmp_path / 'mine.yaml').write_text('\n'.join(lines) + '\n', encoding='utf-8')
    status, _, err = command('tune', tmp_path / 'mine.yaml', '-o', tmp_path / 'out.yaml')
    assert status == 2
    assert f'{missing}: ' in err
    assert not (tmp_path / 'out.yaml').exists()
