# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Processes that share a list of jobs, each with a state of its own that it builds once.

Workers of joblib have no such state, and outlive a parent that is killed (docs/libraries.md).
"""

from __future__ import annotations

import multiprocessing
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import resource_tracker
from types import TracebackType
from typing import Any, Generic, TypeVar

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.nodes.controller.background_build import end_with_parent

State = TypeVar('State')
Job = TypeVar('Job')
Result = TypeVar('Result')


class WorkerDiedError(ManifoldMpcError):
    """A worker process ended before its job did."""


class Workers(Generic[State]):
    """A pool of processes as a context manager; a single worker is this process itself.

    ``make`` is called once in each worker; ``run`` maps a function of (state, job) over jobs.
    Both have to be importable, and an error that a job raises has to survive pickling.
    """

    def __init__(self, make: Callable[[], State], workers: int) -> None:
        """Prepare; processes start with the first job."""
        self._make, self._workers = make, workers
        self._state: State | None = None
        self._pool: ProcessPoolExecutor | None = None

    def __enter__(self) -> Workers[State]:
        """Return the pool."""
        if self._workers > 1:
            self._pool = ProcessPoolExecutor(
                self._workers, mp_context=multiprocessing.get_context('spawn'),
                initializer=_initialise, initargs=(self._make,))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """End the processes after the jobs that are being run."""
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)

    def run(self, function: Callable[[State, Job], Result], jobs: Sequence[Job]
            ) -> Iterator[tuple[int, Result]]:
        """Yield (index of the job, result) in whatever order the jobs end.

        Raises what a job raises, and WorkerDiedError when a worker dies.
        """
        if self._pool is None:
            for index, job in enumerate(jobs):
                if self._state is None:
                    self._state = self._make()
                yield index, function(self._state, job)
            return
        with _interrupts_held():
            index_of = {self._pool.submit(_run, function, job): index
                        for index, job in enumerate(jobs)}
        for future in as_completed(index_of):
            try:
                yield index_of[future], future.result()
            except BrokenProcessPool:
                raise WorkerDiedError(
                    'a worker process died (ended from outside, or short of memory); '
                    'fewer --workers need less memory') from None


_state: Any = None


def _initialise(make: Callable[[], Any]) -> None:
    """Prepare a worker process: interrupts are for the parent, and its end is ours."""
    global _state
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    end_with_parent()
    _state = make()


def _run(function: Callable[[Any, Any], Any], job: Any) -> Any:
    """Run one job in a worker process."""
    return function(_state, job)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Keep interrupts for the end of the block, and from processes that start inside.

    Those block them until `_initialise` has run; one that comes meanwhile is raised here then. To
    block them in this thread is not enough: another one, of a library, may get the signal, and
    Python would raise it here, in the middle of a start.
    """
    resource_tracker.ensure_running()  # its start would unblock them
    handler, came = signal.getsignal(signal.SIGINT), []
    holds = callable(handler) and threading.current_thread() is threading.main_thread()
    if holds:
        signal.signal(signal.SIGINT, lambda *_: came.append(True))
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if holds:
            signal.signal(signal.SIGINT, handler)
    if came:
        signal.raise_signal(signal.SIGINT)
