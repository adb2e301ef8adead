# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Start-up in fresh processes: imports, building with an empty cache, and building again."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.benchmark.peers.driver import Task
from manifold_mpc_ros.lab.benchmark.peers.solver import ENTRIES, Entry

_PATIENCE_S = 600.0
_CACHE = 'MANIFOLD_MPC_CACHE'


def start_up(entry: Entry, horizon: int, core: int) -> dict[str, Any]:
    """Return the row of one solver: seconds and megabytes of a process that solves once.

    First start: our cache is empty; the peers, which have none here, build at each start.
    """
    row: dict[str, Any] = {'solver': entry.name, 'horizon': horizon}
    with tempfile.TemporaryDirectory(prefix='bench_cache_') as cache:
        try:
            first = _run(entry, horizon, core, Path(cache))
            again = _run(entry, horizon, core, Path(cache)) if entry.ours else None
        except ManifoldMpcError as error:
            return {**row, 'why_not': str(error)}
    row['imports_s'] = first['process_s'] - first['build_s'] - first['solves_s']
    row['first_build_s'] = first['build_s']
    if again:
        row['cached_build_s'] = again['build_s']
    row['peak_memory_mb'] = (again or first)['peak_memory_bytes'] / 1e6
    return {key: round(value, 3) if isinstance(value, float) else value
            for key, value in row.items()}


def _run(entry: Entry, horizon: int, core: int, cache: Path) -> dict[str, Any]:
    """Return what a driver reports, and its wall clock."""
    task = Task(ENTRIES.index(entry), horizon, cold=1, core=core)
    begin = time.perf_counter()
    try:
        done = subprocess.run(
            task.command, text=True, capture_output=True, check=False, timeout=_PATIENCE_S,
            env={**os.environ, _CACHE: str(cache)})
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ManifoldMpcError(f'{type(error).__name__}: {error}') from None
    process_s = time.perf_counter() - begin
    if done.returncode != 0:
        raise ManifoldMpcError((done.stderr.strip().splitlines() or ['no message'])[-1][:200])
    return {**json.loads(done.stdout.strip().splitlines()[-1]), 'process_s': process_s}
