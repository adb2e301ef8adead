# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of faults and the runs that are made of it."""

from __future__ import annotations

from collections import Counter

import pytest

from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.fault_injection import schedule
from manifold_mpc_ros.lab.fault_injection.fault import Phase
from manifold_mpc_ros.lab.fault_injection.table import FAULTS, QUICK, faults_named

#: Rows of the fault table that faults from outside show; the others are tests of the nodes.
ROWS = {
    'no fault', 'NaN or Inf in state, setpoint, time', 'zero or non-unit quaternion',
    'q and -q alternating', 'exact 180 degrees, with noise', 'wrong or empty frame_id',
    'stale, duplicate, out of order, future, zero, negative stamps', 'time jumps back',
    '/clock never comes', 'message loss, latency, jitter',
    'publisher dies, two publishers of the state or of the torque', 'QoS mismatch',
    'rate beyond the existence guard', 'saturation, a dead axis',
    'wrong-typed, NaN, contradictory or structural parameter at run time', 'YAML error',
    'controller killed or hung', 'SIGTERM, SIGINT', 'restart of either node', 'CPU starvation',
    'malformed bytes', 'malformed requests',
}


def test_names_are_unique_and_every_row_is_shown() -> None:
    assert max(Counter(fault.name for fault in FAULTS).values()) == 1
    assert {fault.row for fault in FAULTS} == ROWS
    assert len(FAULTS) >= 70


def test_the_quick_selection_shows_every_row() -> None:
    assert {fault.row for fault in faults_named(QUICK)} == ROWS


def test_a_name_that_does_not_exist_is_a_mistake() -> None:
    with pytest.raises(ConfigurationError, match='state-nan-attitude'):
        faults_named(['state-nan'])


def test_the_matrix_has_every_fault_in_every_phase_with_every_seed() -> None:
    trials = schedule.matrix(FAULTS, 4)
    assert Counter((t.fault.name, t.phase, t.seed) for t in trials) == Counter({
        (fault.name, phase, seed): 1
        for fault in FAULTS for phase in Phase for seed in range(4)})
    assert len(schedule.matrix(FAULTS, 5)) >= 1000


def test_a_soak_is_the_same_for_the_same_seed_and_ends_no_process() -> None:
    trials = schedule.soak(FAULTS, 3600.0, 30.0, 7)
    assert trials == schedule.soak(FAULTS, 3600.0, 30.0, 7)
    assert trials != schedule.soak(FAULTS, 3600.0, 30.0, 8)
    assert [t.at_s for t in trials] == [30.0 * k for k in range(120)]
    assert not any(schedule.ends_a_process(t.fault) for t in trials)
    assert len({t.fault.name for t in trials}) > 40


def test_drills_kill_each_node_by_turns() -> None:
    trials = schedule.drills(FAULTS, 6)
    assert Counter(t.fault.name for t in trials) == {
        'controller-killed': 6, 'simulator-killed': 6}
    assert {t.phase for t in trials} == set(Phase)
