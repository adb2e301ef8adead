# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The exported C controller answers what Python does, on every processor that can be had here."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from campaign_of_states import loops
from cases import CERTIFIED, REFERENCE, configuration
from targets import HERE, TARGETS, answers, built, stack_bytes

from manifold_mpc_ros import AttitudeMpc, Cone, WheelArray
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.export.sources import exported, memory_doubles
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.stages.inequalities import structure_of
from manifold_mpc_ros.terminal.problem_of import terminal_design

# The same operations in the same order: what differs is a library's sin, cos, atan2 and log in
# their last bit, which a converged solve damps to its residual.
TORQUE_TOLERANCE_N_M = 1e-9
STACK_BYTES = 8192
OTHERS: dict[str, dict[str, Any]] = {
    'paper pointing': {**REFERENCE, 'target': 'pointing', 'horizon': 6},
    'outside': {**CERTIFIED, 'horizon': 4},
}


SUN = Cone('sun', (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.3)
ANY = [Cone(name, axis, axis, 2.3, 'keep_in', 'any')
       for name, axis in (('one', (0.0, 0.0, 1.0)), ('other', (0.0, 1.0, 0.0)))]
PYRAMID = WheelArray([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]], 0.3, 5.0)
# What they add to a problem, and whether targets move.
CAPABILITIES: dict[str, tuple[dict[str, Any], bool]] = {
    'cones': ({'cones': [SUN, *ANY], 'horizon': 10}, False),
    'wheels': ({'wheels': PYRAMID, 'max_torque_n_m': None}, False),
    'pointing after a direction': ({'target': 'pointing', 'horizon': 12}, True),
    'steps that grow': ({'max_rate_rad_s': 0.3, 'horizon': 12, 'horizon_s': 7.0}, False),
    'cones, wheels and references': (
        {'cones': [SUN], 'wheels': PYRAMID, 'horizon': 8}, True),
}


def write(folder: Path, mpc: AttitudeMpc, moving: bool = False) -> Path:
    """Export a controller's configuration into a folder."""
    folder.mkdir()
    for name, text in exported(mpc.config, mpc.terminal, moving=moving).items():
        (folder / name).write_text(text, encoding='utf-8')
    return folder


@pytest.fixture(scope='module')
def mpc(cache_dir: str) -> AttitudeMpc:
    """Return the certified controller."""
    return AttitudeMpc(configuration(**CERTIFIED), cache_dir=cache_dir, disturbed=True)


@pytest.fixture(scope='module')
def sources(mpc: AttitudeMpc, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of its export."""
    return write(tmp_path_factory.mktemp('export') / 'c', mpc)


@pytest.fixture(scope='module')
def gcc_program(sources: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the program that the host's gcc makes of it."""
    if TARGETS['gcc'].missing:
        pytest.skip(TARGETS['gcc'].missing)
    return built(TARGETS['gcc'], sources, tmp_path_factory.mktemp('gcc'))


@pytest.fixture(scope='module')
def known(mpc: AttitudeMpc) -> tuple[Array, Array]:
    """Return states of short closed loops of all kinds, and Python's answers."""
    return loops(mpc, 6, 8, 'targets')


@pytest.mark.parametrize('name', sorted(TARGETS))
def test_every_target_answers_as_python_does(
        sources: Path, known: tuple[Array, Array], tmp_path: Path, name: str) -> None:
    target = TARGETS[name]
    if target.missing:
        pytest.skip(target.missing)
    states, python = known
    found = answers(target, built(target, sources, tmp_path), states)[:, :11]
    assert len(found) == len(python) > 40
    if name in ('gcc', 'clang', 'sanitizers'):
        assert np.array_equal(found, python, equal_nan=True)
    assert np.array_equal(found[:, 0], python[:, 0])
    assert np.abs(found[:, 8:] - python[:, 8:]).max() < TORQUE_TOLERANCE_N_M
    if name not in ('clang', 'sanitizers'):
        assert 500 < stack_bytes(tmp_path) < STACK_BYTES


def test_closed_loops_of_200_steps_have_the_same_bits(
        mpc: AttitudeMpc, gcc_program: Path) -> None:
    states, python = loops(mpc, 6, 200, 'long loops')
    found = answers(TARGETS['gcc'], gcc_program, states)[:, :11]
    assert len(found) == 1200
    assert np.array_equal(found, python, equal_nan=True)
    assert python[:, 2].sum() >= 6


@pytest.mark.skipif(TARGETS['gcc'].missing != '', reason=TARGETS['gcc'].missing)
@pytest.mark.parametrize('kind', sorted(OTHERS))
def test_other_problems_have_the_same_bits(tmp_path: Path, cache_dir: str, kind: str) -> None:
    mpc = AttitudeMpc(configuration(**OTHERS[kind]), cache_dir=cache_dir, disturbed=True)
    sources = write(tmp_path / 'c', mpc)
    states, python = loops(mpc, 6, 10, kind)
    fast = TARGETS['gcc']._replace(compiler=('gcc', '-O1'))
    found = answers(fast, built(fast, sources, tmp_path), states)[:, :11]
    assert np.array_equal(found, python, equal_nan=True)
    if kind == 'outside':
        assert (python[:, 0] == 2.0).mean() > 0.3


@pytest.mark.skipif(TARGETS['gcc'].missing != '', reason=TARGETS['gcc'].missing)
@pytest.mark.parametrize('name', sorted(CAPABILITIES))
def test_every_capability_has_the_same_bits(tmp_path: Path, cache_dir: str, name: str) -> None:
    change, moving = CAPABILITIES[name]
    mpc = AttitudeMpc(configuration(**{**CERTIFIED, **change}), cache_dir=cache_dir,
                      disturbed=True, moving=moving)
    sources = write(tmp_path / 'c', mpc, moving)
    states, python = loops(mpc, 6, 8, name, moving=moving)
    fast = TARGETS['gcc']._replace(compiler=('gcc', '-O1'))
    found = answers(fast, built(fast, sources, tmp_path), states)[:, :11]
    assert len(found) > 40
    assert np.array_equal(found, python, equal_nan=True)
    assert len(set(python[:, 3])) > 40


def test_a_state_is_moved_on_by_the_delay_as_python_does(
        mpc: AttitudeMpc, gcc_program: Path) -> None:
    states, python = loops(mpc, 6, 10, 'delay', late_s=0.7 * mpc.config.step_s)
    found = answers(TARGETS['gcc'], gcc_program, states)[:, :11]
    assert np.array_equal(found, python, equal_nan=True)


def test_bad_states_fail_with_zero_torque_and_leave_no_trace(
        gcc_program: Path, known: tuple[Array, Array]) -> None:
    good = known[0][0]
    rows, nan = [good], float('nan')
    for place, value in ((1, nan), (3, 2.0), (5, nan), (5, 1e200), (9, nan), (12, nan),
                         (12, 0.31)):
        bad = good.copy()
        bad[place] = value
        rows += [bad, np.concatenate([[0.0], good[1:]])]
    found = answers(TARGETS['gcc'], gcc_program, np.array(rows))
    assert (found[1::2, 0] == 3.0).all()
    assert not found[1::2, 8:11].any()
    assert (found[0::2, :11] == found[0, :11]).all()


@pytest.mark.skipif(TARGETS['gcc'].missing != '', reason=TARGETS['gcc'].missing)
def test_its_makefile_builds_a_library_that_allocates_nothing(sources: Path) -> None:
    subprocess.run(['make', 'CC=gcc', 'CFLAGS=-O1'], cwd=sources, check=True, capture_output=True)
    output = subprocess.run(['./example'], cwd=sources, check=True, capture_output=True, text=True)
    assert len(output.stdout.splitlines()) == 40
    table = subprocess.run(['nm', 'manifold_mpc.o'], cwd=sources, check=True, capture_output=True,
                           text=True).stdout.split('\n')
    symbols = [line[17:].split() for line in table if line]
    called = {name for kind, name in symbols if kind == 'U'}
    assert called <= {'atan2', 'ceil', 'cos', 'fmax', 'fmin', 'log', 'memcpy', 'memset', 'rint',
                      'sin', 'sincos', 'sqrt'}
    assert 'sqrt' in called
    assert not [name for kind, name in symbols if kind in 'BbDdC']
    assert {name for kind, name in symbols if kind == 'T'} == {
        'manifold_mpc_advance', 'manifold_mpc_init', 'manifold_mpc_reset', 'manifold_mpc_solve'}
    code = (sources / 'manifold_mpc.c').read_text(encoding='utf-8')
    assert set(re.findall(r'#include (\S+)', code)) == {
        '"manifold_mpc.h"', '<math.h>', '<stddef.h>', '<stdint.h>'}


@pytest.mark.skipif(shutil.which('g++') is None, reason='no g++: apt-get install g++')
def test_the_examples_of_the_page_compile(sources: Path, tmp_path: Path) -> None:
    page = (HERE.parents[1] / 'docs' / 'embedding.md').read_text(encoding='utf-8')
    blocks = re.findall(r'```(c|cpp)\n(.*?)```', page, re.DOTALL)
    assert [kind for kind, _ in blocks] == ['c', 'cpp', 'cpp']
    strict = ['-Wall', '-Wextra', '-pedantic', '-Werror', '-fsyntax-only', f'-I{sources}',
              f'-I{HERE / "stubs"}']
    for number, (kind, text) in enumerate(blocks):
        path = tmp_path / f'block{number}.{kind}'
        path.write_text(text, encoding='utf-8')
        standard = 'gcc -std=c99' if kind == 'c' else 'g++ -std=c++17'
        done = subprocess.run([*standard.split(), *strict, str(path)], capture_output=True,
                              text=True, check=False)
        assert done.returncode == 0, done.stderr


def test_only_the_numbers_change_with_a_parameter(mpc: AttitudeMpc, sources: Path) -> None:
    other = configuration(**{**CERTIFIED, 'horizon': 25, 'max_torque_n_m': 0.2})
    files = exported(other, terminal_design(other))
    before = {name: (sources / name).read_text(encoding='utf-8') for name in files}
    assert {name for name in files if files[name] != before[name]} == {
        'manifold_mpc_data.h', 'README.md'}
    doubles = memory_doubles(mpc.config, structure_of(mpc.config, disturbed=True))
    assert f'| {doubles:,} doubles' in before['README.md']
    assert '@' not in before['README.md'] + before['manifold_mpc.h']


def test_targets_that_move_need_equal_steps(mpc: AttitudeMpc) -> None:
    other = configuration(**{**CERTIFIED, **CAPABILITIES['steps that grow'][0]})
    with pytest.raises(ConfigurationError, match='horizon_s'):
        exported(other, mpc.terminal, moving=True)
