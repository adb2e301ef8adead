# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Real installations in temporary directories, each built once for all tests that look at it."""

from __future__ import annotations

import os
import shutil
import sys
import sysconfig
import venv
from pathlib import Path

import pytest
from distributions import files_of, required_by
from installed import BUILD, PIP, TOP, run

NOT_SOURCES = shutil.ignore_patterns(
    '.git', '.venv*', '.*_cache', '.hypothesis', '__pycache__', '*.egg-info', 'build', 'dist',
    'install', 'log', 'results')


@pytest.fixture(scope='session')
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the sources, so that no build leaves anything in the checkout."""
    copy = tmp_path_factory.mktemp('workspace') / 'src' / 'manifold_mpc_ros'
    shutil.copytree(TOP, copy, ignore=NOT_SOURCES)
    return copy


@pytest.fixture(scope='session')
def wheel(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the wheel that pip builds from the sources."""
    folder = tmp_path_factory.mktemp('wheel')
    run([*PIP, 'wheel', *BUILD, '--wheel-dir', folder, checkout], cwd=folder)
    return next(folder.glob('*.whl'))


@pytest.fixture(scope='session')
def pip_prefix(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a new virtual environment after ``pip install .``.

    The packages that ours needs are read from the environment that runs the tests.
    """
    prefix = tmp_path_factory.mktemp('pip') / 'a prefix'
    venv.create(prefix, with_pip=False, symlinks=True)
    python = prefix / 'bin' / 'python'
    ask = 'import sysconfig; print(sysconfig.get_path("purelib"))'
    ours = run([python, '-c', ask], cwd=prefix)
    borrowed = dict.fromkeys((sysconfig.get_path('purelib'), sysconfig.get_path('platlib')))
    Path(ours.strip(), 'borrowed.pth').write_text('\n'.join(borrowed) + '\n', encoding='utf-8')
    pip = [*PIP[:3], '--python', python, *PIP[3:]]
    run([*pip, 'install', *BUILD, '--ignore-installed', '.'], cwd=checkout)
    return prefix


@pytest.fixture(scope='session')
def flight_prefix(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a new virtual environment with what ``pip install '.[ros]'`` brings, and no more.

    The distributions that the wheel requires are links to those that run the tests.
    """
    prefix = tmp_path_factory.mktemp('flight') / 'prefix'
    venv.create(prefix, with_pip=False, symlinks=True)
    pip = [*PIP[:3], '--python', prefix / 'bin' / 'python', *PIP[3:]]
    run([*pip, 'install', '--quiet', '--no-deps', '--no-index', wheel], cwd=prefix)
    purelib = Path('lib', f'python{sys.version_info[0]}.{sys.version_info[1]}', 'site-packages')
    for file in files_of(required_by(wheel, {'ros'})):
        place = Path(os.path.normpath(prefix / purelib / file))
        place.parent.mkdir(parents=True, exist_ok=True)
        if not place.exists():
            place.symlink_to(file.locate())
    return prefix


@pytest.fixture(scope='session', params=['plain', 'symlink'])
def colcon_prefix(request: pytest.FixtureRequest, checkout: Path) -> Path:
    """Return the install prefix of the package after ``colcon build``, plain and with symlinks."""
    workspace = checkout.parents[1]
    options = ['--symlink-install'] if request.param == 'symlink' else []
    places = [f'{request.param}/{place}' for place in ('log', 'build', 'install')]
    colcon = [sys.executable, '-m', 'colcon', '--log-base', places[0], 'build',
              '--build-base', places[1], '--install-base', places[2]]
    run([*colcon, *options], cwd=workspace)
    return workspace / places[2] / 'manifold_mpc_ros'
