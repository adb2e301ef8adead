# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Verdicts on evidence made up: each thing that must not be is held against the nodes."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from manifold_mpc_ros.lab.fault_injection import summary
from manifold_mpc_ros.lab.fault_injection.disturbances import lost
from manifold_mpc_ros.lab.fault_injection.evidence import Command, Evidence, Limits, Report
from manifold_mpc_ros.lab.fault_injection.fault import STATE, Expectation, Fault, OnTopic, Phase
from manifold_mpc_ros.lab.fault_injection.judge import judge

STEP_S = 0.02
LIMITS = Limits((1.0, 1.0, 1.0), STEP_S, 0.25)
FAULT = Fault('some', 'something', 'a row', OnTopic(STATE, lost()), Expectation(
    modes=frozenset({'HOLD'}), counters=('controller.refused.*', 'simulator.flag')))


def report(time_s: float, mode: str = 'NOMINAL', node: str = 'controller', **values: str
           ) -> Report:
    return Report(time_s, node, {'mode': mode, **values})


def evidence(**changes: object) -> Evidence:
    """Return what is seen of a fault from 10 s to 10.5 s that is survived."""
    seen = Evidence(
        FAULT, Phase.SLEW, 3, begun_s=10.0, before={'controller': {'refused.a': '5'}},
        ended_s=10.5, recovered_s=10.6, closed_s=10.7,
        commands=[Command(9.9 + STEP_S * k, (0.1, -1.0, 1.0)) for k in range(40)],
        reports=[report(10.02), report(10.1, 'HOLD'), report(10.6)])
    for name, value in changes.items():
        setattr(seen, name, value)
    return seen


def test_what_survives() -> None:
    verdict = judge(evidence(), LIMITS)
    assert verdict.survived
    assert verdict.excused == ()
    assert math.isclose(verdict.detection_s or 0.0, 0.1)
    assert math.isclose(verdict.recovery_s or 0.0, 0.1)
    assert math.isclose(verdict.longest_gap_s, STEP_S, rel_tol=0.1)
    assert verdict.modes == ('NOMINAL', 'HOLD')
    assert verdict.commands == 40


COMMANDS = evidence().commands
WITH_A_GAP = [c for c in COMMANDS if not 10.1 < c.time_s < 10.4]
UNNOTICED = [report(10.1), report(10.2, refused_other='9'), report(10.3, node='simulator')]


@pytest.mark.parametrize(('changes', 'words'), [
    ({'commands': [*COMMANDS, Command(10.7, (0.0, math.nan, 0.0))]}, '1 commands were not finite'),
    ({'commands': [*COMMANDS, Command(10.7, (0.0, -1.1, 0.0))]}, '1 commands were over the limit'),
    ({'commands': WITH_A_GAP}, 'no command for'),
    ({'commands': []}, 'no command for 0.700 s'),
    ({'commands': [*COMMANDS, *[Command(10.2, (0.0, 0.0, 0.0))] * 8]}, 'commands within one step'),
    ({'before': {'controller': {'missed_ticks': '2'}},
      'reports': [report(10.1, 'HOLD', missed_ticks='30')]}, '28 ticks said to be missed'),
    ({'tick_drift': -1}, '1 ticks without a command'),
    ({'exceptions': 2}, '2 unhandled exceptions'),
    ({'recovered_s': None}, 'did not recover within 1 s: controller NOMINAL'),
    ({'recovered_s': 11.6}, 'did not recover within 1 s'),
    ({'troubles': ['it died']}, 'it died'),
    ({'reports': UNNOTICED}, 'not noticed: HOLD or controller.refused.* or simulator.flag'),
    ({'fault': replace(FAULT, expected=Expectation(stays=frozenset({'NOMINAL'})))},
     'went into HOLD'),
])
def test_what_does_not(changes: dict[str, object], words: str) -> None:
    verdict = judge(evidence(**changes), LIMITS)
    assert not verdict.survived
    assert len(verdict.reasons) == 1, verdict.reasons
    assert words in verdict.reasons[0]


@pytest.mark.parametrize('sign', [
    report(10.2, 'HOLD'), report(10.2, **{'refused.a': '6'}), report(10.2, **{'refused.b': '1'}),
    report(10.2, node='simulator', flag='True')])
def test_each_sign_is_a_detection(sign: Report) -> None:
    verdict = judge(evidence(reports=[report(10.1, **{'refused.a': '5'}), sign]), LIMITS)
    assert verdict.survived
    assert math.isclose(verdict.detection_s or 0.0, 0.2)


def test_silence_is_allowed_where_the_source_is_dead() -> None:
    silent = replace(FAULT, expected=replace(FAULT.expected, silent=True))
    assert judge(evidence(fault=silent, commands=WITH_A_GAP), LIMITS).survived


def test_steps_of_simulated_time_may_come_at_once() -> None:
    burst = [*COMMANDS, *[Command(10.2, (0.0, 0.0, 0.0))] * 8]
    assert judge(evidence(commands=burst), replace(LIMITS, made_up_steps=12)).survived
    assert not judge(evidence(commands=burst * 3), replace(LIMITS, made_up_steps=12)).survived


def test_what_the_machine_was_late_by_is_an_excuse_that_is_said() -> None:
    for changes in ({'commands': WITH_A_GAP}, {'recovered_s': 11.6}):
        verdict = judge(evidence(**changes, late_s=0.1, starved_s=0.1), LIMITS)
        assert verdict.survived
        assert len(verdict.excused) == 1
    for changes in ({'tick_drift': 1}, {'exceptions': 1}, {'recovered_s': None}):
        assert not judge(evidence(**changes, late_s=9.0, starved_s=9.0), LIMITS).survived


def test_a_fault_is_void_when_the_machine_took_its_time_away() -> None:
    starved = {'recovered_s': None, 'starved_s': 0.3}
    assert judge(evidence(**starved), LIMITS).void
    assert not judge(evidence(recovered_s=None, starved_s=0.01), LIMITS).void
    assert not judge(evidence(starved_s=0.3), LIMITS).void  # it was survived
    for wrong in ({'exceptions': 1}, {'tick_drift': 2}, {'troubles': ['it died']},
                  {'commands': [*COMMANDS, Command(10.7, (math.nan,) * 3)]}):
        assert not judge(evidence(**starved, **wrong), LIMITS).void


def test_totals_and_groups() -> None:
    good = judge(evidence(), LIMITS)
    bad = judge(evidence(exceptions=1, recovered_s=None), LIMITS)
    figures = summary.totals([good, bad])
    assert (figures['faults_injected'], figures['faults_survived']) == (2, 1)
    assert figures['unhandled_exceptions'] == 1
    assert figures['recovery_s'] == {'median': good.recovery_s, 'max': good.recovery_s}
    group = summary.grouped([good, bad], lambda v: v.fault)['some']
    assert (group['injected'], group['survived']) == (2, 1)
    failed, = summary.not_survived([good, bad])
    assert failed['reasons'] == bad.reasons


def test_memory_that_grows_has_a_slope() -> None:
    samples = [(float(t), 100 * 2**20 + 1024 * (t if t >= 60 else 50 * t)) for t in range(400)]
    memory = summary.memory_of('controller', samples)
    assert memory.slope_kib_per_min is not None
    assert math.isclose(memory.slope_kib_per_min, 60.0, rel_tol=0.01)
    assert summary.memory_of('controller', samples[:200]).slope_kib_per_min is None
    assert summary.longest_lives([memory, summary.memory_of('controller', samples[:9])]) == [
        memory]
