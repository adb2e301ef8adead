# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A certificate reads back to the last bit; a file that was tampered with is refused."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.certification import certificate as files
from manifold_mpc_ros.lab.certification.certificate import (
    Certificate,
    read_certificate,
    write_certificate,
)
from manifold_mpc_ros.lab.certification.certification import certify_problem, recheck

LIMITS = {'step_s': 0.3, 'max_input': 1.0, 'max_velocity': 2.0, 'terminal_scale': 0.5}
Change = Callable[[dict[str, Any]], None]


@functools.cache
def made() -> Certificate:
    return certify_problem('double integrator', LIMITS)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_certificate(made(), tmp_path / 'certificate.json')
    return tmp_path / 'certificate.json'


def forge(path: Path, change: Change, *, signed: bool) -> None:
    """Change a file; with ``signed`` its digest is made right again."""
    content = json.loads(path.read_text(encoding='utf-8'))
    change(content)
    if signed:
        content['sha256'] = files._digest(content)
    path.write_text(json.dumps(content), encoding='utf-8')


def test_every_bit_comes_back(path: Path) -> None:
    one, other = made(), read_certificate(path)
    assert np.array_equal(one.P, other.P)
    assert np.array_equal(one.K, other.K)
    assert (one.problem, one.configuration, one.design_level, one.certified_level, one.margin) == (
        other.problem, other.configuration, other.design_level, other.certified_level,
        other.margin)
    assert one.evidence == other.evidence
    assert other.to_text() == path.read_text(encoding='utf-8')


def test_the_claim_is_proved_again_from_the_file(path: Path) -> None:
    recheck(read_certificate(path))


def raise_level(content: dict[str, Any]) -> None:
    content['certified_level'] = content['design_level'] = 1.2 * content['design_level']


def change_p(content: dict[str, Any]) -> None:
    content['P'][0][1] *= 1 + 1e-6


def flip_k(content: dict[str, Any]) -> None:
    content['K'] = [[-entry for entry in row] for row in content['K']]


def change_weight(content: dict[str, Any]) -> None:
    content['configuration']['input_weight'] = 2.0


def lower_limit(content: dict[str, Any]) -> None:
    content['configuration']['max_input'] = 0.9


def raise_margin(content: dict[str, Any]) -> None:
    content['margin'] = 1.5


def claim_nothing(content: dict[str, Any]) -> None:
    content['certified_level'] = 0.0


FORGERIES: dict[str, tuple[Change, str]] = {
    'level raised': (raise_level, 'levels .* do not fit'),
    'P changed': (change_p, 'P is not the one of the stored configuration'),
    'K flipped': (flip_k, 'K is not the one of the stored configuration'),
    'weight changed': (change_weight, 'P is not the one of the stored configuration'),
    'limit lowered': (lower_limit, 'levels .* do not fit'),
    'margin raised': (raise_margin, 'not proved .* decrease at the equilibrium'),
    'nothing claimed': (claim_nothing, 'claims nothing'),
}


@pytest.mark.parametrize('name', FORGERIES)
def test_a_change_by_hand_is_seen_at_once(path: Path, name: str) -> None:
    forge(path, FORGERIES[name][0], signed=False)
    with pytest.raises(ManifoldMpcError, match='was changed after it was written'):
        read_certificate(path)


@pytest.mark.parametrize('name', FORGERIES)
def test_a_forged_digest_does_not_help(path: Path, name: str) -> None:
    change, reason = FORGERIES[name]
    forge(path, change, signed=True)
    with pytest.raises(ManifoldMpcError, match=f'refused: .*{reason}'):
        recheck(read_certificate(path))


def test_stored_verdicts_are_not_believed(path: Path) -> None:
    """The level is the design's, so only the proof can find that the velocity limit breaks."""
    def change(content: dict[str, Any]) -> None:
        content['certified_level'] = content['design_level'] = made().design_level * 1.0009
        content['margin'] = 0.99
    forge(path, change, signed=True)
    recheck(read_certificate(path))  # 1.0009 of it is still inside: c keeps 1 % to the limit

    def further(content: dict[str, Any]) -> None:
        content['margin'] = 1.01
        content['evidence']['linear_bound'] = -1.0
    forge(path, further, signed=True)
    with pytest.raises(ManifoldMpcError, match='not proved'):
        recheck(read_certificate(path))


@pytest.mark.parametrize(('text', 'reason'), [
    ('not json', 'is not a certificate'), ('[1, 2]', 'not a certificate of a terminal set'),
    ('{"format": "something else"}', 'not a certificate of a terminal set'),
    ('{"format": "manifold_mpc_ros terminal set certificate", "version": 99}', 'version 99'),
])
def test_other_files_are_refused(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / 'other.json'
    path.write_text(text, encoding='utf-8')
    with pytest.raises(ManifoldMpcError, match=reason):
        read_certificate(path)


@pytest.mark.parametrize('change', [
    lambda content: content.pop('K'), lambda content: content.update(P=[[1.0]]),
    lambda content: content.update(margin='much'), lambda content: content.update(margin=-1.0),
])
def test_incomplete_files_are_refused(path: Path, change: Change) -> None:
    forge(path, change, signed=True)
    with pytest.raises(ManifoldMpcError, match='not a complete certificate'):
        read_certificate(path)


def test_other_problems_are_refused(path: Path) -> None:
    forge(path, lambda content: content.update(problem='pendulum'), signed=True)
    with pytest.raises(ManifoldMpcError, match="'pendulum' is not one of"):
        recheck(read_certificate(path))


def test_what_is_certified_in_part_is_never_called_certified() -> None:
    part = Certificate('attitude', {}, np.eye(6), np.zeros((3, 6)), 7.0, 3.0, 0.1, {})
    none = Certificate('attitude', {}, np.eye(6), np.zeros((3, 6)), 7.0, 0.0, 0.1, {})
    assert (part.complete, none.complete) == (False, False)
    assert part.claim() == 'certified up to c = 3, sampled between that and 7'
    assert none.claim() == 'nothing is certified'
