# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How far a verb is: in place on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType

from rich import progress as rich_progress
from rich.console import Console

# Where the output is no terminal, a line at most as often as this.
PLAIN_LINE_PERIOD_S = 5.0


class Progress:
    """A bar on a terminal, lines elsewhere; a context manager.

    Arguments
    ---------
    unit
        What ``done`` and ``total`` count, as it stands behind the numbers.
    total
        When it is done; None when that is not known before the first `show`.
    starting
        What is being done until then.

    """

    def __init__(
        self, console: Console, unit: str, total: float | None = None, starting: str = '',
    ) -> None:
        """Choose between bar and lines."""
        self._console, self._unit, self._total = console, unit, total
        self._lines = _Lines(console)
        self._begin_s = time.monotonic()
        self._bar = rich_progress.Progress(
            rich_progress.BarColumn(), rich_progress.TextColumn('{task.description}'),
            rich_progress.TimeElapsedColumn(), rich_progress.TextColumn('left'),
            rich_progress.TimeRemainingColumn(), console=console, transient=True,
            disable=not console.is_terminal)
        self._task = self._bar.add_task(starting, total=total)
        if starting and not console.is_terminal:
            self.say(starting)

    def __enter__(self) -> Progress:
        """Begin to show."""
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Cease to show."""
        self._bar.stop()

    def show(self, done: float, text: str = '', total: float | None = None) -> None:
        """Show what is done, with a text behind it; ``total`` is a new one."""
        self._total = total or self._total or done
        line = f'{done:.6g} of {self._total:.6g} {self._unit}{text and ", "}{text}'
        self._bar.update(self._task, completed=done, total=self._total, description=line)
        if not self._console.is_terminal:
            left_s = (time.monotonic() - self._begin_s) * (self._total / done - 1) if done else 0.0
            about = f', about {left_s:.0f} s left' if left_s > PLAIN_LINE_PERIOD_S else ''
            self._lines.show(line, about, at_once=done >= self._total)

    def say(self, text: str) -> None:
        """Print a line at once."""
        _print(self._console, text)


@contextmanager
def activity(console: Console, doing: str = '') -> Iterator[Callable[[str], None]]:
    """Show what is being done where nobody knows how much it is; yields what to call."""
    if console.is_terminal:
        with console.status(doing) as status:
            yield status.update
    else:
        yield _Lines(console).show


class _Lines:
    """Lines that differ from the one before, not too many of them."""

    def __init__(self, console: Console) -> None:
        """Print the first at once."""
        self._console, self._last, self._next_s = console, '', 0.0

    def show(self, line: str, more: str = '', at_once: bool = False) -> None:
        """Print a line unless it is too early, or was the last; ``more`` does not make it new."""
        now_s = time.monotonic()
        if line != self._last and (at_once or now_s >= self._next_s):
            self._last, self._next_s = line, now_s + PLAIN_LINE_PERIOD_S
            _print(self._console, line + more)


def _print(console: Console, text: str) -> None:
    """Print a line at once, unbroken."""
    console.print(text, soft_wrap=True, markup=False)
    console.file.flush()
