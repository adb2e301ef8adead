# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The survival table: verdicts added up. Pure logic."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

import numpy as np

from manifold_mpc_ros.lab.fault_injection.evidence import TrialVerdict

#: The first minute of a process is start-up: caches fill, modules load [s].
WARM_UP_S = 60.0
#: A slope over less than this says nothing [s].
SHORTEST_SLOPE_S = 240.0
_KIB = 1024.0


@dataclass(frozen=True)
class MemoryUse:
    """Resident memory of one node's process over its life."""

    node: str
    life_s: float
    begin_kib: float
    end_kib: float
    slope_kib_per_min: float | None


def memory_of(node: str, samples: Sequence[tuple[float, int]]) -> MemoryUse:
    """Return the straight line through (time [s], bytes) of a life after its warm-up."""
    times = np.array([time_s for time_s, _ in samples])
    kib = np.array([size for _, size in samples]) / _KIB
    warm = times >= times[0] + WARM_UP_S
    slope = None
    if warm.sum() > 2 and times[-1] - times[0] >= WARM_UP_S + SHORTEST_SLOPE_S:
        slope = 60.0 * float(np.polyfit(times[warm] - times[0], kib[warm], 1)[0])
    first = int(np.argmax(warm)) if warm.any() else 0
    return MemoryUse(node, float(times[-1] - times[0]), float(kib[first]), float(kib[-1]), slope)


def longest_lives(memories: Iterable[MemoryUse]) -> list[MemoryUse]:
    """Return the longest life of each node."""
    longest: dict[str, MemoryUse] = {}
    for memory in memories:
        if memory.node not in longest or memory.life_s > longest[memory.node].life_s:
            longest[memory.node] = memory
    return list(longest.values())


def totals(verdicts: Sequence[TrialVerdict]) -> dict[str, Any]:
    """Return the figures of all verdicts."""
    spoken = [v for v in verdicts if not v.silent]
    return {
        'faults_injected': len(verdicts),
        'faults_survived': sum(v.survived for v in verdicts),
        'excused_by_the_machine': sum(bool(v.excused) for v in verdicts),
        'detection_s': spread(v.detection_s for v in verdicts),
        'recovery_s': spread(v.recovery_s for v in verdicts),
        'longest_gap_s': max((v.longest_gap_s for v in spoken), default=None),
        'largest_burst': max((v.burst for v in verdicts), default=0),
        'commands': sum(v.commands for v in verdicts),
        'missed_ticks': sum(v.missed_ticks or 0 for v in verdicts),
        'non_finite_commands': sum(v.non_finite for v in verdicts),
        'over_limit_commands': sum(v.over_limit for v in verdicts),
        'commands_beyond_one_per_tick': sum(abs(v.tick_drift) for v in verdicts),
        'unhandled_exceptions': sum(v.exceptions for v in verdicts),
        'observer_late_s': spread(v.late_s for v in verdicts),
        'nodes_waited_for_a_processor_s': spread(v.starved_s for v in verdicts),
    }


def grouped(verdicts: Iterable[TrialVerdict], key: Callable[[TrialVerdict], str]
            ) -> dict[str, dict[str, Any]]:
    """Return the figures of each group, in the order of first appearance."""
    groups: dict[str, list[TrialVerdict]] = {}
    for verdict in verdicts:
        groups.setdefault(key(verdict), []).append(verdict)
    return {name: {
        'injected': len(group),
        'survived': sum(v.survived for v in group),
        'detection_s': spread(v.detection_s for v in group),
        'recovery_s': spread(v.recovery_s for v in group),
        'longest_gap_s': max(v.longest_gap_s for v in group),
    } for name, group in groups.items()}


def spread(values: Iterable[float | None]) -> dict[str, float] | None:
    """Return median and largest of the values that there are, None without any."""
    known = [value for value in values if value is not None]
    return {'median': median(known), 'max': max(known)} if known else None


def not_survived(verdicts: Iterable[TrialVerdict]) -> list[dict[str, Any]]:
    """Return everything about those that were not survived."""
    return [asdict(verdict) for verdict in verdicts if not verdict.survived]


def excused(verdicts: Iterable[TrialVerdict]) -> list[dict[str, Any]]:
    """Return everything about those in which the machine was late, and only that explains it."""
    return [asdict(verdict) for verdict in verdicts if verdict.survived and verdict.excused]
