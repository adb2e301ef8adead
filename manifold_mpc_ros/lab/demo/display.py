# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the demo shows while it runs: a live panel on a terminal, plain lines elsewhere."""

from __future__ import annotations

import math
from types import TracebackType

import numpy as np
from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from manifold_mpc_ros.cli.console import vector_text

PLAIN_LINE_PERIOD_S = 2.0
BAR_WIDTH = 50


class DemoDisplay:
    """Shows how the start goes, then error, rate, torque and mode; a context manager."""

    def __init__(self, console: Console) -> None:
        """Choose between panel and lines."""
        self._console = console
        self._live = Live(console=console, transient=True) if console.is_terminal else None
        self._next_line_s = 0.0
        self._said_running = False

    def __enter__(self) -> DemoDisplay:
        """Begin to show."""
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Cease to show."""
        if self._live is not None:
            self._live.stop()

    def starting(self, elapsed_s: float, states: int, mode: str) -> None:
        """Show how far the two processes are."""
        simulator = f'simulator: {states} states' if states else 'simulator: not seen yet'
        controller = f'controller: {mode}' if mode else 'controller: not seen yet'
        text = f'starting {elapsed_s:4.0f} s   {simulator}   {controller}'
        if self._live is not None:
            self._live.update(Text(text))
        else:
            self._say(elapsed_s, text)

    def running(
        self, elapsed_s: float, limit_s: float, error_rad: float, rate_rad_s: float,
        torque_B: np.ndarray, mode: str,
    ) -> None:
        """Show the present state of the loop."""
        if not self._said_running:
            self._said_running, self._next_line_s = True, 0.0
        rows = [
            ('error', f'{math.degrees(error_rad):10.4f} deg'),
            ('rate', f'{rate_rad_s:8.5f} rad/s'),
            ('torque', vector_text((round(float(part), 4) for part in torque_B), 'N m')),
            ('mode', mode or 'unknown'),
        ]
        if self._live is not None:
            self._live.update(_panel(elapsed_s, limit_s, rows))
        else:
            self._say(elapsed_s, f't {elapsed_s:5.1f} s   ' + '   '.join(
                f'{name} {value}' for name, value in rows))

    def _say(self, elapsed_s: float, text: str) -> None:
        """Print a line, not more often than every two seconds."""
        if elapsed_s >= self._next_line_s:
            self._next_line_s = elapsed_s + PLAIN_LINE_PERIOD_S
            self._console.print(text, soft_wrap=True)
            self._console.file.flush()


def _panel(elapsed_s: float, limit_s: float, rows: list[tuple[str, str]]) -> Group:
    """Return the live view: time as a bar, then one row for each quantity."""
    head = Table.grid(padding=(0, 1))
    head.add_row(f'{elapsed_s:5.1f} s', ProgressBar(limit_s, elapsed_s, width=BAR_WIDTH),
                 f'of {limit_s:g} s')
    body = Table.grid(padding=(0, 2))
    for name, value in rows:
        body.add_row(Text(name, style='bold'), value)
    return Group(head, body)
