# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every solver that is installed solves the same problem; one that is not says what is missing."""

from __future__ import annotations

import os

import numpy as np
import pytest

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.benchmark.measure import Settings, compare
from manifold_mpc_ros.lab.benchmark.peers import instances, problem, solver
from manifold_mpc_ros.lab.benchmark.peers.acados_install import PEERS
from manifold_mpc_ros.lab.benchmark.peers.solver import Entry
from manifold_mpc_ros.lab.benchmark.peers.worker import Worker

HORIZON = 5
STATE = instances.draw(1)[0].state
COMPARED = (solver.OUR_LOCAL, solver.OUR_SEARCH, solver.FATROP_VM, solver.IPOPT_VM)
SETTINGS = Settings(core=min(os.sched_getaffinity(0)), repeats=2, loops=1,
                    loop_steps=3, cold_budget_s=200.0, warm_budget_s=200.0)


def test_solvers_side_by_side() -> None:
    states = instances.draw(2)[:4]
    said: list[str] = []
    comparison = compare(HORIZON, COMPARED, states, SETTINGS, said.append)
    assert any('cold, instance 4 of 4' in text for text in said)
    for record in comparison.records:
        assert record.why_not == ''
        assert sorted(record.asked) == list(range(len(states)))
        assert all(answer.converged for answer in record.cold)
        assert record.peak_memory_bytes > 2e7
        best = comparison.best[record.entry.formulation]
        costs = np.array([answer.cost for answer in record.cold])
        assert (costs >= best[record.asked] * (1 - 1e-9)).all()
        for answer, (solver_s, call_s) in zip(record.cold, record.cold_s):
            assert np.abs(answer.torques_n_m).max() <= problem.MAX_TORQUE_N_M * (1 + 1e-6)
            assert 0 < solver_s <= call_s
        if record.entry.warm:
            assert len(record.warm) == len(record.warm_s) == SETTINGS.loop_steps
    search = comparison.records[COMPARED.index(solver.OUR_SEARCH)]
    best = comparison.best[solver.ON_THE_GROUP][search.asked]
    assert np.allclose([answer.cost for answer in search.cold], best, rtol=1e-6)


def test_acados_agrees_with_the_others() -> None:
    if not (PEERS / 'acados').is_dir():
        pytest.skip('acados is not installed (make bench installs it)')
    acados, ipopt = (Worker(entry, HORIZON, None) for entry in (
        solver.ACADOS_SQP, solver.IPOPT_VM))
    try:
        assert acados.wait().version
        ipopt.wait()
        theirs, reference = acados.cold(STATE, 1)[0], ipopt.cold(STATE, 1)[0]
        assert theirs.converged
        assert theirs.cost == pytest.approx(reference.cost, rel=1e-6)
        assert np.allclose(theirs.torques_n_m, reference.torques_n_m, atol=1e-4)
    finally:
        acados.end()
        ipopt.end()


@pytest.mark.parametrize(('entry', 'reason'), [
    (Entry('no module', 'nowhere:Solver', solver.ON_THE_GROUP), 'ModuleNotFoundError'),
    (Entry('no option', 'ours:Ours', solver.ON_THE_GROUP, {'search': True, 'device': 'gpu'}),
     'device'),
])
def test_what_cannot_be_built_says_why(entry: Entry, reason: str) -> None:
    worker = Worker(entry, HORIZON, None)
    try:
        with pytest.raises(ManifoldMpcError, match=reason):
            worker.wait()
    finally:
        worker.end()


def test_a_process_that_dies_is_an_error_with_its_name() -> None:
    worker = Worker(solver.OUR_LOCAL, HORIZON, None)
    worker.wait()
    worker.end()
    with pytest.raises(ManifoldMpcError, match=solver.OUR_LOCAL.name):
        worker.cold(STATE, 1)
