# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``check`` on the golden bags and on damaged ones."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from golden import BROKEN, GOLDEN, NAMES, truncated

Command = Callable[..., tuple[int, str, str]]


def test_every_golden_scenario_has_its_bag() -> None:
    assert set(NAMES) == {path.stem for path in GOLDEN.glob('*.yaml')}
    assert set(BROKEN) < set(NAMES)


@pytest.mark.parametrize('name', NAMES)
def test_golden_bags_have_the_verdict_they_should(command: Command, name: str) -> None:
    status, out, err = command('check', GOLDEN / f'{name}.mcap')
    failed = BROKEN.get(name, [])
    assert (status, err) == (1 if failed else 0, '')
    assert out.rstrip().endswith(f'FAIL: {", ".join(failed)}' if failed else 'PASS')
    assert out.count('FAIL') == (len(failed) + 1 if failed else 0)


def test_junit(command: Command, tmp_path: Path) -> None:
    path = tmp_path / 'new' / 'verdict.xml'
    status, out, _ = command(
        'check', GOLDEN / 'half_turn.mcap', GOLDEN / 'mistuned.mcap', tmp_path / 'absent',
        '--junit', path)
    assert status == 1
    assert '1 of 3 bags passed' in out
    root = ET.parse(path).getroot()
    assert [suite.get('name') for suite in root] == [
        'half_turn', 'mistuned', str(tmp_path / 'absent')]
    assert [suite.get('failures') for suite in root] == ['0', '2', '0']
    assert [suite.get('errors') for suite in root] == ['0', '0', '1']
    cases = root.findall('.//testcase')
    assert root.get('tests') == str(len(cases))
    failed = [case.get('name') for case in cases if case.find('failure') is not None]
    assert failed == BROKEN['mistuned']
    message = next(root.iter('failure')).get('message') or ''
    assert message == 'settle_time_s: not settled (limit 5 s)'


def test_a_truncated_bag_is_judged_by_what_is_left_and_fails(
    command: Command, tmp_path: Path,
) -> None:
    status, out, err = command('check', truncated('mistuned', tmp_path))
    assert (status, err) == (1, '')
    assert 'recording' in out
    assert 'ends at' in out
    assert out.splitlines()[-2].startswith('FAIL: recording')


@pytest.mark.parametrize('part', [0.0, 0.001, 0.05])
def test_next_to_nothing_is_one_clear_error(
    command: Command, tmp_path: Path, part: float,
) -> None:
    data = (GOLDEN / 'half_turn.mcap').read_bytes()
    (tmp_path / 'little.mcap').write_bytes(data[:int(part * len(data))])
    status, out, err = command('check', tmp_path / 'little.mcap')
    assert (status, out) == (2, '')
    assert err.startswith(f'manifold-mpc: error: {tmp_path / "little.mcap"}')
    assert err.count('\n') == 1


def test_any_flipped_bit_is_told_and_never_a_traceback(command: Command, tmp_path: Path) -> None:
    data = (GOLDEN / 'mistuned.mcap').read_bytes()
    for part in range(20):
        at = (2 * part + 1) * len(data) // 40
        flipped = data[:at] + bytes([data[at] ^ 4]) + data[at + 1:]
        (tmp_path / 'flipped.mcap').write_bytes(flipped)
        status, out, err = command('check', tmp_path / 'flipped.mcap')
        assert status in (1, 2)
        assert err.count('\n') == (status == 2)
        assert 'recording' in out or 'FAIL' in out or status == 2


def test_a_foreign_bag_is_judged_by_a_scenario_file(command: Command, tmp_path: Path) -> None:
    """Its topics by options, the limits of a file; the scenario of another bag does not count."""
    scenario = tmp_path / 'theirs.yaml'
    scenario.write_text('{description: theirs, duration_s: 6.0, acceptance: {'
                        'peak_rate_rad_s: [1.0, 1.0, 1.0], final_error_deg: 180.0}}')
    bag = GOLDEN / 'mistuned.mcap'
    status, out, err = command('check', bag, '--scenario', scenario, '--state', '/odometry')
    assert (status, err) == (0, ''), out
    assert 'settle_time_s' not in out
    status, out, err = command('check', bag, '--scenario', scenario, '--state', '/elsewhere')
    assert (status, out) == (2, '')
    assert 'no state can be read on /elsewhere; the topics are ' in err
    status, _, err = command('check', bag, '--scenario', tmp_path / 'none.yaml')
    assert (status, err.count('\n')) == (2, 1)
