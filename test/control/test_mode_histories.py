# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The mode logic: invariants over drawn histories."""

from __future__ import annotations

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from properties import PROPERTY

from manifold_mpc_ros.control.modes import (
    ACTING,
    MOST_INTERNAL_ERRORS,
    REENTRY_STATES,
    Facts,
    Mode,
    ModeLogic,
    SolveOutcome,
)

STEP_NS = 10


class Histories(RuleBasedStateMachine):
    """Whatever happens in whatever order, beside a model that only remembers what came."""

    @initialize(timeout_ns=st.integers(1, 200))
    def begin(self, timeout_ns: int) -> None:
        self.logic = ModeLogic(STEP_NS, timeout_ns)
        self.timeout_ns = timeout_ns
        self.propagate_ns = min(2 * STEP_NS, timeout_ns)
        self.faulted = self.stopped = self.lost = self.restarted = False
        self.states = self.errors = 0
        self.mode = Mode.WAIT

    @rule()
    def see_a_state(self) -> None:
        self.logic.see()
        self.states += 1

    @rule()
    def fault(self) -> None:
        self.logic.fault('why')
        self.faulted = True

    @rule()
    def reset(self) -> None:
        self.logic.reset()
        self.faulted = self.lost = self.restarted = False
        self.states = self.errors = 0

    @rule()
    def stop(self) -> None:
        self.logic.stop()
        self.stopped = True

    @rule()
    def start(self) -> None:
        self.logic.start()
        self.stopped = False
        self.faulted = self.lost = self.restarted = False
        self.states = self.errors = 0

    @rule(paused=st.booleans())
    def pause(self, paused: bool) -> None:
        self.logic.paused = paused

    @rule()
    def restart(self) -> None:
        self.logic.restart()
        self.restarted = True

    @rule()
    def fail(self) -> None:
        self.mode = self.logic.fail('why').mode
        self.errors += 1
        self.faulted = self.faulted or self.errors >= MOST_INTERNAL_ERRORS
        assert self.mode not in ACTING

    @rule(facts=st.builds(
        Facts, st.none() | st.integers(0, 300), st.sampled_from(SolveOutcome), st.booleans()))
    def tick(self, facts: Facts) -> None:
        wanted = self.logic.wants_plan(facts.age_ns)
        decision = self.logic.decide(facts)
        self.logic.enter(decision)
        self.logic.succeed()
        self.errors = 0
        self.mode = mode = decision.mode
        assert (mode is Mode.STOPPING) == self.stopped
        assert (mode is Mode.FAULT) == (self.faulted and not self.stopped)
        if mode in ACTING:
            self.check_acting(facts, mode, wanted)
        if mode is Mode.COAST and (facts.age_ns or 0) > self.propagate_ns:
            self.lost, self.states = True, 0
        if mode is Mode.WAIT and facts.age_ns is not None:
            assert self.restarted
            self.restarted = False

    def check_acting(self, facts: Facts, mode: Mode, wanted: bool) -> None:
        """Torque only from a state that may be used, for the reason that the mode stands for."""
        assert facts.age_ns is not None
        assert facts.age_ns <= self.timeout_ns
        assert not self.logic.paused
        assert not self.restarted
        assert not self.lost or self.states >= REENTRY_STATES
        self.lost = False
        usable = facts.outcome is SolveOutcome.USABLE and facts.age_ns <= self.propagate_ns
        assert (mode is Mode.NOMINAL) == usable
        assert wanted == (facts.age_ns <= self.propagate_ns)
        if mode is Mode.HOLD:
            assert facts.held
        if mode is Mode.FALLBACK:
            assert facts.age_ns <= self.propagate_ns
            assert facts.outcome is SolveOutcome.BEYOND_GUARD or not facts.held

    @invariant()
    def what_is_latched_stays(self) -> None:
        if getattr(self, 'stopped', False) or getattr(self, 'faulted', False):
            assert not self.logic.wants_plan(0)


TestHistories = Histories.TestCase
TestHistories.settings = settings(PROPERTY, stateful_step_count=15)
