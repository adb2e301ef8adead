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

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.campaign import cluster
from manifold_mpc_ros.lab.campaign.case import all_names
from manifold_mpc_ros.lab.campaign.chunks import CHUNK, CampaignError, Work, in_chunks
from manifold_mpc_ros.lab.campaign.cluster import connected

TESTS = Path(__file__).parents[1]
WORKERS, START_LIMIT_S = 3, 60.0
PLAN = plan(*mapping()['sets'], plants(), duration_s=3.0).with_loops(None, 24)


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


def campaign(path: Path, output: Path, *arguments: str) -> subprocess.Popen[str]:
    """Start the command."""
    python_path = os.pathsep.join([str(TESTS.parent), os.environ.get('PYTHONPATH', '')])
    return subprocess.Popen(
        [sys.executable, '-m', 'manifold_mpc_ros.cli.main', 'campaign', str(path),
         '-o', str(output), *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        env=dict(os.environ, PYTHONPATH=python_path))


def test_one_process_and_a_cluster_that_loses_a_worker_give_the_same_bits(
    processes: tuple[str, list[subprocess.Popen[bytes]]], tmp_path: Path,
) -> None:
    address, workers = processes
    path, journal = tmp_path / 'small.yaml', tmp_path / 'cluster' / 'loops.jsonl'
    path.write_text(PLAN.as_yaml(), encoding='utf-8')
    with connected(address) as here:
        wait(lambda: here.threads == WORKERS)
        running = campaign(path, tmp_path / 'cluster', '--scheduler', address)
        try:
            wait(lambda: journal.is_file() and journal.read_bytes().count(b'\n') > 1)
            workers[0].send_signal(signal.SIGKILL)
            done = journal.read_bytes().count(b'\n') - 1
            out, _ = running.communicate(timeout=240)
        finally:
            running.kill()
        assert here.threads == WORKERS - 1
    assert 'Dask cluster' in out
    assert done < len(in_chunks(all_names(PLAN), CHUNK)) // 2
    alone = campaign(path, tmp_path / 'one', '--workers', '1')
    assert '72 of 72 closed loops' in alone.communicate(timeout=240)[0]
    assert alone.returncode == running.returncode, out
    tables = [(tmp_path / name / 'loops.parquet').read_bytes() for name in ('cluster', 'one')]
    assert tables[0] == tables[1]


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
    with (pytest.raises(ManifoldMpcError, match=r"pip install 'manifold_mpc_ros\[cluster\]'"),
          connected('tcp://127.0.0.1:9')):
        pass
