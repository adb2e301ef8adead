# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Branch and bound covers everything, stops at a counterexample, and adds up the same anyhow."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import numpy as np
import pytest

from manifold_mpc_ros.lab.certification.covering import cover
from manifold_mpc_ros.lab.certification.enclosure import BoxVerdict
from manifold_mpc_ros.lie.arrays import Array


@dataclass
class Disc:
    """Boxes are outside of the unit disc, or verified once they are small or far enough."""

    wrong_at: float = 9.0
    calls: list[tuple[Array, Array, str]] = field(default_factory=list)

    def judge(self, low: Array, high: Array) -> BoxVerdict:
        nearest = np.clip(0.0, low, high)
        verdict = self._verdict(low, high, float(np.hypot(*nearest)))
        self.calls.append((low, high, verdict.kind))
        return verdict

    def _verdict(self, low: Array, high: Array, nearest: float) -> BoxVerdict:
        size = high - low
        if nearest > 1:
            return BoxVerdict('outside')
        if low[0] <= self.wrong_at <= high[0]:
            if size[0] > 0.01:
                return BoxVerdict('undecided', 0, 'not yet')
            return BoxVerdict('refuted', reason='it is wrong here')
        if size.max() > 0.2:
            return BoxVerdict('undecided', int(np.argmax(size)), 'too large')
        return BoxVerdict('verified', ratios={'size': float(size.max())})


LOW, HIGH = np.array([-1.1, -1.0]), np.array([1.0, 1.3])


def test_the_decided_boxes_tile_the_whole() -> None:
    disc = Disc()
    found = cover(lambda: disc, LOW, HIGH, budget=10_000)
    decided = [(low, high) for low, high, kind in disc.calls if kind in ('verified', 'outside')]
    assert found.complete
    assert (found.verified + found.outside, found.boxes) == (len(decided), len(disc.calls))
    assert found.done == pytest.approx(1.0, abs=1e-12)
    assert sum(np.prod(high - low) for low, high in decided) == pytest.approx(
        np.prod(HIGH - LOW), rel=1e-12)
    points = np.random.default_rng(1).uniform(LOW, HIGH, size=(2000, 2))
    inside = sum(np.all((low <= points) & (points <= high), axis=1) for low, high in decided)
    assert inside.min() == 1
    # Neighbours share their cut to the last bit: every inner edge is the end of two boxes.
    ends = {(axis, high[axis]) for _, high in decided for axis in (0, 1)}
    starts = {(axis, low[axis]) for low, _ in decided for axis in (0, 1)}
    assert ends ^ starts == {(0, LOW[0]), (1, LOW[1]), (0, HIGH[0]), (1, HIGH[1])}
    assert found.ratios['size'] <= 0.2


def test_one_counterexample_ends_it() -> None:
    found = cover(partial(Disc, 0.3), LOW, HIGH, budget=10_000)
    assert not found.complete
    assert found.refuted
    assert found.reason == 'it is wrong here'


def test_the_budget_ends_it() -> None:
    found = cover(Disc, LOW, HIGH, budget=20)
    assert not found.complete
    assert not found.refuted
    assert 'budget of 20 boxes' in found.reason
    assert found.boxes == 20


class Never:
    """Decides nothing."""

    def judge(self, low: Array, high: Array) -> BoxVerdict:  # noqa: ARG002
        return BoxVerdict('undecided', 0, 'cannot')


def test_boxes_that_cannot_be_halved_end_it() -> None:
    high = np.nextafter(LOW, np.inf)
    found = cover(Never, LOW, high, budget=10)
    assert found.reason == 'cannot, however small the box'


def test_processes_find_the_same() -> None:
    alone = cover(Disc, LOW, HIGH, budget=10_000)
    seen: list[float] = []
    shared = cover(Disc, LOW, HIGH, budget=10_000, workers=2,
                   progress=lambda done, _: seen.append(done))
    assert (shared.verified, shared.outside, shared.split, shared.depth) == (
        alone.verified, alone.outside, alone.split, alone.depth)
    assert shared.complete
    assert seen == sorted(seen)
    assert seen[-1] == pytest.approx(1.0, abs=1e-12)


def test_processes_report_a_counterexample() -> None:
    found = cover(partial(Disc, 0.95), LOW, HIGH, budget=10_000, workers=2)
    assert found.refuted
    assert found.reason == 'it is wrong here'
