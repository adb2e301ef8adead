# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What was seen of one injected fault from outside, and what is said of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from manifold_mpc_ros.lab.fault_injection.fault import Fault, Phase


@dataclass(frozen=True)
class Command:
    """A torque command as it left the controller, at the time that its publisher gave it [s]."""

    time_s: float
    torque_B_n_m: tuple[float, ...]


@dataclass(frozen=True)
class Report:
    """What a node said on /diagnostics."""

    time_s: float
    node: str
    values: Mapping[str, str]

    @property
    def mode(self) -> str:
        """The mode, '' without one."""
        return self.values.get('mode', '')


@dataclass
class Evidence:
    """Everything seen from the beginning of a fault until the recovery, or its bound.

    ``troubles`` and ``delays`` were seen while it was injected; a slow machine explains the
    latter. Commands are all since the end of the last fault. Times are of one clock that never
    goes back [s]. The machine was late by ``late_s`` in the observing process, and had a thread
    of a node wait for a processor for ``starved_s`` in all.
    """

    fault: Fault
    phase: Phase
    seed: int
    begun_s: float
    before: dict[str, Mapping[str, str]]
    ended_s: float = math.nan
    recovered_s: float | None = None
    closed_s: float = math.nan
    commands: list[Command] = field(default_factory=list)
    reports: list[Report] = field(default_factory=list)
    troubles: list[str] = field(default_factory=list)
    delays: list[str] = field(default_factory=list)
    exceptions: int = 0
    tick_drift: int = 0
    late_s: float = 0.0
    starved_s: float = 0.0


@dataclass(frozen=True)
class Limits:
    """What is demanded whatever the fault: the limits of the torque, the time between commands.

    Where everybody follows simulated time, as many steps of it as ``made_up_steps`` may come at
    once after the machine was late, each with its tick.
    """

    max_torque_n_m: tuple[float, ...]
    step_s: float
    longest_gap_s: float
    made_up_steps: int = 0


@dataclass(frozen=True)
class TrialVerdict:
    """One injected fault, judged."""

    fault: str
    row: str
    phase: str
    seed: int
    reasons: tuple[str, ...]
    excused: tuple[str, ...]
    void: bool
    detection_s: float | None
    recovery_s: float | None
    longest_gap_s: float
    burst: int
    missed_ticks: int | None
    silent: bool
    commands: int
    non_finite: int
    over_limit: int
    tick_drift: int
    exceptions: int
    late_s: float
    starved_s: float
    modes: tuple[str, ...]

    @property
    def survived(self) -> bool:
        """Whether nothing is held against the nodes."""
        return not self.reasons
