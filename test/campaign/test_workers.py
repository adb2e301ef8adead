# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Processes that share jobs: each builds once, errors come through, a dead worker is an error."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import pytest

from manifold_mpc_ros.errors import DesignError, ManifoldMpcError
from manifold_mpc_ros.lab.workers import Workers

Built = list[int]


def build() -> Built:
    """Return a state that counts the jobs of its process."""
    return []


def square(state: Built, job: int) -> tuple[int, int, int]:
    """Return the square, the process, and how many jobs it has had."""
    state.append(job)
    return job ** 2, os.getpid(), len(state)


def refuse(_state: Built, job: int) -> int:
    """Fail on one of the jobs."""
    if job == 3:
        raise DesignError('job 3 cannot be done')
    return job


def die(_state: Built, job: int) -> int:
    """End the process."""
    os._exit(job)


@pytest.mark.parametrize('processes', [1, 2])
def test_every_job_is_done_with_a_state_of_its_process(processes: int) -> None:
    with Workers(build, processes) as workers:
        first, second = (dict(workers.run(square, range(6))) for _ in range(2))
    assert [first[index][0] for index in range(6)] == [0, 1, 4, 9, 16, 25]
    pids = {pid for _, pid, _ in first.values()} | {pid for _, pid, _ in second.values()}
    assert len(pids) <= processes
    assert (os.getpid() in pids) == (processes == 1)
    # The state outlives a list of jobs: the counts go on.
    assert max(count for *_, count in second.values()) > len(second) / processes


@pytest.mark.parametrize('processes', [1, 2])
def test_the_error_of_a_job_comes_through(processes: int) -> None:
    with Workers(build, processes) as workers:
        with pytest.raises(DesignError, match='job 3 cannot be done'):
            dict(workers.run(refuse, range(6)))
        assert dict(workers.run(square, [7]))[0][0] == 49


@pytest.fixture
def interrupts() -> Iterator[None]:
    """Take interrupts even where the tests themselves were started to ignore them."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def to_this_thread() -> None:
    signal.pthread_kill(threading.get_ident(), signal.SIGINT)


def to_another_thread() -> None:
    """As the threads of OpenBLAS, which block nothing, get what is sent to the process."""
    def take() -> None:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        to_this_thread()

    other = threading.Thread(target=take)
    other.start()
    other.join()


@pytest.mark.parametrize('interrupt', [to_this_thread, to_another_thread])
@pytest.mark.usefixtures('interrupts')
def test_an_interrupt_while_processes_start_is_raised_when_they_have(
        monkeypatch: pytest.MonkeyPatch, interrupt: Callable[[], None]) -> None:
    submit, submitted = ProcessPoolExecutor.submit, []

    def interrupted(pool: ProcessPoolExecutor, *arguments: Any) -> Any:
        interrupt()
        submitted.append(submit(pool, *arguments))
        return submitted[-1]

    monkeypatch.setattr(ProcessPoolExecutor, 'submit', interrupted)
    with Workers(build, 2) as workers, pytest.raises(KeyboardInterrupt):
        dict(workers.run(square, range(3)))
    assert len(submitted) == 3
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_worker_that_dies_is_an_error() -> None:
    with Workers(build, 2) as workers, pytest.raises(
            ManifoldMpcError, match='a worker process died'):
        dict(workers.run(die, [1, 1]))
