# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The Makefile: its targets, when it sets up again, and what it says when it cannot."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from installed import TOP, environment

STAMPS = ('.venv/.dependencies-installed', '.venv/.package-installed')


def make(*arguments: str, cwd: Path = TOP) -> subprocess.CompletedProcess[str]:
    """Run make, which may fail."""
    variables = environment()
    variables.pop('MAKEFLAGS', None)
    variables.pop('MAKELEVEL', None)
    return subprocess.run(['make', *arguments], cwd=cwd, env=variables, text=True, check=False,
                          capture_output=True, timeout=60)


@pytest.fixture
def copy(checkout: Path, tmp_path: Path) -> Path:
    """Return another copy of the sources, with no .venv yet."""
    return Path(shutil.copytree(checkout, tmp_path / 'copy'))


@pytest.fixture
def set_up(copy: Path) -> Path:
    """Return a copy whose set-up looks complete and newer than every source."""
    newest = max(path.stat().st_mtime for path in copy.rglob('*'))
    (copy / '.venv').mkdir()
    for age, stamp in enumerate(STAMPS, start=1):
        (copy / stamp).touch()
        os.utime(copy / stamp, (newest + age, newest + age))
    return copy


def python(folder: Path, body: str) -> str:
    """Return the path of an interpreter stand-in with the given shell body."""
    path = folder / 'stand-in'
    path.write_text(f'#!/bin/sh\n{body}\n', encoding='utf-8')
    path.chmod(0o755)
    return f'PYTHON={path}'


def test_help_names_every_target() -> None:
    listed = {line.split()[1] for line in make('help').stdout.splitlines() if '  make ' in line}
    phony = next(line for line in (TOP / 'Makefile').read_text(encoding='utf-8').splitlines()
                 if line.startswith('.PHONY:'))
    assert listed == set(phony.split()[1:])


def test_a_complete_set_up_is_left_alone(set_up: Path) -> None:
    assert make('--question', 'setup', cwd=set_up).returncode == 0


@pytest.mark.parametrize(('changed', 'parts'), [
    ('setup.py', ['dependencies', 'package']),
    ('.ci/constraints.txt', ['dependencies', 'package']),
    ('manifold_mpc_ros/lie/so3.py', ['package']),
    ('config/controller.yaml', ['package']),
    ('package.xml', ['package']),
    ('README.md', []),
    ('test/packaging/installed.py', []),
])
def test_a_change_sets_up_what_depends_on_it(set_up: Path, changed: str, parts: list[str]) -> None:
    planned = make('--dry-run', f'--new-file={changed}', 'setup', cwd=set_up).stdout
    assert [part for part in ('dependencies', 'package') if f'.venv {part}' in planned] == parts


@pytest.mark.parametrize(('body', 'message'), [
    ('exit 127', 'cannot run the interpreter'),
    ('case $2 in *version_info*) echo 3.9;; esac', 'is Python 3.9; 3.10 to 3.13 are supported'),
    ('case $2 in *version_info*) echo 3.11;; *) test "$2" = "";; esac',
     'apt-get install python3.11-venv'),
])
def test_an_unusable_interpreter_is_named(copy: Path, body: str, message: str) -> None:
    done = make('setup', python(copy, body), cwd=copy)
    assert done.returncode != 0
    assert message in done.stderr
    assert not (copy / STAMPS[0]).exists()


def test_a_failing_pip_stops_with_a_message(copy: Path) -> None:
    failing = copy / '.venv/bin/python'
    failing.parent.mkdir(parents=True)
    failing.write_text('#!/bin/sh\ntest "$1" = -c || { echo no route >&2; exit 1; }\n',
                       encoding='utf-8')
    failing.chmod(0o755)
    done = make('setup', cwd=copy)
    assert done.returncode != 0
    assert 'no route' in done.stderr
    assert 'pip could not install' in done.stderr
    assert not any((copy / stamp).exists() for stamp in STAMPS)
