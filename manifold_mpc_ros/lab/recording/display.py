# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How far a recording or a replay is: a bar on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

PLAIN_LINE_PERIOD_S = 2.0


class RecordDisplay:
    """Shows simulated time; a context manager."""

    def __init__(
        self, console: Console, duration_s: float, done: str = 'simulated',
        starting: str = 'starting the nodes',
    ) -> None:
        """Choose between bar and lines; ``done`` is what has been done with the time shown."""
        self._console, self._duration_s = console, duration_s
        self._done, self._starting = done, starting
        self._next_line_s = 0.0
        self._said_end = False
        self._bar = Progress(
            TextColumn('{task.description}'), BarColumn(),
            TextColumn('{task.completed:.1f} of {task.total:g} s ' + done),
            TimeElapsedColumn(), console=console, transient=True) if console.is_terminal else None
        if self._bar is not None:
            self._task = self._bar.add_task(starting, total=duration_s)

    def __enter__(self) -> RecordDisplay:
        """Begin to show."""
        if self._bar is not None:
            self._bar.start()
        else:
            self._say(self._starting)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Cease to show."""
        if self._bar is not None:
            self._bar.stop()

    def show(self, time_s: float) -> None:
        """Show the simulated time of the newest state."""
        shown_s = min(time_s, self._duration_s)
        if self._bar is not None:
            self._bar.update(self._task, completed=shown_s, description='')
        elif self._said_end:
            return
        elif time.monotonic() >= self._next_line_s or shown_s >= self._duration_s:
            self._said_end = shown_s >= self._duration_s
            self._next_line_s = time.monotonic() + PLAIN_LINE_PERIOD_S
            self._say(f'{shown_s:g} of {self._duration_s:g} s {self._done}')

    def _say(self, text: str) -> None:
        """Print a line at once."""
        self._console.print(text, soft_wrap=True)
        self._console.file.flush()
