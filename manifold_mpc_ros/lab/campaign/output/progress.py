# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How far a campaign is: a bar on a terminal, now and then a line elsewhere."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.console import Console

# Where the output is no terminal, a line as often as this.
PLAIN_LINE_PERIOD_S = 10.0


@contextmanager
def progress(console: Console, total: int, where: str) -> Iterator[Callable[[int, int], None]]:
    """Show how far it is; yields what to call with the loops done and broken since."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    begin = last = time.monotonic()
    broken = 0
    with Progress(
        TextColumn(f'closed loops, {where}'), BarColumn(), MofNCompleteColumn(),
        TimeElapsedColumn(), TextColumn('left'), TimeRemainingColumn(),
        TextColumn('broken {task.fields[broken]}'), console=console,
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task('', total=total, broken=0)
        done = 0
        if not console.is_terminal:
            _say(console, f'{total} loops, {where}')

        def advance(loops: int, broke: int) -> None:
            nonlocal done, broken, last
            done, broken, now = done + loops, broken + broke, time.monotonic()
            bar.update(task, completed=done, broken=broken)
            if not console.is_terminal and (now - last > PLAIN_LINE_PERIOD_S or done == total):
                last = now
                left_s = (now - begin) / done * (total - done)
                _say(console, f'{done} of {total} loops, {broken} broken, {left_s:.0f} s left')

        yield advance


def _say(console: Console, line: str) -> None:
    """Print a line at once."""
    console.print(line)
    console.file.flush()
