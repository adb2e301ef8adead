# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The instances of the comparison follow their rule, and survive a file to the last bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.benchmark.peers import instances
from manifold_mpc_ros.lie import so3

STORED = Path(__file__).parents[2] / 'docs' / 'results' / 'bench_instances.json'
#: Four squares and their sum, a root and a quotient on either side [relative].
ROUNDING = 8 * np.finfo(float).eps
WRONG = '{"instances": [{"kind": "x", "quaternion_wxyz": [%s], "omega_BN_B_rad_s": [%s]}]}'


def test_random_ones_follow_the_rule() -> None:
    """Unit quaternions along the normals: within an ulp of numpy's norm, which has its own sum."""
    rng = np.random.default_rng(0)
    normals = rng.standard_normal((200, 4))
    rates = rng.uniform(-0.2, 0.2, (200, 3))
    drawn = [each for each in instances.draw(7) if each.kind == 'random']
    assert len(drawn) == 7
    for each, normal, rate in zip(drawn, normals, rates):
        q = normal / np.linalg.norm(normal)
        assert np.allclose(each.quaternion_wxyz, q if q[0] >= 0 else -q, rtol=ROUNDING, atol=0)
        assert each.quaternion_wxyz[0] >= 0
        assert np.array_equal(each.omega_BN_B, rate)


def test_the_stored_ones_are_drawn_again_to_the_bit() -> None:
    """The rule gives the file of docs/results on every processor."""
    stored = instances.read(STORED)
    drawn = instances.draw(len(stored) - 12)
    assert drawn[:-9] == stored[:-9]
    for one, other in zip(drawn[-9:], stored[-9:], strict=True):  # sines are the C library's
        assert np.allclose(one.state, other.state, rtol=ROUNDING, atol=0)


def test_half_turns_are_exact_and_the_near_ones_are_not() -> None:
    drawn = instances.draw(1)
    exact = [each.R_NB for each in drawn if each.kind == 'half turn']
    assert [np.diag(R).tolist() for R in exact] == [[1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    assert all(np.array_equal(R, np.diag(np.diag(R))) for R in exact)
    near = [each for each in drawn if each.kind == 'near half turn']
    assert len(near) == 9
    for each in near:
        distance = min(so3.angle(R.T @ each.R_NB) for R in exact)
        assert 1e-4 < distance < 0.2
        assert so3.angle(each.R_NB) > np.pi - 2e-3


def test_a_file_keeps_every_bit(tmp_path: Path) -> None:
    drawn = instances.draw(20)
    assert instances.read(instances.write(tmp_path / 'x.json', drawn)) == drawn


@pytest.mark.parametrize('text', [
    '', '[]', '{"instances": 3}', '{"instances": [{"kind": "random"}]}',
    WRONG % ('2, 0, 0, 0', '0, 0, 0'), WRONG % ('1, 0, 0, 0', '0, NaN, 0'),
])
def test_another_file_is_refused_by_name(tmp_path: Path, text: str) -> None:
    path = tmp_path / 'wrong.json'
    path.write_text(text, encoding='utf-8')
    with pytest.raises(ManifoldMpcError, match=r'wrong\.json'):
        instances.read(path)
