# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When ticks come and how long they take: times in, figures out."""

from __future__ import annotations

import time
from collections.abc import Mapping

#: A clock that moves on by more than this between two ticks has leapt: nothing was due [s].
LEAP_S = 60.0


class TickTiming:
    """Compares ticks with the grid that they are due on; a missed tick is skipped, not made up.

    Arguments
    ---------
    step_s
        Period of the grid [s].

    """

    def __init__(self, step_s: float) -> None:
        """Let the first tick set the grid."""
        self._step_s = step_s
        self._due_s: float | None = None
        self.lateness_s = self.longest_lateness_s = 0.0
        self.duration_s = self.longest_duration_s = 0.0
        self.missed = 0

    def begin(self, now_s: float) -> None:
        """Note that a tick begins; time that went back or leapt sets the grid anew."""
        due_s = now_s if self._due_s is None else self._due_s
        late_s = now_s - due_s
        if not -self._step_s <= late_s <= LEAP_S:
            due_s, late_s = now_s, 0.0
        missed = max(0, int(late_s / self._step_s + 1e-9))
        self.missed += missed
        self.lateness_s = late_s
        self.longest_lateness_s = max(self.longest_lateness_s, late_s)
        self._due_s = due_s + (missed + 1) * self._step_s

    def end(self, duration_s: float) -> None:
        """Note how long after its begin a tick's torque was out."""
        self.duration_s = duration_s
        self.longest_duration_s = max(self.longest_duration_s, duration_s)

    def values(self) -> dict[str, object]:
        """Return the figures by their keys on /diagnostics."""
        return {
            'tick_lateness_us': self.lateness_s * 1e6,
            'tick_lateness_max_us': self.longest_lateness_s * 1e6,
            'tick_time_us': self.duration_s * 1e6,
            'tick_time_max_us': self.longest_duration_s * 1e6,
            'missed_ticks': self.missed,
        }


class AnswerTiming(TickTiming):
    """Of ticks that answer a state at once: how long after its arrival the torque is out."""

    def values(self) -> dict[str, object]:
        """Return the figures by their keys on /diagnostics."""
        return {'answer_time_us': self.duration_s * 1e6,
                'answer_time_max_us': self.longest_duration_s * 1e6}


def arrival_s(info: Mapping[str, int]) -> float:
    """Return when a message had arrived at the middleware, now where that does not say [s].

    By the monotonic clock; the middleware's account is by the system's.
    """
    now_ns = time.time_ns()
    waited_ns = max(0, now_ns - (info.get('received_timestamp') or now_ns))
    return time.monotonic() - waited_ns / 1e9
