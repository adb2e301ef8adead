# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the bits of a campaign depend on besides its plan."""

from __future__ import annotations

import functools
import hashlib
import platform
from pathlib import Path

import casadi
import numpy as np

#: Folders of the package that no case runs through.
OUTSIDE = ('cli', 'nodes', 'lab/recording/bags', 'lab/recording/nodes', 'lab/report')


def software() -> dict[str, str]:
    """Return names and versions: the sources that run, Python, numpy, CasADi, the machine."""
    return {'code': code_digest(), 'python': platform.python_version(), 'numpy': np.__version__,
            'casadi': casadi.__version__, 'machine': platform.machine()}


@functools.cache
def code_digest() -> str:
    """Return a digest of the package's sources that a case runs through."""
    top = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for path in sorted(top.rglob('*.py')):
        name = path.relative_to(top).as_posix()
        if not name.startswith(OUTSIDE):
            digest.update(name.encode() + b'\0' + path.read_bytes())
    return digest.hexdigest()[:16]
