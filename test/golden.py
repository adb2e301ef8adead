# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The golden bags, for the tests of everything that reads bags."""

from __future__ import annotations

from pathlib import Path

from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bags.run import read_run

GOLDEN = Path(__file__).parent / 'recording' / 'golden'
NAMES = sorted(path.stem for path in GOLDEN.glob('*.mcap'))
#: The controller of this bag is broken on purpose, and these limits have to say so.
BROKEN = {'mistuned': ['settle_time_s', 'final_error_deg']}


def truncated(name: str, folder: Path) -> Path:
    """Write the beginning of a golden bag, some of its states but not all; return where."""
    data, path = (GOLDEN / f'{name}.mcap').read_bytes(), folder / 'part.mcap'
    whole = len(read_run(GOLDEN / f'{name}.mcap').states)
    for part in range(99, 0, -1):
        path.write_bytes(data[:part * len(data) // 100])
        try:
            if len(read_run(path).states) < whole:
                return path
        except BagError:
            break
    raise AssertionError(f'{name} has all of its states in one chunk')
