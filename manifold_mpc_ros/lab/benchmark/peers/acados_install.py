# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where acados is: a source build that ``ACADOS_SOURCE_DIR`` names, else the PyPI wheel.

The wheel `comma-deps-acados` brings a cut-down CasADi that would overwrite the one in use, so it
has a folder of its own, ``peers`` in the prefix of this Python:

    pip install --no-deps --target .venv/peers comma-deps-acados

(``make bench`` does that.) It lacks nothing but the layout of a source tree that its own Python
interface looks for; a folder of links gives it that.
"""

from __future__ import annotations

import ctypes
import importlib
import importlib.metadata
import os
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from manifold_mpc_ros.errors import ManifoldMpcError

WHEEL = 'comma-deps-acados'
SOURCE = 'ACADOS_SOURCE_DIR'
PEERS = Path(sys.prefix, 'peers')
_LIBRARIES = ('libblasfeo.so', 'libhpipm.so', 'libqpOASES_e.so', 'libdaqp.so')


@dataclass(frozen=True)
class Acados:
    """The Python interface and what the libraries behind it can do."""

    template: ModuleType
    version: str
    has_daqp: bool
    has_anderson: bool


def find_acados(folder: Path) -> Acados:
    """Load acados' libraries and its Python interface, with ``folder`` for links.

    Raises ManifoldMpcError when there is neither a source build nor the wheel.
    """
    warnings.filterwarnings('ignore', module='acados')
    root = os.environ.get(SOURCE)
    if root is None:
        package = PEERS / 'acados'
        if not package.is_dir():
            raise ManifoldMpcError(f'acados is not installed: pip install --no-deps --target '
                                   f'{PEERS} {WHEEL}, or set {SOURCE}')
        root = str(_linked(package, folder))
        sys.path.insert(0, str(package))
        version = _wheel_version()
    else:
        sys.path.insert(0, str(Path(root, 'interfaces', 'acados_template')))
        version = f'built from source ({SOURCE})'
    os.environ[SOURCE] = root
    libraries = Path(root, 'lib')
    for name in _LIBRARIES:  # loaded once, they are found by all that need them
        if (libraries / name).exists():
            ctypes.CDLL(str(libraries / name), mode=ctypes.RTLD_GLOBAL)
    template = importlib.import_module('acados_template')
    options = template.AcadosOcp().solver_options
    return Acados(template, version, (libraries / 'libdaqp.so').exists(),
                  hasattr(options, 'with_anderson_acceleration'))


def _linked(package: Path, folder: Path) -> Path:
    """Return a folder that looks like a source tree with the files of the wheel."""
    inner = folder / 'interfaces' / 'acados_template'
    inner.mkdir(parents=True)
    (inner / 'acados_template').symlink_to(package / 'acados_template')
    for name in ('lib', 'include', 'bin'):
        (folder / name).symlink_to(package / 'install' / name)
    return folder


def _wheel_version() -> str:
    """Return the name and version of the wheel in its folder."""
    found = next(iter(importlib.metadata.distributions(name=WHEEL, path=[str(PEERS)])), None)
    return f'{WHEEL} {found.version}' if found else WHEEL
