# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The solver compiled from generated C and cached, or in CasADi's virtual machine.

The compiled library depends on the problem's structure only (forcing, target, which inequalities
exist); the horizon and all numbers are run-time values. Its file name is a hash of the structure,
of the sources that generate it, of CasADi, of the compiler and of the processor. Concurrent starts
can at worst compile the same thing twice; a damaged library is not loaded, which would end the
process (:mod:`manifold_mpc_ros.mpc.cache`).
"""

from __future__ import annotations

import os
import platform
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import casadi as ca

from manifold_mpc_ros.errors import ConfigurationError, SolverBuildError
from manifold_mpc_ros.mpc import cache
from manifold_mpc_ros.mpc.backends.code_generation import program_code
from manifold_mpc_ros.mpc.backends.compiled import Library, NativeSolver
from manifold_mpc_ros.mpc.backends.interpreted import InterpretedSolver, Parts
from manifold_mpc_ros.mpc.backends.local_solver import LocalSolver
from manifold_mpc_ros.mpc.program.program import program_of
from manifold_mpc_ros.mpc.program.structure import Structure
from manifold_mpc_ros.mpc.scaling import Array

BACKENDS = ('auto', 'c', 'vm')
# No contraction into fused multiply-add: compiled C and the virtual machine then execute the
# same sequence of roundings (test_backends.py compares them bit by bit).
_FLAGS = ('-std=gnu11', '-O2', '-march=native', '-ffp-contract=off', '-fno-math-errno', '-fPIC',
          '-shared')
_COMPILE_TIMEOUT_S = 300

# Makes a solver with memory of its own from a flat vector of parameters.
MakeSolver = Callable[[Array], LocalSolver]


def load_solver(structure: Structure, horizon: int, backend: str, cache_dir: str | Path | None
                ) -> tuple[MakeSolver, str]:
    """Return what makes solvers of this structure and horizon, and the backend, 'c' or 'vm'.

    ``backend`` 'auto' compiles where there is a compiler and falls back to the virtual machine.

    Raises
    ------
    ConfigurationError
        For an unknown backend.
    SolverBuildError
        When backend 'c' is asked for and cannot be had.

    """
    if backend not in BACKENDS:
        raise ConfigurationError('backend', backend, f'one of {", ".join(BACKENDS)}')
    if backend != 'vm':
        try:
            library = _load_library(structure, cache.cache_directory(cache_dir))
            return lambda numbers: NativeSolver(library, structure, horizon, numbers), 'c'
        except SolverBuildError:
            if backend == 'c':
                raise
    parts = Parts(program_of(structure), horizon)
    return lambda numbers: InterpretedSolver(parts, structure, numbers), 'vm'


def _load_library(structure: Structure, folder: Path) -> Library:
    """Return the compiled solver, from the cache or freshly compiled."""
    path = folder / f'solver_{_key(structure)}.so'
    if cache.read(path) is None:
        try:
            _compile(structure, path)
        except OSError as error:
            raise SolverBuildError(f'cannot write {path}: {error}') from error
    return Library(path)


def _compile(structure: Structure, library: Path) -> None:
    """Generate C, compile it beside its destination and put it there."""
    compiler = _compiler()
    with tempfile.TemporaryDirectory(dir=library.parent, prefix='build_') as folder:
        source, built = Path(folder) / 'solver.c', Path(folder) / 'solver.so'
        source.write_text(program_code(program_of(structure)), encoding='utf-8')
        command = [*compiler, *_FLAGS, str(source), '-o', str(built), '-lm']
        try:
            result = subprocess.run(command, capture_output=True, text=True, check=False,
                                    timeout=_COMPILE_TIMEOUT_S)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise SolverBuildError(f'{compiler[0]} did not run: {error}') from error
        if result.returncode != 0:
            lines = result.stderr.strip().splitlines() or ['no message']
            raise SolverBuildError(f'{compiler[0]} failed on the generated solver: {lines[0]}')
        cache.write(library, built.read_bytes())


def _compiler() -> list[str]:
    """Return the C compiler's command: $CC with its arguments, else cc, gcc or clang."""
    wanted = os.environ.get('CC')
    for command in (wanted,) if wanted is not None else ('cc', 'gcc', 'clang'):
        words = shlex.split(command)
        found = shutil.which(words[0]) if words else None
        if found:
            return [found, *words[1:]]
    raise SolverBuildError(f'no C compiler found ({wanted or "cc, gcc, clang"})')


# Taken when the modules are imported: sources that change later are not what runs here.
_SOURCES = cache.hash_of_sources(
    'mpc/stages/*', 'mpc/program/*', 'mpc/backends/*', '*/symbolic.py',
    'dynamics/scalar_form.py', 'mpc/scaling.py')


def _key(structure: Structure) -> str:
    """Return the hash that names the compiled library of a structure on this machine."""
    command = _compiler()
    compiler = Path(command[0]).resolve()
    facts = (_SOURCES, structure, ca.CasadiMeta.version(), _FLAGS, command, compiler,
             compiler.stat().st_mtime_ns, platform.machine(), _processor_flags())
    return cache.name_of(*facts)


def _processor_flags() -> str:
    """Return the processor's feature flags, so that a shared cache suits every host."""
    try:
        lines = Path('/proc/cpuinfo').read_text(encoding='ascii', errors='replace').splitlines()
    except OSError:
        return platform.processor()
    return next((line for line in lines if line.startswith(('flags', 'Features'))), '')
