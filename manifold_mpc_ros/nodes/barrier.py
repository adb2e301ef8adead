# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The exception barrier: no error in a callback ends the process, none goes unsaid."""

from __future__ import annotations

import functools
import time
from collections import Counter
from collections.abc import Callable
from pathlib import PurePath
from typing import Any

from rclpy.node import Node

#: Errors that follow each other within this are one burst, logged once [s].
BURST_S = 5.0


class Barrier:
    """Counts errors by the callback that they came from, and logs the first of each burst."""

    def __init__(self, log: Callable[[str], object]) -> None:
        """Start with nothing caught."""
        self._log = log
        self._latest_s: dict[str, float] = {}
        self.counts: Counter[str] = Counter()
        self.latest = ''

    def note(self, where: str, error: Exception) -> None:
        """Count one error; log it unless one from the same place is no older than a burst."""
        now_s = time.monotonic()
        self.counts[where] += 1
        self.latest = f'{where}: {_in_words(error)}'
        if now_s - self._latest_s.get(where, -BURST_S) >= BURST_S:
            self._log(f'error in {self.latest}')
        self._latest_s[where] = now_s

    def values(self) -> dict[str, object]:
        """Return how many errors were caught, and the latest, as diagnostics name them."""
        count = {'exceptions': sum(self.counts.values())}
        return {**count, **({'exception_latest': self.latest} if self.latest else {})}

    def guarded(self, where: str, callback: Callable[..., Any]) -> Callable[..., Any]:
        """Return a callback that lets no error out, and returns None instead."""
        @functools.wraps(callback)
        def call(*arguments: Any) -> Any:
            try:
                return callback(*arguments)
            except Exception as error:  # noqa: BLE001  (this is the barrier)
                self.note(where, error)
                return None

        return call

    def guard_services(self, node: Node) -> None:
        """Let every service answer with its default response instead of an error."""
        for service in node.services:
            service.callback = self._guarded_service(
                service.srv_name, service.callback, service.srv_type.Response)

    def _guarded_service(
        self, where: str, callback: Callable[[Any, Any], Any], default: Callable[[], Any],
    ) -> Callable[[Any, Any], Any]:
        """Return a service callback that always answers."""
        guarded = self.guarded(where, callback)

        def answer(request: Any, response: Any) -> Any:
            answered = guarded(request, response)
            return default() if answered is None else answered

        return answer


def _in_words(error: Exception) -> str:
    """Return what an error says and where it was raised, on one line."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    words = ' '.join(f'{type(error).__name__}: {error}'.split())
    if trace is None:
        return words
    return f'{words} ({PurePath(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno})'
