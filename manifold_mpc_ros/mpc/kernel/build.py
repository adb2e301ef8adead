# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The solver compiled from generated C and cached, or in CasADi's virtual machine.

The compiled library depends on the problem's structure only (forcing, target, which inequalities
exist); the horizon and all numbers are run-time values. Its file name is a hash of the structure,
of the sources that generate it, of CasADi, of the compiler and of the processor, and it appears
in the cache by an atomic rename: concurrent starts can at worst compile the same thing twice. A
checksum ends the file, because loading a truncated library would end the process.
"""

from __future__ import annotations

import hashlib
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
from manifold_mpc_ros.mpc.kernel.generate import program_code
from manifold_mpc_ros.mpc.kernel.interpreted import InterpretedSolver, Parts
from manifold_mpc_ros.mpc.kernel.native import Library, NativeSolver
from manifold_mpc_ros.mpc.kernel.passes import program_of
from manifold_mpc_ros.mpc.kernel.solver import LocalSolver
from manifold_mpc_ros.mpc.kernel.structure import Structure
from manifold_mpc_ros.mpc.scaling import Array

BACKENDS = ('auto', 'c', 'vm')
# No contraction into fused multiply-add: compiled C and the virtual machine then execute the
# same sequence of roundings (test_backends.py compares them bit by bit).
_FLAGS = ('-std=gnu11', '-O2', '-march=native', '-ffp-contract=off', '-fno-math-errno', '-fPIC',
          '-shared')
_COMPILE_TIMEOUT_S = 300
_CHECKSUM = hashlib.sha256().digest_size

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
            library = _load_library(structure, _cache_directory(cache_dir))
            return lambda numbers: NativeSolver(library, structure, horizon, numbers), 'c'
        except SolverBuildError:
            if backend == 'c':
                raise
    parts = Parts(program_of(structure), horizon)
    return lambda numbers: InterpretedSolver(parts, structure, numbers), 'vm'


def _load_library(structure: Structure, cache: Path) -> Library:
    """Return the compiled solver, from the cache or freshly compiled."""
    path = cache / f'solver_{_key(structure)}.so'
    if not _is_intact(path):
        _compile(structure, path)
    return Library(path)


def _is_intact(library: Path) -> bool:
    """Return whether a library is there and ends with the checksum of the rest."""
    try:
        content = library.read_bytes()
    except OSError:
        return False
    return hashlib.sha256(content[:-_CHECKSUM]).digest() == content[-_CHECKSUM:]


def _compile(structure: Structure, library: Path) -> None:
    """Generate C, compile it beside its destination and move it there atomically."""
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
        with built.open('r+b') as file:
            checksum = hashlib.sha256(file.read()).digest()
            file.write(checksum)
        os.replace(built, library)


def _compiler() -> list[str]:
    """Return the C compiler's command: $CC with its arguments, else cc, gcc or clang."""
    wanted = os.environ.get('CC')
    for command in (wanted,) if wanted is not None else ('cc', 'gcc', 'clang'):
        words = shlex.split(command)
        found = shutil.which(words[0]) if words else None
        if found:
            return [found, *words[1:]]
    raise SolverBuildError(f'no C compiler found ({wanted or "cc, gcc, clang"})')


def _cache_directory(cache_dir: str | Path | None) -> Path:
    """Return a writable directory: the given one, $MANIFOLD_MPC_CACHE, or the user's cache."""
    base = os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache'
    chosen = cache_dir or os.environ.get('MANIFOLD_MPC_CACHE') or Path(base) / 'manifold_mpc_ros'
    path = Path(chosen)
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            return path
    except OSError as error:
        raise SolverBuildError(f'cannot write to the solver cache {path}: {error}') from error


def _hash_sources() -> str:
    """Return the hash of the files that generate the code."""
    digest = hashlib.sha256()
    kernel = Path(__file__).resolve().parent
    package = kernel.parent.parent
    for source in sorted([*kernel.glob('*.*'), *package.glob('*/symbolic.py'),
                          package / 'dynamics' / 'scalar_form.py',
                          package / 'mpc' / 'scaling.py']):
        digest.update(source.read_bytes())
    return digest.hexdigest()


# Taken when the modules are imported: sources that change later are not what runs here.
_SOURCES = _hash_sources()


def _key(structure: Structure) -> str:
    """Return the hash that names the compiled library of a structure on this machine."""
    command = _compiler()
    compiler = Path(command[0]).resolve()
    facts = (_SOURCES, structure, ca.CasadiMeta.version(), _FLAGS, command, compiler,
             compiler.stat().st_mtime_ns, platform.machine(), _processor_flags())
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:24]


def _processor_flags() -> str:
    """Return the processor's feature flags, so that a shared cache suits every host."""
    try:
        lines = Path('/proc/cpuinfo').read_text(encoding='ascii', errors='replace').splitlines()
    except OSError:
        return platform.processor()
    return next((line for line in lines if line.startswith(('flags', 'Features'))), '')
