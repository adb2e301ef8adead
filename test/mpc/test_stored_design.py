# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A design that an earlier start left is the design, whatever happened to the file since."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from cases import configuration

from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.mpc import stored_design as module
from manifold_mpc_ros.mpc.stored_design import stored_design
from manifold_mpc_ros.terminal.problem_of import terminal_design

CONFIG = configuration()


def assert_same(one: object, other: object) -> None:
    """Compare two designs figure by figure, to the bit."""
    np.testing.assert_equal(asdict(one), asdict(other))  # type: ignore[call-overload]


@pytest.fixture(scope='module')
def left(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the file that a first start leaves."""
    folder = tmp_path_factory.mktemp('cache')
    assert_same(stored_design(CONFIG, folder), terminal_design(CONFIG))
    file, = folder.iterdir()
    return file


def test_a_second_start_designs_nothing(left: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = terminal_design(CONFIG)
    monkeypatch.setattr(module, 'terminal_design', None)
    for horizon in (CONFIG.horizon, 7):
        found = stored_design(replace(CONFIG, horizon=horizon), left.parent)
        assert_same(found, expected)
        assert found.P.dtype == float


@pytest.mark.parametrize('damage', ['empty', 'cut', 'flipped'])
def test_a_damaged_file_is_made_anew(left: Path, tmp_path: Path, damage: str) -> None:
    whole = left.read_bytes()
    file = tmp_path / left.name
    file.write_bytes({'empty': b'', 'cut': whole[:len(whole) // 2],
                      'flipped': b'[' + whole[1:]}[damage])
    assert_same(stored_design(CONFIG, tmp_path), terminal_design(CONFIG))
    assert file.read_bytes() == whole


@pytest.mark.parametrize('change', [
    {'terminal_scale': 0.2}, {'max_torque_n_m': np.full(3, 0.25)}, {'forcing': 'symmetric'}])
def test_another_problem_has_another_file(
        left: Path, tmp_path: Path, change: dict[str, object]) -> None:
    other = replace(CONFIG, **change)
    (tmp_path / left.name).write_bytes(left.read_bytes())
    assert_same(stored_design(other, tmp_path), terminal_design(other))
    assert len(list(tmp_path.iterdir())) == 2


def test_without_a_place_to_keep_it_it_is_designed(tmp_path: Path) -> None:
    taken = tmp_path / 'taken'
    taken.write_text('not a folder', encoding='utf-8')
    assert_same(stored_design(CONFIG, taken), terminal_design(CONFIG))


def test_a_design_that_does_not_exist_leaves_nothing(tmp_path: Path) -> None:
    impossible = replace(CONFIG, rate_weight=1e30 * np.eye(3))
    with pytest.raises(DesignError):
        stored_design(impossible, tmp_path)
    assert list(tmp_path.iterdir()) == []
