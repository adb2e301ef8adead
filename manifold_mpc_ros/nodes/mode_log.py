# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a node says on its log: each change of mode, and each kind of refused input, but no flood.

Pure logic: what there is to say and a monotonic time [s] in, lines for a logger out.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import Protocol

from manifold_mpc_ros.control.input_gate import Refusal

#: The shortest time from one line about refusals to the next, and the longest while the same
#: kinds go on being refused; it doubles from line to line [s].
SHORTEST_GAP_S, LONGEST_GAP_S = 1.0, 64.0
#: Levels of a status, as diagnostic_msgs/DiagnosticStatus has them.
WARN, ERROR = 1, 2
#: Modes that are as somebody wanted it, unless they are an ERROR.
EXPECTED = frozenset({'WAIT', 'PAUSED', 'STOPPING'})
#: So many changes of mode in a row have a line each; then there is one a second.
CHANGES_AT_ONCE = 5


class Logger(Protocol):
    """What is written to; a logger of rclpy is such."""

    def info(self, message: str) -> object:
        """Write what is as it should be."""

    def warning(self, message: str) -> object:
        """Write what may become worse."""

    def error(self, message: str) -> object:
        """Write what is wrong."""


class RefusalLog:
    """Counters of everything refused, by topic and reason, and the latest sentence of each."""

    def __init__(self) -> None:
        """Start with nothing refused."""
        self.counts: Counter[str] = Counter()
        self.details: dict[str, str] = {}
        self.latest = ''

    def add(self, topic: str, refusal: Refusal) -> None:
        """Count one refusal of a message on ``topic``."""
        key = f'{topic}.{refusal.reason.value}'
        self.counts[key] += 1
        self.details[key] = self.latest = f'{topic}: {refusal.detail}'

    def values(self) -> dict[str, object]:
        """Return the counters and the latest sentence, as diagnostics name them."""
        counts = {f'refused.{key}': count for key, count in sorted(self.counts.items())}
        return {**counts, **({'refused_latest': self.latest} if self.latest else {})}


class ModeLog:
    """Writes a line for each change of mode, and for each kind of refused input."""

    def __init__(self, logger: Logger, refusals: RefusalLog, mode: str) -> None:
        """Begin in a mode that needs no line."""
        self._logger, self._refusals = logger, refusals
        self._present = mode, False
        self._changes = 0
        self._lines_left, self._mode_s = float(CHANGES_AT_ONCE), -math.inf
        self._counted: Counter[str] = Counter()
        self._refused_s, self._gap_s = -math.inf, SHORTEST_GAP_S

    def note(self, mode: str, level: int, reason: str, now_s: float) -> None:
        """Write what is new about the mode at a time, and what was refused since.

        A mode at the level ERROR and the same mode at a lower one are two.
        """
        kind = mode, level >= ERROR
        self._changes += kind != self._present
        self._present = kind
        self._lines_left = min(float(CHANGES_AT_ONCE), self._lines_left + now_s - self._mode_s)
        self._mode_s = now_s
        if self._changes and self._lines_left >= 1.0:
            more = f' ({self._changes} changes of mode)' if self._changes > 1 else ''
            calm = mode in EXPECTED and level < ERROR
            self._write(0 if calm else level, f'{mode}: {reason}{more}')
            self._lines_left -= 1.0
            self._changes = 0
        self._note_refusals(now_s)

    def _note_refusals(self, now_s: float) -> None:
        """Write which kinds of input were refused since the last line, and how often."""
        new = self._refusals.counts - self._counted
        elapsed_s = now_s - self._refused_s
        known = all(key in self._counted for key in new)
        if not new or elapsed_s < (self._gap_s if known else SHORTEST_GAP_S):
            return
        goes_on = known and elapsed_s < 2.0 * self._gap_s
        self._gap_s = min(2.0 * self._gap_s, LONGEST_GAP_S) if goes_on else SHORTEST_GAP_S
        self._counted, self._refused_s = Counter(self._refusals.counts), now_s
        self._logger.warning('refused ' + '; '.join(
            f'{count} on {self._refusals.details[key]}' for key, count in sorted(new.items())))

    def _write(self, level: int, line: str) -> None:
        """Write a line; rclpy wants a place in the code for each severity."""
        if level >= ERROR:
            self._logger.error(line)
        elif level == WARN:
            self._logger.warning(line)
        else:
            self._logger.info(line)
