# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The most memory that this process has held."""

from __future__ import annotations

import resource
from pathlib import Path

_KIB = 1024


def peak_memory_bytes() -> int:
    """Return the peak of resident memory since this program began.

    The kernel's `ru_maxrss` does not begin anew with a program: a small one has the peak of
    whoever started it. It is the answer only where /proc has none.
    """
    try:
        lines = Path('/proc/self/status').read_text(encoding='ascii', errors='replace')
        return next(int(line.split()[1]) for line in lines.splitlines()
                    if line.startswith('VmHWM')) * _KIB
    except (OSError, StopIteration):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _KIB
