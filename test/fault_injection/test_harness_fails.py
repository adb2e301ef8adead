# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The harness can fail: a controller that is broken on purpose does not survive it."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from manifold_mpc_ros.lab.fault_injection import trial
from manifold_mpc_ros.lab.fault_injection.evidence import TrialVerdict
from manifold_mpc_ros.lab.fault_injection.fault import CONTROLLER, Phase
from manifold_mpc_ros.lab.fault_injection.rig import BenchPlan
from manifold_mpc_ros.lab.fault_injection.run import Done, run_trials
from manifold_mpc_ros.lab.fault_injection.schedule import Trial
from manifold_mpc_ros.lab.fault_injection.table import faults_named

CONFIG = Path(__file__).parents[2] / 'config' / 'chaos'
WAYS = ('good', 'nan', 'over', 'silent', 'twice', 'unseen', 'dies')
STUB = Path(__file__).with_name('broken_controller.py')


def inject(way: str) -> Done:
    """Inject NaN into the states of a controller that fails in a way of its own."""
    plan = BenchPlan(CONFIG / 'controller.yaml', CONFIG / 'simulator.yaml',
                     programs={CONTROLLER: [sys.executable, str(STUB), way]})
    fault, = faults_named(['state-nan-attitude'])
    fault = replace(fault, expected=replace(fault.expected, recovery_s=3.0), duration_s=1.0)
    nothing, = faults_named(['none'])
    trials = [Trial(each, Phase.ACCELERATION, 0) for each in (nothing, fault)]
    return run_trials(plan, trials, 1, 0, lambda _: None)


@pytest.fixture(scope='module')
def runs() -> dict[str, Done]:
    """Two at a time, each on a domain of its own."""
    with ThreadPoolExecutor(2) as pool:
        return dict(zip(WAYS, pool.map(inject, WAYS), strict=True))


def verdict(done: Done) -> TrialVerdict:
    """Return the verdict under the fault; without one nothing is held against the controller."""
    assert done.failure == ''
    before, under_fault = done.verdicts
    if before.void or under_fault.void:
        pytest.skip('the machine took too much time away in every attempt')
    assert before.survived, before
    return under_fault


def test_one_that_does_well_survives(runs: dict[str, Done]) -> None:
    seen = verdict(runs['good'])
    assert seen.survived, seen
    assert seen.modes[:2] in (('NOMINAL', 'HOLD'), ('HOLD', 'NOMINAL'))
    assert seen.detection_s is not None
    assert 0.0 <= seen.detection_s < 1.0 + seen.late_s + seen.starved_s
    assert seen.recovery_s is not None


@pytest.mark.parametrize(('way', 'words'), [
    ('nan', 'commands were not finite'),
    ('over', 'commands were over the limit'),
    ('silent', 'no command for'),
    ('twice', 'commands beyond one per tick'),
    ('unseen', 'not noticed: '),
])
def test_one_that_fails_does_not(runs: dict[str, Done], way: str, words: str) -> None:
    """It is named for what it does, at most excused by what the machine was late by."""
    seen = verdict(runs[way])
    assert seen.excused or not seen.survived
    assert any(words in reason for reason in (*seen.reasons, *seen.excused)), seen


def test_one_that_dies_does_not(runs: dict[str, Done]) -> None:
    seen = verdict(runs['dies'])
    assert not seen.survived
    assert seen.exceptions > 0
    assert any('the controller ended by itself (status 1)' in reason for reason in seen.reasons)


def test_one_that_never_speaks_cannot_be_tested(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, 'START_S', 6.0)
    done = inject('mute')
    assert done.verdicts == []
    assert 'the nodes were not at work within 6 s' in done.failure
