# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The mode logic of the active controller: what is known at a tick in, the mode out.

Nothing here knows ROS, a clock or the solver. `ModeLogic.decide` is the whole rule, the worst
that applies first, and changes nothing; `ModeLogic.enter` takes its decision. docs/safety.md
draws it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from manifold_mpc_ros.control.consistency import ConsistencyCheck
from manifold_mpc_ros.control.input_gate import NANOSECONDS, StateSample

#: A state older than this many steps is not moved on to the tick.
PROPAGATE_STEPS = 2
#: The stored plan is followed for at most this many ticks, and at most half the horizon.
LONGEST_HOLD_TICKS = 5
#: Valid states after the last one was too old, before the controller acts again.
REENTRY_STATES = 5
#: Ticks in a row that failed by an error of our own, after which the controller latches zero.
MOST_INTERNAL_ERRORS = 3


class Mode(str, Enum):
    """What the active controller is doing."""

    WAIT = 'WAIT'          # zero torque, not enough valid states have come yet
    NOMINAL = 'NOMINAL'    # the torque of the optimiser
    HOLD = 'HOLD'          # the stored plan, shifted by the time since it was made
    FALLBACK = 'FALLBACK'  # a saturated law on SO(3): there is no plan to follow
    COAST = 'COAST'        # zero torque, the state is too old or contradicts itself
    PAUSED = 'PAUSED'      # zero torque, by the operator
    FAULT = 'FAULT'        # zero torque, latched until the operator resets
    STOPPING = 'STOPPING'  # zero torque, the last commands of all


#: The modes that command torque; in every other mode it is zero.
ACTING = frozenset({Mode.NOMINAL, Mode.HOLD, Mode.FALLBACK})


class SolveOutcome(Enum):
    """What became of the request to the solver."""

    NOT_REQUESTED = 'not requested'
    USABLE = 'usable'
    NONE = 'none'
    BEYOND_GUARD = 'beyond guard'  # the implicit step is not guaranteed at this rate


@dataclass(frozen=True)
class Facts:
    """What is known at a tick.

    ``age_ns`` is the age of the newest valid state, the larger of what its stamp and what its
    receipt say; None before the first. ``held`` says whether a stored plan still covers this
    tick, ``detail`` why the outcome of the request is what it is, ``refused`` why the actuator can
    give no torque, empty when it can.
    """

    age_ns: int | None
    outcome: SolveOutcome = SolveOutcome.NOT_REQUESTED
    held: bool = False
    detail: str = ''
    refused: str = ''


@dataclass(frozen=True)
class Decision:
    """The mode of a tick, and the sentence that says why.

    ``lost``: the state is too old, valid ones count anew. ``resumed``: this was the tick of zero
    after time started again.
    """

    mode: Mode
    reason: str
    lost: bool = False
    resumed: bool = False


class ModeLogic:
    """The state machine: what outlives a tick is whether it stopped, latched, paused, or lost.

    Arguments
    ---------
    step_ns, timeout_ns
        Control step, and the age above which a state counts for nothing.

    """

    def __init__(self, step_ns: int, timeout_ns: int) -> None:
        """Wait for the first state."""
        self._step_ns = step_ns
        self.set_timeout(timeout_ns)
        self._stopping = False
        self.paused = False
        self.consistency = ConsistencyCheck()
        self.reset()

    def reset(self) -> None:
        """Leave FAULT and forget what was seen; a pause stays, and so does the end."""
        self._fault = ''
        self._errors = 0
        self._states_to_come = 0
        self._restarted = False
        self.consistency.forget()

    def start(self) -> None:
        """Begin to act, after an end too: wait for the first state, not paused."""
        self._stopping = False
        self.paused = False
        self.reset()

    def stop(self) -> None:
        """Command zero from now on, until the next start."""
        self._stopping = True

    def fault(self, reason: str) -> None:
        """Latch zero; the first reason stays."""
        self._fault = self._fault or reason

    def fail(self, error: str) -> Decision:
        """Return zero for a tick that ended in an error of our own; too many in a row latch."""
        self._errors += 1
        if self._errors >= MOST_INTERNAL_ERRORS:
            self.fault(f'{self._errors} ticks in a row failed: {error}')
        if self._stopping or self._fault:
            return self.decide(Facts(None))
        return Decision(Mode.WAIT, f'this tick failed: {error}')

    def succeed(self) -> None:
        """Note a tick without an error of our own."""
        self._errors = 0

    def set_timeout(self, timeout_ns: int) -> None:
        """Set the age above which a state counts for nothing."""
        self._timeout_ns = timeout_ns
        self._propagate_ns = min(PROPAGATE_STEPS * self._step_ns, timeout_ns)

    def restart(self) -> None:
        """Note that time started again: one tick of zero, then on."""
        self._restarted = True

    def see(self) -> None:
        """Note a valid state."""
        self._states_to_come = max(0, self._states_to_come - 1)

    def compare(self, sample: StateSample) -> None:
        """Compare a state with those before; too many that contradict themselves latch zero."""
        self.consistency.observe(sample)
        if self.consistency.is_latched:
            self.fault(self.consistency.contradiction)

    def wants_plan(self, age_ns: int | None) -> bool:
        """Return whether a plan asked for now could be used."""
        return (age_ns is not None and age_ns <= self._propagate_ns and not self._stopping
                and not self._fault and not self._restarted and not self.paused
                and not self._states_to_come and self.consistency.is_ready
                and not self.consistency.contradiction)

    def enter(self, decision: Decision) -> None:
        """Take the decision of a tick: a restart is over, or a lost state has to come back."""
        if decision.resumed:
            self._restarted = False
        if decision.lost:
            self._states_to_come = REENTRY_STATES

    def decide(self, facts: Facts) -> Decision:
        """Return the mode of this tick: the worst that applies."""
        age_ns = facts.age_ns
        if self._stopping:
            return Decision(Mode.STOPPING, 'stopping')
        if self._fault:
            return Decision(Mode.FAULT, f'{self._fault} (zero until ~/reset)')
        if age_ns is None:
            return Decision(Mode.WAIT, 'waiting for the first valid state')
        return self._withheld(age_ns) or self._acting(facts, age_ns)

    def _withheld(self, age_ns: int) -> Decision | None:
        """Return why the torque is zero although a state has come, None if it need not be."""
        if self._restarted:
            return Decision(Mode.WAIT, 'time started again', resumed=True)
        if self.paused:
            return Decision(Mode.PAUSED, 'paused by the operator')
        if age_ns > self._timeout_ns:
            return Decision(Mode.COAST, _old(age_ns), lost=True)
        if not self.consistency.is_ready:
            return Decision(Mode.WAIT, 'comparing attitude and rate of the first states')
        if self.consistency.contradiction:
            return Decision(Mode.COAST, self.consistency.contradiction, lost=True)
        if self._states_to_come:
            came = REENTRY_STATES - self._states_to_come
            return Decision(Mode.COAST, f'{came} of {REENTRY_STATES} valid states after the last '
                                        'one was too old or contradicted itself')
        return None

    def _acting(self, facts: Facts, age_ns: int) -> Decision:
        """Return where the torque comes from, zero where there is nothing left."""
        if facts.refused and (age_ns <= self._propagate_ns or facts.held):
            return Decision(Mode.FALLBACK, facts.refused)
        if age_ns <= self._propagate_ns:
            if facts.outcome is SolveOutcome.USABLE:
                return Decision(Mode.NOMINAL, facts.detail)
            if facts.outcome is SolveOutcome.BEYOND_GUARD or not facts.held:
                return Decision(Mode.FALLBACK, facts.detail)
            return Decision(Mode.HOLD, facts.detail)
        if facts.held:
            return Decision(Mode.HOLD, _old(age_ns))
        return Decision(Mode.COAST, f'{_old(age_ns)}, without a plan', lost=True)


def _old(age_ns: int) -> str:
    """Say how old the state is."""
    return f'the state is {age_ns / NANOSECONDS:.3f} s old'
