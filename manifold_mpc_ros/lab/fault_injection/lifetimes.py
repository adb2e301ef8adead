# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the kernel knows of a node's process: memory, waiting for a processor, children."""

from __future__ import annotations

import os
import signal
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from manifold_mpc_ros.cli.processes import NodeProcess

TRACEBACK = b'Traceback (most recent call last)'
_PAGE_BYTES = os.sysconf('SC_PAGE_SIZE')


@dataclass
class Life:
    """One process of a node from its start to its end, and the memory that it had."""

    process: NodeProcess
    begun_s: float
    memory: list[tuple[float, int]] = field(default_factory=list)
    _read_to: int = 0
    _children: dict[int, str] = field(default_factory=dict)

    def new_tracebacks(self) -> int:
        """Return how many tracebacks the process has written since the last call."""
        with self.process.log_path.open('rb') as log:
            log.seek(self._read_to)
            lines, _, _ = log.read().rpartition(b'\n')
        self._read_to += len(lines) + bool(lines)
        return lines.count(TRACEBACK)

    def waits_ns(self) -> dict[str, int]:
        """Return how long each thread has waited for a processor that it could have used [ns].

        The kernel's own account (run delay in schedstat): not the doing of the process.
        """
        waits = {}
        for task in Path(f'/proc/{self.process.pid}/task').glob('*'):
            with suppress(OSError, IndexError):
                waits[task.name] = int((task / 'schedstat').read_text().split()[1])
        return waits

    def sample(self, now_s: float) -> None:
        """Note the resident memory [bytes], and the processes that this one has started."""
        self.note_children()
        try:
            pages = int(Path(f'/proc/{self.process.pid}/statm').read_text().split()[1])
        except (OSError, IndexError):
            return
        if pages:  # none are left of a process that has ended
            self.memory.append((now_s, pages * _PAGE_BYTES))

    def note_children(self) -> None:
        """Note which processes this one has started."""
        for task in Path(f'/proc/{self.process.pid}/task').glob('*'):
            with suppress(OSError):
                for child in map(int, (task / 'children').read_text().split()):
                    self._children[child] = _begin_of(child)

    def left_behind(self) -> list[str]:
        """Return the processes that this one has started and that live, when it does not."""
        if self.process.exit_status is None:
            return []
        return [f'{self.process.name} left the process {child} behind'
                for child, begin in self._children.items() if begin and _begin_of(child) == begin]

    def end_children(self) -> None:
        """End what was left behind."""
        if self.left_behind():
            for child, begin in self._children.items():
                if begin and _begin_of(child) == begin:
                    with suppress(ProcessLookupError):
                        os.kill(child, signal.SIGKILL)


def _begin_of(pid: int) -> str:
    """Return when a process was started (its number may be another's later), '' when it ended."""
    try:
        state, *fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    except OSError:
        return ''
    return '' if state == 'Z' else fields[18]
