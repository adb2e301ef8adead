# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The judgement on one injected fault: everything that is held against the nodes. Pure logic."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any

from manifold_mpc_ros.lab.fault_injection.evidence import (
    Command,
    Evidence,
    Limits,
    Report,
    TrialVerdict,
)
from manifold_mpc_ros.lab.fault_injection.fault import CONTROLLER, Fault

#: Commands within one step: a tick may come late and the next in time, and the end of activity
#: has three zeros; more is a burst of ticks that had been missed.
_MOST_IN_A_STEP = 6
#: Part of the time that a fault took; when the machine took more, nothing is said of the nodes.
_VOID_PART = 0.2
#: A reader that is late by more commands than the writer keeps has lost some for good.
_WRITER_DEPTH = 10
#: What the controller says of ticks that it missed.
_MISSED = 'missed_ticks'
#: Commands and missed ticks may differ from what was due by this many, and this part.
_ODD_TICKS, _ODD_PART = 3.0, 0.1
#: So many steps that the machine was late explain a mode that the fault does not.
_EXCUSE_STEPS = 2.5
#: Rounding that a command may be above a limit by [1].
_ROUNDING = 1e-9


def judge(seen: Evidence, limits: Limits) -> TrialVerdict:
    """Return the verdict on one fault: every reason why it counts as not survived.

    What the machine was late by is allowed for in the bounds on time, and where it is most of
    the age above which a state counts for nothing, also as a reason for another mode. What only
    that excuses is in ``excused``. A fault that was not survived on account of time alone, while
    the machine took much of that time away, says nothing about the nodes: it is ``void``.
    """
    figures = _figures(seen, limits)
    machine_s = seen.late_s + seen.starved_s
    wrong = _wrongs(seen, figures, limits)
    late = _delays(seen, figures, limits, machine_s)
    strict = _delays(seen, figures, limits, 0.0)
    return TrialVerdict(
        fault=seen.fault.name, row=seen.fault.row, phase=seen.phase.value, seed=seen.seed,
        reasons=(*wrong, *late), excused=tuple(reason for reason in strict if reason not in late),
        void=bool(late) and not wrong and machine_s > _VOID_PART * (seen.closed_s - seen.begun_s),
        silent=seen.fault.expected.silent, commands=len(seen.commands),
        tick_drift=seen.tick_drift, exceptions=seen.exceptions, late_s=seen.late_s,
        starved_s=seen.starved_s, modes=_modes(seen.reports), **figures)


def _figures(seen: Evidence, limits: Limits) -> dict[str, Any]:
    """Return what was measured."""
    times_s = [command.time_s for command in seen.commands]
    return {
        'detection_s': _detection(seen),
        'recovery_s': None if seen.recovered_s is None else seen.recovered_s - seen.ended_s,
        'longest_gap_s': longest_gap(
            [t for t in times_s if t >= seen.begun_s], seen.begun_s, seen.closed_s),
        'burst': largest_burst(times_s, limits.step_s),
        'missed_ticks': _missed(seen),
        'non_finite': sum(not all(map(math.isfinite, c.torque_B_n_m)) for c in seen.commands),
        'over_limit': sum(_over(c, limits.max_torque_n_m) for c in seen.commands),
    }


def _wrongs(seen: Evidence, figures: Mapping[str, Any], limits: Limits) -> list[str]:
    """Return what is held against the nodes however slow the machine is."""
    return [*seen.troubles, *(words for broken, words in (
        (figures['non_finite'] > 0, f'{figures["non_finite"]} commands were not finite'),
        (figures['over_limit'] > 0, f'{figures["over_limit"]} commands were over the limit'),
        (seen.exceptions > 0, f'{seen.exceptions} unhandled exceptions'),
        (seen.tick_drift > 0, f'{seen.tick_drift} commands beyond one per tick'),
        (figures['burst'] > _MOST_IN_A_STEP + limits.made_up_steps,
         f'{figures["burst"]} commands within one step'),
    ) if broken)]


def _delays(
    seen: Evidence, figures: Mapping[str, Any], limits: Limits, machine_s: float,
) -> list[str]:
    """Return what came too late or not at all, when the machine was late by so much [s]."""
    expected = seen.fault.expected
    recovery_s, gap_s = figures['recovery_s'], figures['longest_gap_s']
    strange = sorted(set(_modes(seen.reports)) - expected.stays) if expected.stays else []
    return [*seen.delays, *(words for broken, words in (
        (seen.tick_drift < 0 and machine_s < _WRITER_DEPTH * limits.step_s,
         f'{-seen.tick_drift} ticks without a command'),
        (not expected.silent and _unaccounted(seen, figures['missed_ticks'], limits),
         f'{_sent(seen)} commands and {figures["missed_ticks"]} ticks said to be missed are not '
         f'all that were due in {seen.closed_s - seen.begun_s:.2f} s'),
        (recovery_s is None or recovery_s > expected.recovery_s + machine_s,
         f'did not recover within {expected.recovery_s:g} s: {_last_words(seen.reports)}'),
        (not expected.silent and gap_s > limits.longest_gap_s + machine_s,
         f'no command for {gap_s:.3f} s'),
        (expected.visible and figures['detection_s'] is None,
         f'not noticed: {_signs(seen.fault)}'),
        (bool(strange) and machine_s < _EXCUSE_STEPS * limits.step_s,
         f'went into {", ".join(strange)}'),
    ) if broken)]


def longest_gap(times_s: Sequence[float], begun_s: float, closed_s: float) -> float:
    """Return the longest time without a command between two times [s]."""
    marks = [begun_s, *sorted(times_s), closed_s]
    return max(b - a for a, b in itertools.pairwise(marks))


def largest_burst(times_s: Sequence[float], step_s: float) -> int:
    """Return the most commands within the length of one step."""
    times_s = sorted(times_s)
    return max((bisect_right(times_s, t + step_s) - i for i, t in enumerate(times_s)), default=0)


def _sent(seen: Evidence) -> int:
    """Return the number of commands from the beginning of the fault on."""
    return sum(seen.begun_s <= command.time_s <= seen.closed_s for command in seen.commands)


def _missed(seen: Evidence) -> int | None:
    """Return how many ticks the controller says that it missed; None where it does not say."""
    said = [report.values for report in seen.reports if report.node == CONTROLLER]
    before = seen.before.get(CONTROLLER, {}).get(_MISSED)
    if before is None or not said or _MISSED not in said[-1] or seen.fault.simulated_time:
        return None  # where time itself is disturbed, so is what was due
    missed = int(said[-1][_MISSED]) - int(before)
    return missed if missed >= 0 else None  # it was started again


def _unaccounted(seen: Evidence, missed: int | None, limits: Limits) -> bool:
    """Whether commands and missed ticks together are clearly not what was due by the clock."""
    if missed is None:
        return False
    due = (seen.closed_s - seen.begun_s) / limits.step_s
    return abs(_sent(seen) + missed - due) > _ODD_TICKS + _ODD_PART * due


def _over(command: Command, limits: Sequence[float]) -> bool:
    """Whether a command is beyond a limit."""
    return any(abs(value) > limit * (1.0 + _ROUNDING)
               for value, limit in zip(command.torque_B_n_m, limits, strict=True))


def _modes(reports: Iterable[Report]) -> tuple[str, ...]:
    """Return the controller's modes in the order in which they were first seen."""
    return tuple(dict.fromkeys(
        r.mode for r in reports if r.node == CONTROLLER and r.mode))


def _detection(seen: Evidence) -> float | None:
    """Return the time from the beginning until a sign of the fault [s], None without one."""
    expected = seen.fault.expected
    for report in seen.reports:
        if report.node == CONTROLLER and report.mode in expected.modes:
            return report.time_s - seen.begun_s
        before = seen.before.get(report.node, {})
        for pattern in expected.counters:
            node, _, keys = pattern.partition('.')
            if node == report.node and _grown(report.values, before, keys):
                return report.time_s - seen.begun_s
    return None


def _grown(now: Mapping[str, str], before: Mapping[str, str], pattern: str) -> bool:
    """Whether a counter whose name fits is larger than before, or a flag is up that was not."""
    return any(fnmatchcase(key, pattern) and _number(value) > _number(before.get(key, '0'))
               for key, value in now.items())


def _number(text: str) -> float:
    """Return a counter; a flag counts as 0 or 1, another text as 0."""
    try:
        return float(text)
    except ValueError:
        return float(text == 'True')


def _last_words(reports: Sequence[Report]) -> str:
    """Return what each node said last."""
    last = {report.node: report for report in reports}
    return ', '.join(f'{node} {report.mode} ({report.values.get("message", "")})'
                     for node, report in last.items()) or 'no word from either node'


def _signs(fault: Fault) -> str:
    """Say what should have been seen."""
    return ' or '.join([*sorted(fault.expected.modes), *fault.expected.counters])
