# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the operating system may give a process that must not wait: priority and memory."""

from __future__ import annotations

import ctypes
import gc
import os
from pathlib import Path

_MCL_CURRENT, _MCL_FUTURE = 1, 2


class Realtime:
    """Asks for SCHED_FIFO and locked memory, and says what was given.

    Arguments
    ---------
    priority
        SCHED_FIFO priority of every thread that runs when `enter` is called; 0 asks for nothing.
    lock_memory
        Whether to keep every page in memory.

    """

    def __init__(self, priority: int, *, lock_memory: bool) -> None:
        """Ask for nothing yet."""
        self._priority = priority
        self._lock_memory = lock_memory
        self.scheduling = 'normal'
        self.memory = 'normal'

    @property
    def refusal(self) -> str:
        """What was asked for and not given, empty when nothing."""
        return '; '.join(f'{what}: {said}' for what, said in (
            ('scheduling', self.scheduling), ('memory', self.memory))
            if said.startswith('not permitted'))

    def enter(self) -> None:
        """Ask; leave to the garbage collector only what is made from now on."""
        gc.collect()
        gc.freeze()
        if self._priority:
            try:
                for task in Path('/proc/self/task').iterdir():
                    _set_fifo(int(task.name), self._priority)
                self.scheduling = f'fifo {self._priority}'
            except OSError as error:
                self.scheduling = f'not permitted (fifo {self._priority}: {error.strerror})'
        if self._lock_memory:
            failed = ctypes.CDLL(None, use_errno=True).mlockall(_MCL_CURRENT | _MCL_FUTURE)
            self.memory = 'locked' if not failed else (
                f'not permitted (mlockall: {os.strerror(ctypes.get_errno())})')

    def enter_solver_thread(self) -> None:
        """Put the calling thread one below the others, so that a solver holds nobody up."""
        if self.scheduling.startswith('fifo'):
            _set_fifo(0, max(1, self._priority - 1))


def _set_fifo(thread: int, priority: int) -> None:
    """Give a thread (0: this one) a SCHED_FIFO priority; raises OSError."""
    os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
