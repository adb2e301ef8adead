# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The mode logic: every transition by itself."""

from __future__ import annotations

import pytest

from manifold_mpc_ros.control.modes import (
    MOST_INTERNAL_ERRORS,
    REENTRY_STATES,
    Decision,
    Facts,
    Mode,
    ModeLogic,
    SolveOutcome,
)

STEP_NS = 10
TIMEOUT_NS = 50
PROPAGATE_NS = 20
GOOD = Facts(0, SolveOutcome.USABLE, detail='solved')


def logic_with_state() -> ModeLogic:
    logic = ModeLogic(STEP_NS, TIMEOUT_NS)
    logic.see()
    return logic


def decided(logic: ModeLogic, facts: Facts) -> Decision:
    """Decide a tick, and take the decision."""
    decision = logic.decide(facts)
    logic.enter(decision)
    return decision


@pytest.mark.parametrize(('facts', 'mode', 'reason'), [
    (Facts(None), Mode.WAIT, 'waiting for the first valid state'),
    (GOOD, Mode.NOMINAL, 'solved'),
    (Facts(PROPAGATE_NS, SolveOutcome.USABLE), Mode.NOMINAL, ''),
    (Facts(0, SolveOutcome.NONE, held=True, detail='late'), Mode.HOLD, 'late'),
    (Facts(0, SolveOutcome.NONE, detail='late'), Mode.FALLBACK, 'late'),
    (Facts(0, SolveOutcome.BEYOND_GUARD, held=True, detail='fast'), Mode.FALLBACK, 'fast'),
    (Facts(PROPAGATE_NS + 1, held=True), Mode.HOLD, 'the state is 0.000 s old'),
    (Facts(PROPAGATE_NS + 1, SolveOutcome.USABLE), Mode.COAST,
     'the state is 0.000 s old, without a plan'),
    (Facts(TIMEOUT_NS, held=True), Mode.HOLD, 'the state is 0.000 s old'),
    (Facts(TIMEOUT_NS + 1, SolveOutcome.USABLE, held=True), Mode.COAST,
     'the state is 0.000 s old'),
    (Facts(3 * 10**9, held=True), Mode.COAST, 'the state is 3.000 s old'),
    (Facts(PROPAGATE_NS, SolveOutcome.USABLE, refused='no wheels'), Mode.FALLBACK, 'no wheels'),
    (Facts(PROPAGATE_NS + 1, held=True, refused='no wheels'), Mode.FALLBACK, 'no wheels'),
    (Facts(PROPAGATE_NS + 1, refused='no wheels'), Mode.COAST,
     'the state is 0.000 s old, without a plan'),
])
def test_one_tick(facts: Facts, mode: Mode, reason: str) -> None:
    logic = logic_with_state()
    decision = logic.decide(facts)
    assert (decision.mode, decision.reason) == (mode, reason)
    assert logic.decide(facts) == decision  # nothing has changed by asking
    assert logic.wants_plan(0)


def test_a_timeout_below_two_steps_bounds_the_propagation() -> None:
    logic = ModeLogic(STEP_NS, 15)
    assert logic.wants_plan(15)
    assert not logic.wants_plan(16)
    logic.set_timeout(TIMEOUT_NS)
    assert logic.wants_plan(PROPAGATE_NS)
    assert not logic.wants_plan(PROPAGATE_NS + 1)
    assert not logic.wants_plan(None)


def test_a_lost_state_comes_back_after_five_valid_ones_in_a_row() -> None:
    logic = logic_with_state()
    assert decided(logic, Facts(TIMEOUT_NS + 1)).mode is Mode.COAST
    for count in range(REENTRY_STATES - 1):
        decision = decided(logic, GOOD)
        assert decision.mode is Mode.COAST
        assert decision.reason == (
            f'{count} of 5 valid states after the last one was too old or contradicted itself')
        assert not logic.wants_plan(0)
        logic.see()
    assert decided(logic, Facts(TIMEOUT_NS + 1)).mode is Mode.COAST  # lost again: count anew
    for _ in range(REENTRY_STATES):
        assert decided(logic, GOOD).mode is Mode.COAST
        logic.see()
    assert logic.wants_plan(0)
    assert decided(logic, GOOD).mode is Mode.NOMINAL
    assert decided(logic, Facts(0, SolveOutcome.NONE)).mode is Mode.FALLBACK


def test_a_fault_latches_with_its_first_reason_until_a_reset() -> None:
    logic = logic_with_state()
    logic.fault('two publishers')
    logic.fault('something else')
    decision = decided(logic, GOOD)
    assert (decision.mode, decision.reason) == (
        Mode.FAULT, 'two publishers (zero until ~/reset)')
    assert not logic.wants_plan(0)
    logic.reset()
    assert decided(logic, GOOD).mode is Mode.NOMINAL


def test_a_pause_outlives_a_reset_and_an_old_state() -> None:
    logic = logic_with_state()
    logic.paused = True
    assert not logic.wants_plan(0)
    logic.reset()
    decision = decided(logic, Facts(TIMEOUT_NS + 1))
    assert (decision.mode, decision.reason) == (Mode.PAUSED, 'paused by the operator')
    logic.paused = False
    assert logic.wants_plan(0)


def test_time_that_started_again_is_one_tick_of_zero() -> None:
    logic = logic_with_state()
    logic.restart()
    assert not logic.wants_plan(0)
    decision = decided(logic, GOOD)
    assert (decision.mode, decision.reason) == (Mode.WAIT, 'time started again')
    assert decided(logic, GOOD).mode is Mode.NOMINAL
    logic.restart()
    decided(logic, Facts(None))  # without a state the restart is not over
    assert decided(logic, GOOD).reason == 'time started again'
    logic.restart()
    logic.reset()
    assert decided(logic, GOOD).mode is Mode.NOMINAL


def test_a_state_that_ages_without_a_plan_is_lost() -> None:
    logic = logic_with_state()
    assert decided(logic, Facts(PROPAGATE_NS + 1)).mode is Mode.COAST
    assert decided(logic, GOOD).reason.startswith('0 of 5 valid states')


class Comparison:
    """Says of the states what a test wants."""

    def __init__(self) -> None:
        self.is_ready, self.contradiction, self.is_latched = True, '', False
        self.observed: list[object] = []
        self.forgotten = 0

    def observe(self, sample: object) -> None:
        self.observed.append(sample)

    def forget(self) -> None:
        self.forgotten += 1


def test_states_that_contradict_themselves_are_lost_and_latch_in_the_end() -> None:
    logic, sample = logic_with_state(), object()
    logic.consistency = states = Comparison()
    states.is_ready = False
    assert decided(logic, GOOD).reason == 'comparing attitude and rate of the first states'
    assert not logic.wants_plan(0)
    states.is_ready, states.contradiction = True, 'the rate is in deg/s'
    assert not logic.wants_plan(0)
    decision = decided(logic, GOOD)
    assert (decision.mode, decision.reason) == (Mode.COAST, 'the rate is in deg/s')
    states.contradiction = ''
    assert decided(logic, GOOD).reason.startswith('0 of 5 valid states')
    logic.compare(sample)
    assert states.observed == [sample]
    assert decided(logic, GOOD).mode is Mode.COAST
    states.contradiction, states.is_latched = 'the rate is in deg/s', True
    logic.compare(sample)
    assert decided(logic, GOOD).reason == 'the rate is in deg/s (zero until ~/reset)'
    logic.reset()
    assert states.forgotten == 1


def test_errors_in_a_row_latch_and_others_do_not() -> None:
    logic = logic_with_state()
    for _ in range(3):
        for _ in range(MOST_INTERNAL_ERRORS - 1):
            decision = logic.fail('why')
            assert (decision.mode, decision.reason) == (Mode.WAIT, 'this tick failed: why')
        logic.succeed()
    for _ in range(MOST_INTERNAL_ERRORS - 1):
        logic.fail('why')
    decision = logic.fail('why')
    assert (decision.mode, decision.reason) == (
        Mode.FAULT, '3 ticks in a row failed: why (zero until ~/reset)')
    logic.reset()
    assert logic.fail('why').mode is Mode.WAIT


def test_the_end_is_final() -> None:
    logic = logic_with_state()
    logic.fault('first')
    logic.stop()
    logic.reset()
    assert decided(logic, GOOD).mode is Mode.STOPPING
    assert decided(logic, GOOD).reason == 'stopping'
    assert logic.fail('why').mode is Mode.STOPPING
    assert not logic.wants_plan(0)


def test_a_start_after_the_end_waits_anew() -> None:
    logic = logic_with_state()
    logic.paused = True
    logic.fault('first')
    logic.stop()
    logic.start()
    assert logic.wants_plan(0)
    assert decided(logic, Facts(None)).mode is Mode.WAIT
    assert decided(logic, GOOD).mode is Mode.NOMINAL
