# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When the simulated spacecraft moves on: by the clock on the wall, or by question and answer.

Pure logic; the caller hands in the time of a clock that never goes back [s].
"""

from __future__ import annotations

from enum import Enum

#: More wall clock than this between two looks is not made up for, where time may slip [s].
LONGEST_CATCH_UP_S = 0.25


class FreeRun:
    """Counts the plant steps that are due by the wall clock.

    Arguments
    ---------
    step_s
        Simulated time of one step [s].
    real_time_factor
        Simulated seconds in one second of wall clock.
    may_slip
        True where everybody follows the simulated clock: time lost to a busy or stopped machine
        is then skipped instead of being made up in a burst.

    """

    def __init__(self, step_s: float, real_time_factor: float, *, may_slip: bool) -> None:
        """Wait for `start`."""
        self._step_wall_s = step_s / real_time_factor
        self._may_slip = may_slip
        self._origin_s = 0.0
        self._done = 0
        self.slipped_s = 0.0

    def start(self, wall_s: float) -> None:
        """Begin, or go on after a pause, at this time of the wall clock."""
        self._origin_s = wall_s
        self._done = 0

    def due(self, wall_s: float) -> int:
        """Return how many steps are due now."""
        late_s = self._late_s(wall_s)
        if self._may_slip and late_s > LONGEST_CATCH_UP_S:
            self._slip(late_s - LONGEST_CATCH_UP_S)
            late_s = LONGEST_CATCH_UP_S
        return max(0, int((late_s + 1e-9) / self._step_wall_s))

    def took(self, steps: int) -> None:
        """Count steps that were taken."""
        self._done += steps

    def hold(self, wall_s: float) -> None:
        """Let simulated time stand still up to now: no step is due any more."""
        self._slip(max(0.0, self._late_s(wall_s)))

    def _late_s(self, wall_s: float) -> float:
        """Return the wall clock that steps not yet taken stand for."""
        return wall_s - self._origin_s - self._done * self._step_wall_s

    def _slip(self, wall_s: float) -> None:
        """Leave out some wall clock."""
        self.slipped_s += wall_s
        self._origin_s += wall_s


class Patience:
    """How long simulated time waits for a command that is overdue, each time anew.

    Without it, a factor that the machine cannot keep up with would leave the spacecraft without
    control; a controller that has died is waited for only so long.
    """

    def __init__(self, wall_s: float) -> None:
        """Wait at most ``wall_s`` of wall clock for one command."""
        self._longest_s = wall_s
        self._since_s: float | None = None

    def waits(self, wall_s: float, *, overdue: bool) -> bool:
        """Return whether to wait now."""
        if not overdue:
            self._since_s = None
            return False
        if self._since_s is None:
            self._since_s = wall_s
        return wall_s - self._since_s < self._longest_s


class Ask(str, Enum):
    """What to do while a state waits for the torque that answers it."""

    WAIT = 'wait'
    REPEAT = 'repeat'
    GIVE_UP = 'give up'


class Lockstep:
    """One state out, one torque back: the exchange that makes two runs the same.

    A state without an answer is repeated every ``retry_s`` of wall clock. After ``timeout_s`` the
    exchange gives up and time goes on, but never before a first answer has come: when the other
    process starts, or is found, leaves no trace in simulated time.
    """

    def __init__(self, retry_s: float, timeout_s: float) -> None:
        """Wait for the first `ask`."""
        self._retry_s = retry_s
        self._timeout_s = timeout_s
        self._stamp_ns: int | None = None
        self._asked_s = 0.0
        self._repeated_s = 0.0
        self._answered_once = False
        self.repeats = 0
        self.timeouts = 0

    @property
    def asking(self) -> bool:
        """Whether a state waits for its answer."""
        return self._stamp_ns is not None

    def ask(self, stamp_ns: int, wall_s: float) -> None:
        """Note that the state of this stamp has been published."""
        self._stamp_ns = stamp_ns
        self._asked_s = self._repeated_s = wall_s

    def answer(self, stamp_ns: int) -> bool:
        """Return whether a torque answers the state that waits; if so, it waits no longer."""
        if stamp_ns != self._stamp_ns:
            return False
        self._stamp_ns = None
        self._answered_once = True
        return True

    def poll(self, wall_s: float) -> Ask:
        """Return what to do now about the state that waits."""
        if self._answered_once and wall_s - self._asked_s >= self._timeout_s:
            self.timeouts += 1
            self._stamp_ns = None
            return Ask.GIVE_UP
        if wall_s - self._repeated_s >= self._retry_s:
            self.repeats += 1
            self._repeated_s = wall_s
            return Ask.REPEAT
        return Ask.WAIT
