# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The script that makes keystores: twice, for two domains and namespaces, and failing closed.

With a stand-in for ``ros2 security`` everywhere, and with the real one where it is installed.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from keystores import SROS2, enforce, has_sros2, stand_in

Enforce = Callable[..., 'subprocess.CompletedProcess[str]']
ENCLAVES = sorted(path.stem for path in SROS2.glob('*.xml'))


@pytest.fixture(params=['stand-in', 'sros2'])
def run(request: pytest.FixtureRequest, tmp_path: Path) -> Enforce:
    """Give the script with a ``ros2`` on its path."""
    if request.param == 'sros2':
        if not has_sros2():
            pytest.skip("'ros2 security' (sros2) is not installed")
        return enforce
    path = f'{stand_in(tmp_path / "bin")}:{os.environ["PATH"]}'
    return lambda *arguments, **options: enforce(*arguments, **options, path=path)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Give a folder for keystores, with a name that has to be quoted."""
    return tmp_path / "it's a folder"


def contents(folder: Path) -> dict[str, bytes]:
    """Return every file below a folder."""
    return {str(path.relative_to(folder)): path.read_bytes()
            for path in folder.rglob('*') if path.is_file()}


def permissions(keystore: Path, enclave: str) -> str:
    """Return what an enclave may do."""
    return (keystore / 'enclaves' / enclave / 'permissions.xml').read_text(encoding='utf-8')


def enclaves(keystore: Path) -> list[str]:
    """Return the enclaves that have a key."""
    return sorted(str(path.parent.relative_to(keystore / 'enclaves'))
                  for path in (keystore / 'enclaves').rglob('key.pem'))


def test_once_and_again_for_one_domain_and_never_for_another(run: Enforce, folder: Path) -> None:
    keystore = folder / 'keys'
    first = run(keystore, domain=7)
    assert first.returncode == 0, first.stderr
    made = contents(keystore)
    assert enclaves(keystore) == ENCLAVES
    for name in ENCLAVES:
        assert '<id>7</id>' in permissions(keystore, name)
        assert '<topic>*</topic>' not in permissions(keystore, name)
    exports = [line for line in first.stdout.splitlines() if line.startswith('  export ')]
    shown = subprocess.run(
        ['sh', '-c', '\n'.join(exports) + '\necho "$ROS_DOMAIN_ID $ROS_SECURITY_KEYSTORE"'],
        text=True, check=True, capture_output=True)
    assert shown.stdout == f'7 {keystore}\n'
    again = run(keystore, domain=7)
    assert (again.returncode, again.stdout) == (0, first.stdout), again.stderr
    kept = contents(keystore)
    assert kept.keys() == made.keys()
    for name in kept:
        assert kept[name] == made[name] or name.endswith('permissions.p7s'), name
    other = run(keystore, domain=54)
    assert other.returncode == 1
    assert 'is for ROS_DOMAIN_ID=7, not 54' in other.stderr
    assert contents(keystore) == kept
    assert [path.name for path in folder.iterdir()] == ['keys']


def test_a_policy_that_is_not_accepted_leaves_nothing_behind(
    run: Enforce, folder: Path, tmp_path: Path,
) -> None:
    """Nor does it change a keystore that is there."""
    config = tmp_path / 'config'
    shutil.copytree(SROS2, config)
    folder.mkdir()
    (config / 'recorder.xml').write_text('<policy version="0.2.0"><enclaves>', encoding='utf-8')
    failed = run(folder / 'keys', script=config / 'enforce.sh')
    assert failed.returncode == 1
    assert 'recorder.xml was not accepted' in failed.stderr
    assert 'nothing was changed' in failed.stderr
    assert list(folder.iterdir()) == []
    assert run(folder / 'keys').returncode == 0
    before = contents(folder)
    assert run(folder / 'keys', script=config / 'enforce.sh').returncode == 1
    assert contents(folder) == before


def test_several_spacecraft_share_a_keystore(run: Enforce, folder: Path) -> None:
    keystore = folder / 'keys'
    for namespace in ('/', '/sat1', '/fleet/sat2'):
        done = run(keystore, namespace)
        assert done.returncode == 0, done.stderr
        prefix = namespace.rstrip('/')
        assert f'--enclave {prefix}/attitude_controller' in done.stdout
        assert (f'__ns:={prefix}' in done.stdout) == bool(prefix)
    assert enclaves(keystore) == sorted(
        prefix + name for prefix in ('', 'sat1/', 'fleet/sat2/') for name in ENCLAVES)
    sat1 = permissions(keystore, 'sat1/attitude_controller')
    assert '"/sat1"' in sat1 or '<topic>rt/sat1/torque_command</topic>' in sat1
    assert 'sat2' not in sat1


@pytest.mark.parametrize(('arguments', 'domain', 'status', 'message'), [
    ((), 0, 2, 'usage: '),
    (('--help',), 0, 2, 'usage: '),
    (('keys', '/sat1', 'more'), 0, 2, 'usage: '),
    (('keys', 'sat1'), 0, 1, "the namespace 'sat1' is none"),
    (('keys', '/sat|1'), 0, 1, "the namespace '/sat|1' is none"),
    (('keys',), 'seven', 1, "ROS_DOMAIN_ID is 'seven'"),
    (('there',), 0, 1, 'is there, and is no keystore'),
])
def test_mistakes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...],
    domain: int | str, status: int, message: str,
) -> None:
    path = f'{stand_in(tmp_path / "bin")}:{os.environ["PATH"]}'
    (tmp_path / 'here' / 'there').mkdir(parents=True)
    monkeypatch.chdir(tmp_path / 'here')
    done = enforce(*arguments, domain=domain, path=path)
    assert (done.returncode, done.stdout) == (status, '')
    assert message in done.stderr
    assert [each.name for each in Path().iterdir()] == ['there']


def test_without_ros2_it_says_so(tmp_path: Path) -> None:
    tools = tmp_path / 'bin'
    tools.mkdir()
    for name in ('grep', 'dirname', 'basename', 'sh'):
        (tools / name).symlink_to(shutil.which(name) or name)
    done = enforce(tmp_path / 'keys', path=str(tools))
    assert done.returncode == 1
    assert 'ros2 is not on the PATH' in done.stderr
    assert not (tmp_path / 'keys').exists()
