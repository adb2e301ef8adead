# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When a tick is: by a clock, or in lockstep, where the state that has come is the time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from manifold_mpc_ros.control.input_gate import StateSample


class TickTime(Protocol):
    """The time of one tick, and what follows from it for the latest state and for the torque."""

    def time_ns(self, sample: StateSample | None) -> int:
        """Return the time that the tick's command is for [ns]."""

    def age_ns(self, sample: StateSample) -> int:
        """Return how old a state is at the tick [ns], never negative."""

    def delay_s(self, solve_time_s: float) -> float:
        """Return how long after the tick the torque of a solve is in force [s]."""


@dataclass(frozen=True)
class ClockTime:
    """A tick of the clock: time passes while the solver works.

    ``now_ns`` is the clock of the stamps [ns]. ``monotonic_ns`` is a monotonic clock [ns], None
    where only stamps tell the age: a state is as old as the larger of the ages that its stamp
    and its receipt give.
    """

    now_ns: int
    monotonic_ns: int | None = None

    def time_ns(self, _sample: StateSample | None) -> int:
        """Return the time of the clock [ns]."""
        return self.now_ns

    def age_ns(self, sample: StateSample) -> int:
        """Return the larger of stamp age and receipt age [ns]."""
        received = 0
        if self.monotonic_ns is not None and sample.received_ns is not None:
            received = self.monotonic_ns - sample.received_ns
        return max(0, self.now_ns - sample.stamp_ns, received)

    def delay_s(self, solve_time_s: float) -> float:
        """Return the time that the solve took [s]."""
        return solve_time_s


class LockstepTime:
    """A tick in lockstep: the state is new, and time waits for the torque."""

    def time_ns(self, sample: StateSample | None) -> int:
        """Return the stamp of the state [ns], 0 before the first."""
        return 0 if sample is None else sample.stamp_ns

    def age_ns(self, _sample: StateSample) -> int:
        """Return zero."""
        return 0

    def delay_s(self, _solve_time_s: float) -> float:
        """Return zero."""
        return 0.0


#: The one tick time of lockstep.
LOCKSTEP = LockstepTime()
