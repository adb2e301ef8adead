# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How long a process took for something, without what the machine made it wait."""

from __future__ import annotations

import os
import signal
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from harness import Process

#: On a signal a node ends within this [s].
LONGEST_END_S = 1.0


class OwnTime:
    """Time since the construction, less the waits for a processor of processes and of this one.

    The kernel's own account of every thread (run delay in schedstat); of one that ends, what it
    was at the last look. Threads that wait at the same time count each: below 0 on a busy machine.
    """

    def __init__(self, *pids: int) -> None:
        self._pids = (*pids, os.getpid())
        self._begun_s = time.monotonic()
        self._begun_ns = self._waits_ns()
        self._latest_ns = dict(self._begun_ns)

    def _waits_ns(self) -> dict[str, int]:
        waits = {}
        for task in (task for pid in self._pids for task in Path(f'/proc/{pid}/task').glob('*')):
            with suppress(OSError, IndexError):
                waits[task.name] = int((task / 'schedstat').read_text().split()[1])
        return waits

    def look(self) -> float:
        """Take the account up; return the time [s]."""
        self._latest_ns |= self._waits_ns()
        waited_ns = sum(self._latest_ns.values()) - sum(self._begun_ns.values())
        return time.monotonic() - self._begun_s - waited_ns / 1e9


def seconds_to_end(process: Process, number: signal.Signals) -> float:
    """Send a signal, demand exit status 0 without a traceback, return how long it took [s].

    On a machine that does nothing else: waits for a processor are not counted.
    """
    taken = OwnTime(process.pid)
    process.signal(number)
    while process.running:
        taken.look()
        time.sleep(0.002)
    taken_s = taken.look()
    assert process.wait() == 0, process.log
    assert 'Traceback' not in process.log
    return taken_s
