# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The monitor on scripted plans: verdicts, gaps, counters, warnings; properties by hypothesis."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import generator, unit_vectors

from manifold_mpc_ros.control.decrease_monitor import HOLD_TICKS, DecreaseMonitor, value_of_noise
from manifold_mpc_ros.control.decrease_record import Decrease, DecreaseRecord, Tolerance
from manifold_mpc_ros.mpc.solution import SolveStatus

STEP_S = 0.5
TOLERANCE = Tolerance(decrease=0.1, floor=1e-6)
NAN = math.nan


@dataclass(frozen=True)
class Solved:
    """A plan with the numbers that the monitor reads."""

    cost: float
    promised_cost: float
    terminal_ratio: float = 2.0
    status: SolveStatus = SolveStatus.CONVERGED


FAILED = Solved(NAN, NAN, NAN, SolveStatus.FAILED)
OUTSIDE = Solved(50.0, 40.0, 9.0, SolveStatus.INFEASIBLE)
FIRST = Solved(10.0, 8.0)
FOLLOWING = Solved(8.0, 6.5)


def monitor(**changes: Any) -> DecreaseMonitor:
    return DecreaseMonitor(**{'tolerance': TOLERANCE, 'step_s': STEP_S, **changes})


def observe(watch: DecreaseMonitor, *answers: Solved | None) -> list[DecreaseRecord]:
    """Return the records of answers one step apart, from time zero on."""
    return [watch.observe(answer, time_s=index * STEP_S) for index, answer in enumerate(answers)]


def test_a_kept_promise() -> None:
    first, second = observe(monitor(), FIRST, FOLLOWING)
    assert (first.verdict, first.reason) == (Decrease.NONE, 'first tick')
    assert (first.value, first.in_domain, first.in_terminal_set) == (10.0, True, False)
    assert math.isnan(first.promised)
    assert math.isnan(first.excess)
    assert second.verdict is Decrease.KEPT
    assert (second.value, second.promised, second.excess) == (8.0, 8.0, 0.0)
    assert (second.reason, second.warning) == ('', '')
    assert (second.counters.made, second.counters.checked, second.counters.broken) == (2, 1, 0)


def test_a_broken_promise_says_by_how_much() -> None:
    _, record = observe(monitor(), FIRST, Solved(8.5, 7.0))
    assert record.verdict is Decrease.BROKEN
    assert (record.excess, record.relative_excess) == (0.5, 0.25)
    assert record.reason == record.warning == (
        'the value function fell 25 % less than promised (by 1.5, not 2): '
        'a disturbance, a torque that came late, or a plant that differs from the model')
    assert record.counters.broken == 1
    assert record.counters.largest_excess == 0.25


@pytest.mark.parametrize(('value', 'said'), [
    (10.01, 'the value function did not fall (promised: a fall by 2)'),
    (11.0, 'the value function rose by 1 (promised: a fall by 2)'),
])
def test_a_value_that_does_not_fall(value: float, said: str) -> None:
    _, record = observe(monitor(), FIRST, Solved(value, 9.0))
    assert record.verdict is Decrease.BROKEN
    assert record.reason.startswith(said)


def test_a_plan_that_has_not_converged_is_named_as_a_cause() -> None:
    _, record = observe(monitor(), FIRST, Solved(9.0, 8.0, status=SolveStatus.FEASIBLE))
    assert record.verdict is Decrease.BROKEN
    assert 'a plan that has not converged' in record.reason


@pytest.mark.parametrize('answer', [OUTSIDE, FAILED])
def test_leaving_the_domain_breaks_the_promise(answer: Solved) -> None:
    _, record, after = observe(monitor(), FIRST, answer, FIRST)
    assert record.verdict is Decrease.BROKEN
    assert 'ends in the terminal set' in record.reason
    assert record.in_domain is False
    assert math.isnan(record.excess)
    assert record.counters.outside_domain == 1
    assert record.counters.largest_excess == 0.0
    assert (after.verdict, after.reason) == (
        Decrease.NONE, 'the last state was outside the domain of attraction')


def test_the_terminal_set() -> None:
    inside, edge, outside = observe(monitor(), Solved(1, 0.5, 0.2), Solved(0.5, 0.2, 1.0),
                                    Solved(0.2, 0.1, 1.0 + 1e-12))
    assert (inside.in_terminal_set, edge.in_terminal_set, outside.in_terminal_set) == (
        True, True, False)


def test_each_gap_ends_the_promise() -> None:
    """A value far above the promise is no news when the promise had ended."""
    high = Solved(100.0, 90.0)
    for why in ('the setpoint changed', 'reset'):
        watch = monitor()
        observe(watch, FIRST)
        watch.suspend(why)
        record = watch.observe(high, time_s=STEP_S)
        assert (record.verdict, record.reason, record.warning) == (Decrease.NONE, why, '')
    watch = monitor()
    watch.observe(FIRST, time_s=0.0, applied=False)
    record = watch.observe(high, time_s=STEP_S)
    assert (record.verdict, record.reason) == (
        Decrease.NONE, 'not the torque of the plan was commanded')
    watch = monitor()
    observe(watch, FIRST)
    paused = watch.observe(None, time_s=STEP_S, why_none='paused by the operator')
    assert (paused.verdict, paused.reason) == (Decrease.NONE, 'paused by the operator')
    assert math.isnan(paused.value)
    record = watch.observe(high, time_s=2 * STEP_S)
    assert (record.verdict, record.reason) == (Decrease.NONE, 'paused by the operator')
    assert observe(monitor(), OUTSIDE, high)[-1].verdict is Decrease.NONE


@pytest.mark.parametrize(('time_s', 'verdict'), [
    (0.0, Decrease.NONE), (0.1, Decrease.NONE), (0.26, Decrease.BROKEN), (0.5, Decrease.BROKEN),
    (0.74, Decrease.BROKEN), (1.0, Decrease.NONE), (-5.0, Decrease.NONE)])
def test_only_successive_ticks_are_compared(time_s: float, verdict: Decrease) -> None:
    watch = monitor()
    watch.observe(FIRST, time_s=100.0)
    record = watch.observe(Solved(20.0, 18.0), time_s=100.0 + time_s)
    assert record.verdict is verdict
    if verdict is Decrease.NONE:
        assert record.reason == 'a tick is missing or out of time'


def test_an_early_tick_may_have_that_much_of_the_decrease_missing() -> None:
    for early, value, verdict in ((0.0, 8.3, Decrease.BROKEN), (0.1, 8.3, Decrease.KEPT),
                                  (0.1, 8.5, Decrease.BROKEN)):
        watch = monitor()
        watch.observe(FIRST, time_s=0.0)
        record = watch.observe(Solved(value, 7.0), time_s=(1.0 - early) * STEP_S)
        assert record.verdict is verdict


def test_a_late_torque_may_have_twice_its_part_of_the_decrease_missing() -> None:
    for late, value, verdict in ((0.0, 8.5, Decrease.BROKEN), (0.1, 8.5, Decrease.KEPT),
                                 (0.1, 8.7, Decrease.BROKEN), (0.6, 20.0, Decrease.NONE)):
        watch = monitor()
        watch.observe(FIRST, time_s=0.0, delay_s=late * STEP_S)
        record = watch.observe(Solved(value, 7.0), time_s=STEP_S)
        assert record.verdict is verdict
    assert record.reason == 'the last torque came late'


def test_without_the_terminal_set_nothing_is_promised() -> None:
    records = observe(monitor(certified=False), FIRST, Solved(100.0, 90.0), OUTSIDE)
    assert {record.verdict for record in records} == {Decrease.NONE}
    assert {record.reason for record in records} == {'terminal_constraint is false'}
    assert {record.in_domain for record in records} == {None}
    assert records[-1].counters.made == records[-1].counters.outside_domain == 0


def test_a_warning_stays_for_a_few_ticks_and_a_burst_begins_once() -> None:
    kept = [Solved(8.0 * 0.8**k, 8.0 * 0.8**(k + 1)) for k in range(HOLD_TICKS + 3)]
    bad = Solved(11.0, 10.0)
    records = observe(monitor(), FIRST, bad, bad, Solved(10.0, 8.0), *kept, bad)
    warned = [bool(record.warning) for record in records]
    assert warned == [False, True, True, *[True] * HOLD_TICKS, *[False] * 4, True]
    assert [record.burst for record in records].count(True) == 2
    assert records[1].burst
    assert records[-1].burst
    assert records[3].warning.startswith('1 tick ago: the value function did not fall')
    assert records[4].warning.startswith('2 ticks ago: ')


def test_clear_forgets_everything() -> None:
    watch = monitor()
    observe(watch, FIRST, Solved(11.0, 10.0))
    watch.clear()
    record, = observe(watch, FIRST)
    assert (record.verdict, record.reason, record.warning) == (Decrease.NONE, 'first tick', '')
    assert astuple(record.counters) == (1, 0, 0, 0, 0.0)


VALUES = st.floats(1e-25, 1e6)
PARTS = st.floats(0.0, 1.0)


@given(VALUES, st.lists(st.tuples(PARTS, PARTS), min_size=1, max_size=20))
def test_a_value_that_falls_as_promised_never_breaks(
        start: float, parts: list[tuple[float, float]]) -> None:
    """Each L is a part of V, and each next value at most V - L."""
    watch, value = monitor(tolerance=Tolerance(0.0, 1e-12)), start
    for index, (decrease, more) in enumerate(parts):
        promised = value * (1.0 - decrease)
        record = watch.observe(Solved(value, promised), time_s=index * STEP_S)
        assert record.verdict is (Decrease.KEPT if index else Decrease.NONE)
        value = promised * more
    assert record.counters.broken == 0


@given(st.floats(1e-3, 1e6), st.floats(0.05, 1.0), st.floats(0.0, 3.0))
def test_the_tolerance_is_a_part_of_the_decrease(
        value: float, part: float, missing: float) -> None:
    """Above ``decrease`` of L a promise is broken, below it is not, but for the floor."""
    decrease = part * value
    _, record = observe(monitor(tolerance=Tolerance(0.1, 1e-18)), Solved(value, value - decrease),
                        Solved(value - decrease + missing * decrease, 0.0))
    if abs(missing - 0.1) > 1e-4:
        assert (record.verdict is Decrease.BROKEN) == (missing > 0.1)
        assert record.relative_excess == pytest.approx(missing, abs=1e-6)


@given(st.floats(0.0, 1e-7), st.floats(0.0, 1.0))
def test_below_the_floor_nothing_is_broken(value: float, part: float) -> None:
    _, record = observe(monitor(), Solved(1e-9, part * 1e-9), Solved(value, 0.0))
    assert record.verdict is Decrease.KEPT


ANY = st.floats(allow_nan=True, allow_infinity=True)
ANSWERS = st.none() | st.builds(Solved, ANY, ANY, ANY, st.sampled_from(SolveStatus))
EVENTS = st.tuples(ANSWERS, st.booleans(), st.floats(-1.0, 2.0), st.booleans())


@given(st.lists(EVENTS, max_size=30), st.booleans())
def test_whatever_comes_the_counters_only_grow(
        events: list[tuple[Solved | None, bool, float, bool]], certified: bool) -> None:
    watch, time_s, before = monitor(certified=certified), 0.0, (0,) * 5
    for answer, applied, steps, suspended in events:
        time_s += steps * STEP_S
        if suspended:
            watch.suspend('anything')
        record = watch.observe(answer, time_s=time_s, applied=applied)
        now = astuple(record.counters)
        assert all(new >= old for new, old in zip(now, before, strict=True))
        assert record.counters.broken <= record.counters.checked <= record.counters.made
        assert math.isfinite(record.counters.largest_excess)
        assert (record.verdict is not Decrease.BROKEN) or record.warning == record.reason != ''
        if suspended or not certified:
            assert record.verdict is Decrease.NONE
        before = now


def test_no_measurement_error_is_worth_more_than_the_floor() -> None:
    """F(e) <= value_of_noise for every error e of attitude and rate, and nearly so for one."""
    rng = generator('floor')
    for n, step_s, noise in ((6, 0.5, 1e-4), (5, 2.0, 1e-3), (6, 1.0, 1e-2)):
        root = rng.normal(size=(n, n))
        P = root @ root.T + 0.1 * np.eye(n)
        attitude = noise * unit_vectors(rng, 20000)[:, :n - 3]
        rate = noise / step_s * unit_vectors(rng, 20000)
        errors = np.hstack([attitude, rate])
        values = np.einsum('ki,ij,kj->k', errors, P, errors) / 2.0
        floor = value_of_noise(P, step_s, noise)
        assert 0.2 * floor < values.max() <= floor
