# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Files that a later start finds ready: where they lie, and how a damaged one is told.

A file appears by an atomic rename and ends with a checksum of the rest; its name is a hash of
everything that its content follows from. Whoever finds none, or a damaged one, makes it anew.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

from manifold_mpc_ros.errors import CacheError

#: The environment variable that names the directory.
VARIABLE = 'MANIFOLD_MPC_CACHE'
_CHECKSUM = hashlib.sha256().digest_size
_PACKAGE = Path(__file__).resolve().parent.parent


def cache_directory(cache_dir: str | Path | None) -> Path:
    """Return a writable directory: the given one, $MANIFOLD_MPC_CACHE, or the user's cache.

    Raises CacheError when it cannot be written to.
    """
    try:
        path = _wanted(cache_dir)
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            return path
    except (OSError, RuntimeError) as error:  # RuntimeError: nobody's home is known
        reason = str(error).rstrip('.')
        raise CacheError(f'no solver cache: {reason}; {VARIABLE} names another folder') from error


def why_no_cache() -> str:
    """Return in a sentence why every start builds the solver again, '' where it is kept."""
    try:
        cache_directory(None)
        return ''
    except CacheError as error:
        return f'{error}; every start builds the solver again'


def _wanted(cache_dir: str | Path | None) -> Path:
    """Return the directory that is asked for; raises RuntimeError where the user has no home."""
    if chosen := cache_dir or os.environ.get(VARIABLE):
        return Path(chosen)
    base = os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache'
    return Path(base) / 'manifold_mpc_ros'


def name_of(*facts: object) -> str:
    """Return the part of a file name that says what the content follows from."""
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:24]


def hash_of_sources(*patterns: str) -> str:
    """Return the hash of the package's files that match, patterns relative to the package."""
    digest = hashlib.sha256()
    for source in sorted(_matching(patterns)):
        digest.update(source.read_bytes())
    return digest.hexdigest()


def _matching(patterns: Iterable[str]) -> set[Path]:
    return {path for pattern in patterns for path in _PACKAGE.glob(pattern) if path.is_file()}


def read(path: Path) -> bytes | None:
    """Return the content of a file, None where it is missing or damaged."""
    try:
        sealed = path.read_bytes()
    except OSError:
        return None
    content, checksum = sealed[:-_CHECKSUM], sealed[-_CHECKSUM:]
    return content if hashlib.sha256(content).digest() == checksum else None


def write(path: Path, content: bytes) -> None:
    """Put a file with its checksum where others find it, whole or not at all."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix='build_')
    try:
        with os.fdopen(handle, 'wb') as file:
            file.write(content + hashlib.sha256(content).digest())
        os.replace(name, path)
    except OSError:
        Path(name).unlink(missing_ok=True)
        raise
