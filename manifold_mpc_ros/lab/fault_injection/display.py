# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How far a run of faults is: a bar on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import time
from collections.abc import Sequence
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from manifold_mpc_ros.lab.fault_injection.evidence import Verdict

PLAIN_LINE_PERIOD_S = 10.0


class ChaosDisplay:
    """Shows faults injected and survived; a context manager."""

    def __init__(self, console: Console, total: int) -> None:
        """Choose between bar and lines."""
        self._console, self._total = console, total
        self._shown, self._next_line_s = 0, 0.0
        self._bar = Progress(
            TextColumn('{task.description}'), BarColumn(), MofNCompleteColumn(),
            TimeElapsedColumn(), console=console, transient=True) if console.is_terminal else None
        if self._bar is not None:
            self._task = self._bar.add_task('starting the nodes', total=total)

    def __enter__(self) -> ChaosDisplay:
        """Begin to show."""
        if self._bar is not None:
            self._bar.start()
        else:
            self._say(f'starting the nodes; {self._total} faults to inject')
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Cease to show."""
        if self._bar is not None:
            self._bar.stop()

    def show(self, verdicts: Sequence[Verdict]) -> None:
        """Show the verdicts so far; each that was not survived has a line of its own."""
        for verdict in verdicts[self._shown:]:
            if not verdict.survived:
                self._say(f'NOT survived: {verdict.fault} ({verdict.phase}, seed {verdict.seed}): '
                          + '; '.join(verdict.reasons))
        new, self._shown = len(verdicts) - self._shown, len(verdicts)
        survived = sum(verdict.survived for verdict in verdicts)
        if self._bar is not None:
            last = f', last {verdicts[-1].fault}' if verdicts else ''
            self._bar.update(self._task, completed=len(verdicts),
                             description=f'{survived} survived{last}')
        elif new and (time.monotonic() >= self._next_line_s or len(verdicts) == self._total):
            self._next_line_s = time.monotonic() + PLAIN_LINE_PERIOD_S
            self._say(f'{len(verdicts)} of {self._total} injected, {survived} survived')

    def _say(self, text: str) -> None:
        """Print a line at once."""
        self._console.print(text, soft_wrap=True, markup=False)
        self._console.file.flush()
