# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every compiler and number of lanes gives the same bits; the cache survives what happens."""

from __future__ import annotations

import functools
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cases import REFERENCE, configuration

from manifold_mpc_ros.errors import ConfigurationError, SolverBuildError
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.terminal.problem_of import terminal_design

Make = Callable[..., AttitudeMpc]

COMPILER = shutil.which(os.environ.get('CC', 'cc').split()[0])
needs_compiler = pytest.mark.skipif(COMPILER is None, reason='there is no C compiler')
# The smallest structure, for tests that compile.
SMALL: dict[str, Any] = {**REFERENCE, 'horizon': 1}
# A process of its own: prints its backend and the bits of a plan.
PROGRAM = """
import sys
import numpy as np
from cases import configuration
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
config = configuration(terminal_constraint=False, horizon=1)
mpc = AttitudeMpc(config, backend=sys.argv[1], cache_dir=sys.argv[2])
plan = mpc.solve(so3.exp(np.array([0.3, -0.2, 2.0])), np.array([0.1, 0.2, -0.1]))
print(mpc.backend, plan.torques_B_n_m.tobytes().hex(), np.float64(plan.cost).tobytes().hex())
"""


def start(backend: str, cache: Path, **changes: str | None) -> subprocess.Popen[str]:
    """Start a process that solves once with a cache directory; None unsets a variable."""
    path = os.pathsep.join(filter(None, sys.path))
    environment = {**os.environ, 'PYTHONPATH': path, **changes}
    return subprocess.Popen(
        [sys.executable, '-c', PROGRAM, backend, str(cache)], text=True,
        env={name: value for name, value in environment.items() if value is not None},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def answer(process: subprocess.Popen[str]) -> list[str]:
    """Return the words that a process printed."""
    output, errors = process.communicate(timeout=240)
    assert process.returncode == 0, errors
    return output.split()


@pytest.fixture(scope='module')
def shared_start(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[list[str]]]:
    """Start two processes at once on one empty cache; return it and what they answered."""
    cache = tmp_path_factory.mktemp('shared') / 'not' / 'yet' / 'there'
    return cache, [answer(process) for process in [start('c', cache) for _ in range(2)]]


@pytest.fixture(scope='module')
def small() -> Callable[..., AttitudeMpc]:
    """Return ``make(**options)``: a controller of the smallest structure, designed once."""
    config = configuration(**SMALL)
    terminal = terminal_design(config)
    return functools.partial(AttitudeMpc, config, terminal=terminal)


@needs_compiler
def test_fewer_lanes_give_the_same_bits(
        shared_start: tuple[Path, list[list[str]]], tmp_path: Path) -> None:
    """Compiled for the least processor of the kind, with two lanes, by a closed list of flags."""
    if platform.machine() != 'x86_64':
        pytest.skip('the flags are those of x86-64')
    _, answers = shared_start
    assert answer(start('c', tmp_path, CC=f'{COMPILER} -mno-avx')) == answers[0]


def test_the_compiler_that_pip_brings_gives_the_same_bits(
        shared_start: tuple[Path, list[list[str]]], tmp_path: Path) -> None:
    """Without any compiler on the path, Zig's clang from the package ziglang compiles."""
    pytest.importorskip('ziglang')
    _, answers = shared_start
    found = answer(start('c', tmp_path / 'cache', PATH=str(tmp_path), CC=None,
                         ZIG_GLOBAL_CACHE_DIR=str(tmp_path / 'zig'),
                         ZIG_LOCAL_CACHE_DIR=str(tmp_path / 'zig')))
    assert found == answers[0]


def test_the_backend_is_named(controller: Make, small: Make) -> None:
    assert small(backend='c').backend == 'c'
    assert controller(**REFERENCE).backend == 'c'
    with pytest.raises(ConfigurationError, match="backend: 'fortran' is not valid; expected one"):
        small(backend='fortran')


@needs_compiler
def test_concurrent_first_starts_agree(shared_start: tuple[Path, list[list[str]]]) -> None:
    cache, answers = shared_start
    assert [words[0] for words in answers] == ['c', 'c']
    assert answers[0] == answers[1]
    assert sorted(path.suffix for path in cache.iterdir()) == ['.json', '.so']


@needs_compiler
def test_a_second_start_compiles_nothing(shared_start: tuple[Path, list[list[str]]]) -> None:
    """Not even where the first start's compiler has nothing to compile with any more."""
    cache, answers = shared_start
    library, = cache.glob('*.so')
    before = library.stat()
    assert answer(start('c', cache, TMPDIR=str(cache / 'none'))) == answers[0]
    assert library.stat() == before


@needs_compiler
@pytest.mark.parametrize('part', [0.0, 0.5])
def test_a_truncated_library_is_rebuilt(
        shared_start: tuple[Path, list[list[str]]], tmp_path: Path, part: float) -> None:
    cache, answers = shared_start
    library, = cache.glob('*.so')
    whole = library.read_bytes()
    damaged = tmp_path / library.name
    damaged.write_bytes(whole[:int(part * len(whole))])
    assert answer(start('c', tmp_path)) == answers[0]
    assert damaged.stat().st_size == len(whole)
    assert [path.name for path in tmp_path.glob('*.so')] == [library.name]


NO_COMPILER = {'no_such_compiler': 'no-such-compiler', 'it_fails': shutil.which('false') or ''}


@pytest.mark.parametrize('name', sorted(NO_COMPILER))
def test_a_compiler_that_does_not_work_is_named(
        monkeypatch: pytest.MonkeyPatch, tmp_path: Path, small: Make, name: str) -> None:
    compiler = NO_COMPILER[name]
    monkeypatch.setenv('CC', compiler)
    with pytest.raises(SolverBuildError, match=compiler):
        small(cache_dir=tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_without_any_compiler_it_says_what_to_install(
        monkeypatch: pytest.MonkeyPatch, tmp_path: Path, small: Make) -> None:
    monkeypatch.delenv('CC', raising=False)
    monkeypatch.setenv('PATH', str(tmp_path))
    monkeypatch.setattr('importlib.util.find_spec', lambda _: None)
    with pytest.raises(SolverBuildError, match=r'cc, gcc, clang.*pip install ziglang'):
        small(cache_dir=tmp_path)


@needs_compiler
def test_where_no_cache_can_be_written_each_start_compiles(tmp_path: Path, small: Make) -> None:
    """A file where the folder should be stands for every reason, and stops root too."""
    taken = tmp_path / 'taken'
    taken.write_text('not a folder', encoding='utf-8')
    assert small(cache_dir=taken).backend == 'c'


def test_the_cache_can_be_chosen_from_outside(
        monkeypatch: pytest.MonkeyPatch, tmp_path: Path, small: Make) -> None:
    """The argument goes before $MANIFOLD_MPC_CACHE, and that before $XDG_CACHE_HOME."""
    monkeypatch.setenv('CC', NO_COMPILER['it_fails'])
    monkeypatch.setenv('MANIFOLD_MPC_CACHE', str(tmp_path / 'variable'))
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'user'))
    used = []
    for argument in (tmp_path / 'argument', None):
        with pytest.raises(SolverBuildError):
            small(cache_dir=argument)
        used.append(sorted(path.name for path in tmp_path.iterdir()))
    monkeypatch.delenv('MANIFOLD_MPC_CACHE')
    with pytest.raises(SolverBuildError):
        small()
    assert used == [['argument'], ['argument', 'variable']]
    assert (tmp_path / 'user' / 'manifold_mpc_ros').is_dir()
