# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is worked out of measurements: aims, where we are behind, operations, instructions."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.benchmark import flops, instructions, startup, targets
from manifold_mpc_ros.lab.benchmark.peers import solver


def row(entry: solver.Entry, start: str, median: float, p99: float, **more: Any) -> dict[str, Any]:
    """Return a row as a run gives it."""
    return {'solver': entry.name, 'horizon': 10, 'ours': entry.ours, 'start': start,
            'solver_us_median': median, 'solver_us_p99': p99, 'failures': 0,
            'largest_excess': 1e-9, **more}


ROWS = [
    row(solver.OUR_LOCAL, 'cold', 40, 90), row(solver.OUR_SEARCH, 'cold', 190, 300),
    row(solver.OUR_SEARCH, 'warm', 20, 60), row(solver.ACADOS_SQP, 'cold', 200, 400),
    row(solver.ACADOS_DAQP, 'cold', 100, 500), row(solver.ACADOS_SQP, 'warm', 50, 100),
    row(solver.ACADOS_RTI, 'warm', 22, 25), row(solver.IPOPT, 'cold', 3000, 5000),
]


def test_aims_take_the_fastest_acados_of_each_figure() -> None:
    found = {aim['aim']: (aim['value'], aim['met']) for aim in targets.targets(ROWS, [])}
    assert found['cold local median over acados SQP'] == (0.4, True)
    assert found['cold local p99 over acados SQP'] == (0.225, True)
    assert found['cold search median over acados SQP'] == (1.9, False)
    assert found['warm median over acados SQP'] == (0.4, True)
    assert found['warm p99 over acados SQP'] == (0.6, False)
    assert found['warm median over one acados RTI iteration'][1]
    assert not any('N = 160' in name or 'without a compiler' in name for name in found)


def test_failures_dear_plans_growth_and_start_count() -> None:
    rows = [row(solver.OUR_SEARCH, 'cold', 10, 20, failures=1, largest_excess=2e-6),
            row(solver.OUR_SEARCH, 'cold', 210, 300, horizon=160)]
    started = [{'solver': solver.OUR_SEARCH.name, 'first_build_s': 6.0, 'cached_build_s': 0.4}]
    met = {(aim.get('horizon'), aim['aim']): aim['met'] for aim in targets.targets(rows, started)}
    assert not met[10, 'failures, search']
    assert met[160, 'failures, search']
    assert not met[10, 'excess of the search over the best known cost']
    assert not met[None, 'N = 160 over N = 10, ours, search, cold median']
    assert not met[None, 'first start [s]']
    assert met[None, 'cached start beyond imports [s]']


def test_every_figure_that_is_behind_is_said() -> None:
    assert targets.losses(ROWS) == [
        'N = 10, warm p99: acados RTI, one step 25 us, ours, search 60 us']


def test_operations_of_a_riccati_step() -> None:
    # One state, one input: 2 for P [A B] each, then 3 entries of a product, and so on.
    assert flops._riccati(1, 1) == (2 * 2 + 2 * 3) + (2 + 4) + (0 + 1) + 4 + (2 + 2)
    parts = flops.pass_operations(20)
    assert parts['all'] == sum(parts.values()) - parts['all']
    assert parts['all'] == 2 * flops.pass_operations(10)['all']
    assert flops.bound(10, 1e9)['bound_us'] == pytest.approx(parts['all'] / 2000, abs=1e-3)


@pytest.mark.skipif(shutil.which('cc') is None, reason='no C compiler')
def test_the_cores_rate_is_one_of_a_processor() -> None:
    assert 1e8 < flops.core_rate(min(os.sched_getaffinity(0))) < 1e12


PROFILE = """\
events: Ir
ob=(1) /lib/solver.so
fn=(1) pass
0 100
+3 20
calls=2 0
0 5000
cob=(2) /lib/libm.so.6
cfn=(2) sin
calls=4 0
* 400
0 7
ob=(2)
fn=(2)
0 400
ob=(1)
fn=(1)
0 1
totals: 528
"""


def test_instructions_belong_to_the_library_that_executes_them() -> None:
    assert instructions.by_object(PROFILE.splitlines(keepends=True)) == {
        '/lib/solver.so': 128, '/lib/libm.so.6': 400}


def test_without_valgrind_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('PATH', '')
    with pytest.raises(ManifoldMpcError, match='valgrind'):
        instructions.count(solver.OUR_LOCAL, 5, 1, 0)


def test_start_up_of_a_fresh_process() -> None:
    core = min(os.sched_getaffinity(0))
    found = startup.start_up(solver.OUR_LOCAL, 5, core)
    assert found['first_build_s'] > 0
    assert found['cached_build_s'] > 0
    assert found['imports_s'] > 0
    assert found['peak_memory_mb'] > 20


def test_memory_is_this_programs_own() -> None:
    """A child of a large process that holds little says little."""
    held = np.ones(40_000_000)  # 320 MB
    program = ('from manifold_mpc_ros.lab.benchmark.peers.memory import peak_memory_bytes\n'
               'print(peak_memory_bytes())')
    done = subprocess.run([sys.executable, '-c', program], text=True, capture_output=True,
                          check=True, cwd=Path(__file__).parents[2])
    assert 1e6 < int(done.stdout) < held.nbytes / 2
