# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A real Dask cluster of several processes gives the table of one process, bit for bit."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import campaign_stubs as stubs
import pytest
from campaign_plans import mapping, plan, plants

from manifold_mpc_ros.campaigns import chunks, cluster
from manifold_mpc_ros.campaigns.case import all_names
from manifold_mpc_ros.campaigns.chunks import CampaignError, Work, run_on_processes
from manifold_mpc_ros.campaigns.cluster import connected
from manifold_mpc_ros.campaigns.outcome import Outcome
from manifold_mpc_ros.campaigns.table import write_table

TESTS = Path(__file__).parents[1]
WORKERS, START_LIMIT_S = 3, 60.0
PLAN = plan(*mapping()['sets'], plants(), duration_s=8.0).with_loops(None, 16)


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, 'CHUNK', 2)


@pytest.fixture(scope='module')
def processes(tmp_path_factory: pytest.TempPathFactory
              ) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and its workers, each a process; yields the address and the workers."""
    folder = tmp_path_factory.mktemp('dask')
    path = os.pathsep.join([str(TESTS.parent), str(TESTS), os.environ.get('PYTHONPATH', '')])
    environment = dict(os.environ, PYTHONPATH=path)
    started = []

    def start(*arguments: str) -> subprocess.Popen[bytes]:
        with (folder / f'{len(started)}.log').open('wb') as log:
            started.append(subprocess.Popen(
                [sys.executable, '-m', 'distributed.cli.dask_' + arguments[0], *arguments[1:],
                 '--scheduler-file', str(folder / 'scheduler.json')],
                stdout=log, stderr=subprocess.STDOUT, env=environment, cwd=folder))
        return started[-1]

    try:
        start('scheduler', '--host', '127.0.0.1', '--port', '0', '--no-dashboard', '--no-show')
        wait(lambda: (folder / 'scheduler.json').is_file())
        workers = [start('worker', '--no-nanny', '--nthreads', '1', '--no-dashboard',
                         '--local-directory', str(folder)) for _ in range(WORKERS)]
        yield json.loads((folder / 'scheduler.json').read_text())['address'], workers
    finally:
        for process in started:
            process.kill()
            process.wait()


def wait(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + START_LIMIT_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def table(found: list[Outcome], path: Path) -> bytes:
    """Return the table's bytes, rows in the order of the plan."""
    by_name = {outcome.name: outcome for outcome in found}
    assert len(by_name) == len(found)
    return write_table(PLAN, [by_name[str(name)] for name in all_names(PLAN)], path).read_bytes()


def test_one_process_and_a_cluster_that_loses_a_worker_give_the_same_bits(
    processes: tuple[str, list[subprocess.Popen[bytes]]], tmp_path: Path,
) -> None:
    address, workers = processes
    work = Work(PLAN, chunks.build_controller)
    names = all_names(PLAN)
    found: list[Outcome] = []
    with connected(address) as here:
        wait(lambda: here.threads == WORKERS)
        for chunk in here.run(work, names):
            if not found:
                workers[0].send_signal(signal.SIGKILL)
            found += chunk
        wait(lambda: here.threads == WORKERS - 1)
    alone = [o for chunk in run_on_processes(work, names, 1) for o in chunk]
    assert table(found, tmp_path / 'cluster.parquet') == table(alone, tmp_path / 'one.parquet')


def test_an_error_in_a_case_names_it(
    processes: tuple[str, list[subprocess.Popen[bytes]]],
) -> None:
    words = r'case \w+-\d+: ValueError: the third is too much'
    with connected(processes[0]) as here, pytest.raises(CampaignError, match=words):
        list(here.run(Work(PLAN, stubs.make_thrower), all_names(PLAN)))


def test_workers_with_other_software_are_refused(
    processes: tuple[str, list[subprocess.Popen[bytes]]], monkeypatch: pytest.MonkeyPatch,
) -> None:
    other = {**cluster.software(), 'numpy': '0.0'}
    monkeypatch.setattr(cluster, 'software', lambda: other)
    words = r'a worker has numpy .* where this process has 0.0'
    with connected(processes[0]) as here, pytest.raises(CampaignError, match=words):
        list(here.run(Work(PLAN, stubs.make_damping), all_names(PLAN)))


def test_no_scheduler_and_no_dask_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, 'CONNECT_LIMIT_S', 1.0)
    with (pytest.raises(CampaignError, match=r"no Dask scheduler at 'tcp://127\.0\.0\.1:9'"),
          connected('tcp://127.0.0.1:9')):
        pass
    monkeypatch.setitem(sys.modules, 'distributed', None)
    with (pytest.raises(CampaignError, match=r"pip install 'manifold_mpc_ros\[cluster\]'"),
          connected('tcp://127.0.0.1:9')):
        pass
