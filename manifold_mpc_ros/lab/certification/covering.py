# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Branch and bound: cover a box until a test has decided all of it, on one or more processes.

A box that the test cannot decide is halved along the axis that the test names. Halves share
their cut, a float, so the pieces cover the whole exactly. What is covered when the search ends
without a word is proved; one refuted box, or a budget that runs out, ends it with the reason.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from manifold_mpc_ros.lab.certification.enclosure import BoxVerdict
from manifold_mpc_ros.lie.arrays import Array

Box = tuple[Array, Array, int]
Progress = Callable[[float, int], None]
# Pieces that each process gets, so that none is idle for long at the end.
_PIECES = 40
# Boxes between two reports, and halvings after which a box is too small to go on.
_REPORT, _DEEPEST = 25, 120


class Test(Protocol):
    """Decides boxes."""

    def judge(self, low: Array, high: Array) -> BoxVerdict:
        """Test the box between two corners."""


@dataclass
class Cover:
    """What a search found: boxes tested, and ``reason`` when it does not prove all of it.

    ``done`` is the part of the volume that is decided, ``refuted`` says that the reason is a
    counterexample rather than a budget; ``ratios`` are the largest bounds met on verified boxes.
    """

    verified: int = 0
    outside: int = 0
    split: int = 0
    depth: int = 0
    done: float = 0.0
    reason: str = ''
    refuted: bool = False
    ratios: dict[str, float] = field(default_factory=dict)

    @property
    def complete(self) -> bool:
        """Whether every box is verified or outside."""
        return not self.reason

    @property
    def boxes(self) -> int:
        """How many boxes were tested."""
        return self.verified + self.outside + self.split

    def add(self, other: Cover) -> None:
        """Take in the result of a part of the search."""
        self.verified += other.verified
        self.outside += other.outside
        self.split += other.split
        self.done += other.done
        self.depth = max(self.depth, other.depth)
        if other.reason and not self.refuted:
            self.reason, self.refuted = other.reason, other.refuted
        for name, ratio in other.ratios.items():
            self.ratios[name] = max(ratio, self.ratios.get(name, 0.0))


def cover(make: Callable[[], Test], low: Array, high: Array, *, budget: int, workers: int = 1,
          progress: Progress | None = None) -> Cover:
    """Cover the box between two corners with the test that ``make`` returns.

    ``make`` is called in each process, so with several it has to be importable there. ``budget``
    bounds the number of boxes, ``progress`` gets the part of the volume done and the boxes.
    """
    total = Cover()
    report = progress or (lambda *_: None)
    pending: list[Box] = [(np.asarray(low, dtype=float), np.asarray(high, dtype=float), 0)]
    test = make()
    breadth_first = workers > 1
    while pending and not total.reason and (not breadth_first or len(pending) < _PIECES * workers):
        box = pending.pop(0 if breadth_first else -1)
        _decide(test, box, pending, total)
        _check_budget(total, budget, pending)
        if total.boxes % _REPORT == 0:
            report(total.done, total.boxes)
    if pending and not total.reason:
        for part in _in_processes(make, pending, budget, workers):
            total.add(part)
            report(total.done, total.boxes)
            if total.boxes > budget and not total.reason:
                total.reason = _exhausted(budget)
            if total.reason:
                break
    report(total.done, total.boxes)
    return total


def _decide(test: Test, box: Box, pending: list[Box], total: Cover) -> None:
    """Test one box, count it, and leave its halves to do where it is undecided."""
    low, high, depth = box
    verdict = test.judge(low, high)
    total.depth = max(total.depth, depth)
    if verdict.kind == 'refuted':
        total.split += 1
        total.reason, total.refuted = verdict.reason, True
        return
    if verdict.kind == 'undecided':
        total.split += 1
        cut = float((low[verdict.axis] + high[verdict.axis]) / 2)
        if depth >= _DEEPEST or not low[verdict.axis] < cut < high[verdict.axis]:
            total.reason = f'{verdict.reason}, however small the box'
            return
        for side, edge in ((high, low), (low, high)):
            half = side.copy()
            half[verdict.axis] = cut
            corners = (edge, half) if side is high else (half, edge)
            pending.append((*corners, depth + 1))
        return
    total.done += 0.5 ** depth
    if verdict.kind == 'outside':
        total.outside += 1
        return
    total.verified += 1
    for name, ratio in verdict.ratios.items():
        total.ratios[name] = max(ratio, total.ratios.get(name, 0.0))


def _check_budget(total: Cover, budget: int, pending: list[Box]) -> None:
    """Give up when the budget is used and something is left."""
    if pending and total.boxes >= budget and not total.reason:
        total.reason = _exhausted(budget)


def _exhausted(budget: int) -> str:
    """Say that the budget ran out."""
    return f'the budget of {budget} boxes ran out'


_test: Test | None = None


def _start(make: Callable[[], Test]) -> None:
    """Build the test once in a process."""
    global _test
    _test = make()


def _search(box: Box, budget: int) -> Cover:
    """Decide one piece in a process, depth first."""
    assert _test is not None
    part, pending = Cover(), [box]
    while pending and not part.reason:
        _decide(_test, pending.pop(), pending, part)
        _check_budget(part, budget, pending)
    return part


def _in_processes(make: Callable[[], Test], pending: list[Box], budget: int, workers: int
                  ) -> Iterator[Cover]:
    """Yield the results of the pieces in the order in which they were given out."""
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context('spawn'),
                             initializer=_start, initargs=(make,)) as pool:
        futures = [pool.submit(_search, box, budget) for box in pending]
        try:
            for future in futures:
                yield future.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
