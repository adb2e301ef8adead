# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The solver's functions, from a cache of compiled C or in CasADi's virtual machine.

The compiled library depends on the problem's structure only (horizon, forcing, which
inequalities exist); numbers are run-time parameters. Its file name is a hash of the structure,
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
from pathlib import Path

import casadi as ca

from manifold_mpc_ros.errors import ConfigurationError, SolverBuildError
from manifold_mpc_ros.mpc import guess, sqp
from manifold_mpc_ros.mpc.structure import Structure

FUNCTIONS = ('initial_node', 'start', 'iterate', 'stage_cost', 'terminal_value')
# The modules of this package that the generated code comes from.
_GENERATORS = ('scaling', 'structure', 'stage', 'curvature', 'backward', 'forward', 'guess', 'sqp',
               'build')
BACKENDS = ('auto', 'c', 'vm')
# No contraction into fused multiply-add: compiled C and the virtual machine then execute the
# same sequence of roundings (test_backends.py compares them bit by bit).
_FLAGS = ('-O2', '-march=native', '-ffp-contract=off', '-fPIC', '-shared')
_COMPILE_TIMEOUT_S = 300
_CHECKSUM = hashlib.sha256().digest_size


def build_functions(structure: Structure) -> list[ca.Function]:
    """Return the solver's functions as CasADi graphs, in the order of FUNCTIONS."""
    return [guess.initial_node(), sqp.start_function(structure),
            sqp.iterate_function(structure, sqp.PASSES_PER_CALL), guess.stage_cost(),
            guess.terminal_value(structure)]


def load_functions(structure: Structure, backend: str, cache_dir: str | Path | None
                   ) -> tuple[list[ca.Function], str]:
    """Return the solver's functions and the backend in use, 'c' or 'vm'.

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
            return _load_compiled(structure, _cache_directory(cache_dir)), 'c'
        except SolverBuildError:
            if backend == 'c':
                raise
    return build_functions(structure), 'vm'


def _load_compiled(structure: Structure, cache: Path) -> list[ca.Function]:
    """Return the compiled functions, from the cache or freshly compiled."""
    library = cache / f'solver_{_key(structure)}.so'
    if not _is_intact(library):
        _compile(structure, library)
    return _open(library)


def _is_intact(library: Path) -> bool:
    """Return whether a library is there and ends with the checksum of the rest."""
    try:
        content = library.read_bytes()
    except OSError:
        return False
    return hashlib.sha256(content[:-_CHECKSUM]).digest() == content[-_CHECKSUM:]


def _open(library: Path) -> list[ca.Function]:
    """Return the functions of an intact library."""
    try:
        return [ca.external(name, str(library)) for name in FUNCTIONS]
    except RuntimeError as error:
        raise SolverBuildError(f'cannot load the compiled solver {library}: {error}') from error


def _compile(structure: Structure, library: Path) -> None:
    """Generate C, compile it beside its destination and move it there atomically."""
    compiler = _compiler()
    with tempfile.TemporaryDirectory(dir=library.parent, prefix='build_') as folder:
        generator = ca.CodeGenerator('solver.c')
        for function in build_functions(structure):
            generator.add(function)
        generator.generate(f'{folder}{os.sep}')
        built = Path(folder) / 'solver.so'
        command = [*compiler, *_FLAGS, str(Path(folder) / 'solver.c'), '-o', str(built), '-lm']
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
    """Return the hash of the modules that generate the code."""
    digest = hashlib.sha256()
    package = Path(__file__).resolve().parent.parent
    for source in sorted([*(package / 'mpc' / f'{name}.py' for name in _GENERATORS),
                          *package.glob('*/symbolic.py'),
                          package / 'dynamics' / 'scalar_form.py']):
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
