# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The solver compiled from generated C, and cached.

The compiled library depends on the problem's structure only (forcing, target, which inequalities
exist); the horizon and all numbers are run-time values. Its file name is a hash of the structure,
of the sources that generate it, of CasADi, of the compiler and of the processor. Concurrent starts
can at worst compile the same thing twice; a damaged library is not loaded, which would end the
process (:mod:`manifold_mpc_ros.mpc.cache`).

The compiler is $CC, cc, gcc or clang, else the one that the Python package ``ziglang`` brings.
Where no cache can be written to, the library is compiled into a folder of this process's own.
"""

from __future__ import annotations

import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import casadi as ca

from manifold_mpc_ros.errors import CacheError, ConfigurationError, SolverBuildError
from manifold_mpc_ros.mpc import cache
from manifold_mpc_ros.mpc.backends.code_generation import program_code
from manifold_mpc_ros.mpc.library import Library
from manifold_mpc_ros.mpc.program.phase import Structure

BACKENDS = ('auto', 'c')
# No contraction into fused multiply-add: every processor and compiler then executes the same
# sequence of roundings, and a recorded loop replays bit for bit (test_backends.py). GCC's
# vectoriser of straight code contracts to vfmaddsub even so.
_FLAGS = ('-std=gnu11', '-O2', '-march=native', '-ffp-contract=off', '-fno-tree-slp-vectorize',
          '-fno-math-errno', '-fPIC', '-shared')
_COMPILE_TIMEOUT_S = 300


def load_library(structure: Structure, backend: str, cache_dir: str | Path | None) -> Library:
    """Return the compiled solver, from the cache or freshly compiled; its backend is 'c'.

    Raises
    ------
    ConfigurationError
        For an unknown backend.
    SolverBuildError
        When there is no compiler, or it fails.

    """
    if backend not in BACKENDS:
        raise ConfigurationError('backend', backend, f'one of {", ".join(BACKENDS)}')
    try:
        path = cache.cache_directory(cache_dir) / f'solver_{_key(structure)}.so'
        if cache.read(path) is None:
            cache.write(path, _compiled(structure, path.parent))
        return Library(path)
    except (CacheError, OSError):
        return _compiled_for_once(structure)


def _compiled_for_once(structure: Structure) -> Library:
    """Return the solver, compiled into a folder that is removed again."""
    try:
        with tempfile.TemporaryDirectory(prefix='manifold_mpc_') as folder:
            path = Path(folder) / 'solver.so'
            path.write_bytes(_compiled(structure, path.parent))
            return Library(path)  # stays mapped when its file is gone
    except OSError as error:
        raise SolverBuildError(
            f'no folder to compile the solver in: {error}; {cache.VARIABLE} names one') from error


def _compiled(structure: Structure, beside: Path) -> bytes:
    """Generate C, compile it in a folder beside the destination and return the library."""
    compiler = _compiler()
    with tempfile.TemporaryDirectory(dir=beside, prefix='build_') as folder:
        source, built = Path(folder) / 'solver.c', Path(folder) / 'solver.so'
        source.write_text(program_code(structure), encoding='utf-8')
        command = [*compiler, *_FLAGS, str(source), '-o', str(built), '-lm']
        try:
            result = subprocess.run(command, capture_output=True, text=True, check=False,
                                    timeout=_COMPILE_TIMEOUT_S)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise SolverBuildError(f'{compiler[0]} did not run: {error}') from error
        if result.returncode != 0:
            lines = result.stderr.strip().splitlines() or ['no message']
            raise SolverBuildError(f'{compiler[0]} failed on the generated solver: {lines[0]}')
        return built.read_bytes()


def _compiler() -> list[str]:
    """Return the C compiler's command: $CC with its arguments, else cc, gcc, clang or ziglang."""
    wanted = os.environ.get('CC')
    for command in (wanted,) if wanted is not None else ('cc', 'gcc', 'clang'):
        words = shlex.split(command)
        found = shutil.which(words[0]) if words else None
        if found:
            return [found, *words[1:]]
    if wanted is None and importlib.util.find_spec('ziglang') is not None:
        return [sys.executable, '-m', 'ziglang', 'cc']
    raise SolverBuildError(
        f'no C compiler found ({wanted or "cc, gcc, clang, or the Python package ziglang"}); '
        'install one, for example with: pip install ziglang')


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
