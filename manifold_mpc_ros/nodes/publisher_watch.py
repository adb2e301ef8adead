# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Duplicate publishers: two of one topic are told from one that was started again."""

from __future__ import annotations

from collections import deque

#: So many changes of publisher among so many messages: two publish in turn.
MOST_TURNS, TURN_MESSAGES = 3, 20
#: A publisher that goes on where it had left off is alive; seen so often, it is no chance.
MOST_RETURNS, RETURN_MESSAGES = 2, 400
#: Messages that may be lost while another publisher is heard.
LONGEST_GAP = 200


class PublisherWatch:
    """Reads the sequence numbers of a topic's messages, which each publisher counts from 1.

    The numbers of one publisher only grow. A publisher that is started again begins anew, once;
    with two at a time the numbers go back and forth.
    """

    def __init__(self) -> None:
        """Start with no message seen."""
        self.forget()

    def forget(self) -> None:
        """Forget every message."""
        self._seen = 0
        self._last: int | None = None
        self._left: int | None = None
        self._turns: deque[int] = deque()
        self._returns: deque[int] = deque()

    def note(self, number: int | None) -> bool:
        """Note a message by its sequence number; return whether two publishers take turns."""
        self._seen += 1
        if number is None:  # this middleware does not tell
            return False
        last, left = self._last, self._left
        self._last = number
        if last is not None and number <= last:
            self._left = last
            self._turns.append(self._seen)
        elif last is not None and left is not None and (
                last + 1 < number and left < number <= left + LONGEST_GAP):
            self._left = None
            self._turns.append(self._seen)
            self._returns.append(self._seen)
        return (self._count(self._turns, TURN_MESSAGES) >= MOST_TURNS
                or self._count(self._returns, RETURN_MESSAGES) >= MOST_RETURNS)

    def _count(self, events: deque[int], messages: int) -> int:
        """Return how many events lie within the last messages."""
        while events and events[0] <= self._seen - messages:
            events.popleft()
        return len(events)
