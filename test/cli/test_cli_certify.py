# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verbs certify and verify: status 0 for what is proved, one reason for what is not."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from manifold_mpc_ros.lab.certification.certificate import read_certificate, write_certificate

Command = Callable[..., tuple[int, str, str]]
TOP = Path(__file__).parents[2]
ALONE = ('--workers', '1')


@pytest.fixture
def weak(write_config: Callable[..., Path]) -> Path:
    """A controller with little torque: its terminal set is small and soon certified."""
    return write_config('controller', **{'limits.max_torque_n_m': [0.05] * 3})


def test_certify_then_verify(command: Command, weak: Path, tmp_path: Path) -> None:
    output = tmp_path / 'certificate.json'
    status, out, err = command('certify', '--controller-config', weak, '--output', output, *ALONE)
    assert (status, err) == (0, '')
    certificate = read_certificate(output)
    assert certificate.complete
    assert certificate.claim() in out
    assert certificate.evidence['seconds'] > 0
    assert str(output) in out
    assert '100 % of the volume' in out
    before = output.read_bytes()
    status, _, err = command('certify', '--controller-config', weak, '--output', output, *ALONE)
    assert status != 0
    assert f'{output}: exists already; --overwrite replaces it' in err
    assert output.read_bytes() == before
    status, out, err = command('verify', output, *ALONE)
    assert (status, err) == (0, '')
    assert 'Verified: the terminal set is certified on all of X_T' in out


def test_a_cone_that_cuts_the_set_is_proved_again_from_the_file_and_a_wider_one_refused(
    command: Command, write_config: Callable[..., Path], tmp_path: Path,
) -> None:
    """In a fresh process; the wider cone with a digest that fits."""
    path = write_config('controller', **{
        'limits.max_torque_n_m': [0.05] * 3, 'limits.max_rate_rad_s': [0.1] * 3,
        'cones.names': ['sun'], 'cones.sun.axis_B': [1.0, 0.0, 0.0],
        'cones.sun.half_angle_deg': 35.0, 'cones.sun.direction_N': [0.8, 0.6, 0.0]})
    output = tmp_path / 'certificate.json'
    assert command('certify', '--controller-config', path, '--output', output, *ALONE)[0] == 0
    verify = [sys.executable, '-m', 'manifold_mpc_ros.cli.main', 'verify', str(output), *ALONE]
    assert subprocess.run(verify, check=False, capture_output=True).returncode == 0
    certificate = read_certificate(output)
    cone, = certificate.configuration['cones']
    cone['half_angle_rad'] += 0.02
    write_certificate(certificate, output)
    ended = subprocess.run(verify, check=False, capture_output=True, text=True)
    assert ended.returncode == 1
    assert 'do not fit the c of the stored configuration' in ended.stderr


def test_pointing_is_certified_too(
    command: Command, write_config: Callable[..., Path], tmp_path: Path,
) -> None:
    path = write_config('controller', **{
        'limits.max_torque_n_m': [0.03] * 3, 'target': 'pointing'})
    status, out, _ = command('certify', '--controller-config', path, '--output',
                             tmp_path / 'p.json', *ALONE)
    assert status == 0
    assert 'pointing' in out


def test_what_is_not_all_certified_is_no_success(
    command: Command, write_config: Callable[..., Path], tmp_path: Path,
) -> None:
    path = write_config('controller', **{'limits.max_torque_n_m': [float('inf')] * 3})
    output = tmp_path / 'part.json'
    status, out, _ = command('certify', '--controller-config', path, '--output', output,
                             '--budget', '4', *ALONE)
    assert status == 1
    assert 'why not all of it' in out
    assert 'certified on all' not in out
    assert not read_certificate(output).complete


def test_a_tampered_file_is_refused_with_the_reason(
    command: Command, weak: Path, tmp_path: Path,
) -> None:
    output = tmp_path / 'certificate.json'
    assert command('certify', '--controller-config', weak, '--output', output, *ALONE)[0] == 0
    content = json.loads(output.read_text(encoding='utf-8'))
    content['certified_level'] *= 2
    output.write_text(json.dumps(content), encoding='utf-8')
    status, out, err = command('verify', output, *ALONE)
    assert status == 1
    assert 'Verified' not in out
    assert 'NOT verified' in err
    assert 'was changed after it was written' in err


def test_without_the_package_one_message_names_it(
    command: Command, weak: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, 'flint', None)
    (tmp_path / 'any.json').write_text('{}', encoding='utf-8')
    for arguments in (('certify', '--controller-config', weak, '--output', tmp_path / 'x.json'),
                      ('verify', tmp_path / 'any.json')):
        status, _, err = command(*arguments)
        assert status == 2
        assert err.count('\n') == 1
        assert "flint, which is not installed: pip install 'manifold_mpc_ros[lab]'" in err
    assert not (tmp_path / 'x.json').exists()


@pytest.mark.parametrize('arguments', [
    ('certify', '--margin', '0'), ('certify', '--workers', '0'), ('certify', '--budget', 'x'),
    ('verify', 'no_such_file.json'),
])
def test_mistakes_are_one_line(command: Command, arguments: tuple[str, ...]) -> None:
    status, _, err = command(*arguments)
    assert status == 2
    assert len(err.strip().splitlines()) == 1


def test_the_shipped_certificate_is_of_the_shipped_configuration() -> None:
    """What `certify` wrote for config/controller.yaml, all of it certified."""
    from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
    from manifold_mpc_ros.lab.certification.enclosures import describe, design_of
    certificate = read_certificate(TOP / 'docs/results/certificate.json')
    config = AttitudeMpcConfig.from_yaml(TOP / 'config/controller.yaml')
    assert (certificate.problem, certificate.configuration) == describe(config)
    assert certificate.complete
    design = design_of(certificate.problem, certificate.configuration)
    for name in ('P', 'K'):
        assert getattr(certificate, name) == pytest.approx(getattr(design, name), rel=1e-9,
                                                           abs=1e-9)
    assert certificate.design_level == pytest.approx(design.c, rel=1e-6)
