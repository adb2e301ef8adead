# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The design that is printed is the design that the controller uses."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lab.domain import verb_design as verb
from manifold_mpc_ros.lab.domain.horizon import HorizonReport
from manifold_mpc_ros.terminal.design import TerminalDesign
from manifold_mpc_ros.terminal.problem_of import terminal_design

Command = Callable[..., tuple[int, str, str]]


@pytest.fixture
def paper_like(write_config: Callable[..., Path]) -> Path:
    """The controller of the paper's example, without limits."""
    return write_config('controller', **{
        'spacecraft.inertia_kg_m2': [1.0, 1.0, 1.0], 'mpc.rate_weight': [0.5, 0.5, 0.5],
        'limits.max_torque_n_m': [float('inf')] * 3,
        'limits.max_rate_rad_s': [float('inf')] * 3})


def test_the_json_holds_the_design(
    command: Command, paper_like: Path, tmp_path: Path,
) -> None:
    status, out, err = command('design', '--controller-config', paper_like, '--no-horizon',
                               '--json', tmp_path / 'design.json')
    assert (status, err) == (0, '')
    data = json.loads((tmp_path / 'design.json').read_text(encoding='utf-8'))
    design = terminal_design(AttitudeMpcConfig.from_yaml(paper_like))
    for name in ('A', 'B', 'Q', 'R', 'N', 'P', 'K'):
        assert np.array_equal(data[name], getattr(design, name))
    assert data['c'] == design.c
    assert data['horizon'] is None
    assert data['target'] == 'attitude'
    assert data['existence']['pencil_distance'] == design.existence.pencil_distance
    assert f'{design.existence.pencil_distance:.3g} from the unit circle' in out
    assert data['levels'].keys() == design.report.limits.keys()
    assert data['limiting_condition'] == design.report.limiting
    assert f'{design.c:.6g}' in out
    assert f'{design.P[0, 0]:.4f}' in out
    assert f'{design.K[2, 5]:.4f}' in out
    assert verb.CONDITIONS[design.report.limiting] in out


def test_every_condition_that_can_limit_has_words(
    command: Command, write_config: Callable[..., Path],
) -> None:
    path = write_config('controller')
    design = terminal_design(AttitudeMpcConfig.from_yaml(path))
    assert set(design.report.limits) <= set(verb.CONDITIONS)
    status, out, _ = command('design', '--controller-config', path, '--no-horizon')
    assert status == 0
    assert out.count('limits c') == 1
    assert 'smallest N' not in out


def test_rest_angle_touches_the_terminal_set(paper_like: Path) -> None:
    """Inside the angle every axis is in the set; just beyond it, the worst axis is not."""
    design = terminal_design(AttitudeMpcConfig.from_yaml(paper_like))
    angle = np.radians(verb.rest_angle_deg(design))
    eigenvalues, axes = np.linalg.eigh(design.P[:3, :3])
    assert np.isclose(angle**2 * eigenvalues[-1], design.c)
    worst = 1.001 * angle * axes[:, -1]
    assert worst @ design.P[:3, :3] @ worst > design.c


def test_the_design_of_a_pointing_controller(
    command: Command, write_config: Callable[..., Path], tmp_path: Path,
) -> None:
    path = write_config('controller', target='pointing')
    status, out, err = command('design', '--controller-config', path, '--no-horizon',
                               '--json', tmp_path / 'design.json')
    assert (status, err) == (0, '')
    data = json.loads((tmp_path / 'design.json').read_text(encoding='utf-8'))
    design = terminal_design(AttitudeMpcConfig.from_yaml(path))
    assert data['target'] == 'pointing'
    assert np.array_equal(data['P'], design.P)
    assert np.shape(data['K']) == (3, 5)
    assert 'E^T x' in out
    assert data['rest_angle_deg'] == pytest.approx(
        np.degrees(np.sqrt(design.c / np.linalg.eigvalsh(design.P[:2, :2])[-1])))


@pytest.mark.parametrize(('smallest', 'words'), [
    (7, ('(enough)',)), (31, ('(NOT enough', 'torque_weight times 4 makes N = 20 enough'))])
def test_the_horizon_is_compared_with_the_configured_one(
    command: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, smallest: int,
    words: tuple[str, ...],
) -> None:
    def found(
        _config: AttitudeMpcConfig, *, terminal: TerminalDesign,
        progress: Callable[[str], None],
    ) -> HorizonReport:
        assert terminal.c > 0
        progress('N = 4: tried')
        return HorizonReport(smallest, np.array([0.0, np.pi, 0.0]), 132, {4: 0, smallest: 132})

    monkeypatch.setattr('manifold_mpc_ros.lab.domain.horizon.smallest_horizon', found)
    monkeypatch.setattr(
        'manifold_mpc_ros.lab.domain.horizon.gentler_torque_weight', lambda _config: 4.0)
    status, out, err = command('design', '--json', tmp_path / 'design.json')
    assert (status, err) == (int(smallest > 20), '')
    assert 'N = 4: tried' in out
    assert [word for word in words if word not in out] == []
    assert '180 deg about (0, 1, 0)' in out
    assert 'sampled states at rest' in out
    horizon = json.loads((tmp_path / 'design.json').read_text(encoding='utf-8'))['horizon']
    assert (horizon['smallest'], horizon['configured']) == (smallest, 20)
    assert horizon['tried'] == {'4': 0, str(smallest): 132}


def test_it_says_what_stored_momentum_costs(
    command: Command, write_config: Callable[..., Path], tmp_path: Path,
) -> None:
    wheeled = write_config('controller', **{'actuators.kind': 'wheels'})
    status, out, _ = command('design', '--controller-config', wheeled, '--no-horizon',
                             '--json', tmp_path / 'design.json')
    assert status == 0
    assert 'What stored momentum leaves of c' in out
    shares = json.loads((tmp_path / 'design.json').read_text(encoding='utf-8'))['momentum_shares']
    assert list(shares) == ['0.0', '0.4', '0.8']
    assert 1.0 >= shares['0.0'] > shares['0.4'] > shares['0.8'] > 0.0
