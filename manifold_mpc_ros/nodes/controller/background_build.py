# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Building another control law in the background, while the present one keeps working."""

from __future__ import annotations

import multiprocessing
import os
import queue
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from manifold_mpc_ros.errors import ManifoldMpcError

Built = TypeVar('Built')


class Rebuild(Generic[Built]):
    """Builds one thing at a time in a thread; of several that wait only the newest is built."""

    def __init__(self) -> None:
        """Have nothing to build."""
        self._done: queue.SimpleQueue[Built | ManifoldMpcError] = queue.SimpleQueue()
        self._next: Callable[[], Built] | None = None
        self.building = False

    def request(self, build: Callable[[], Built]) -> None:
        """Build this next."""
        self._next = build
        if not self.building:
            self._begin()

    def poll(self) -> Built | ManifoldMpcError | None:
        """Return what was built, or why it could not be, once; None when there is no news."""
        if not self.building:
            return None
        try:
            result = self._done.get_nowait()
        except queue.Empty:
            return None
        self.building = False
        if self._next is not None:
            self._begin()
            return None  # already out of date
        return result

    def forget(self) -> None:
        """Leave aside what is being built, and what waits."""
        self._done = queue.SimpleQueue()
        self._next = None
        self.building = False

    def _begin(self) -> None:
        """Start the thread, which does not keep the process from ending."""
        build, self._next, self.building = self._next, None, True
        threading.Thread(
            target=self._run, args=(build, self._done), name='rebuild', daemon=True).start()

    @staticmethod
    def _run(
        build: Callable[[], Built], done: queue.SimpleQueue[Built | ManifoldMpcError],
    ) -> None:
        """Build, and hand over the result or the reason."""
        try:
            done.put(build())
        except ManifoldMpcError as error:
            done.put(error)
        except Exception as error:  # noqa: BLE001  (said on /diagnostics and in the log)
            done.put(ManifoldMpcError(f'{type(error).__name__}: {error}'))


def end_with_parent() -> None:
    """Have this process leave when its parent is gone, which an idle worker would not notice."""
    threading.Thread(target=_wait_for_the_end, daemon=True).start()


def _wait_for_the_end() -> None:
    """Wait until the parent has ended, then end."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
