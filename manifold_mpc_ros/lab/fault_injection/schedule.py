# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which faults are injected, in which phase, with which seed, and when. Pure logic."""

from __future__ import annotations

import random
import signal
from collections.abc import Sequence
from dataclasses import dataclass

from manifold_mpc_ros.lab.fault_injection.fault import BadStart, Fault, Phase, Signal

PHASES = tuple(Phase)
#: Faults after which each drill has the node started again.
DRILLS = ('controller-killed', 'simulator-killed')


@dataclass(frozen=True)
class Trial:
    """One fault to inject; ``at_s`` since the beginning of a soak, 0 means as soon as possible."""

    fault: Fault
    phase: Phase
    seed: int
    at_s: float = 0.0


def matrix(faults: Sequence[Fault], seeds: int) -> list[Trial]:
    """Return every fault in every phase with every seed.

    One after another the phases take turns, so that a manoeuvre has a fault in each of them.
    """
    return [Trial(fault, PHASES[(index + turn) % len(PHASES)], seed)
            for seed in range(seeds) for turn in range(len(PHASES))
            for index, fault in enumerate(faults)]


def one_phase_each(faults: Sequence[Fault], seed: int) -> list[Trial]:
    """Return every fault once, the phases taking turns."""
    return [Trial(fault, PHASES[index % len(PHASES)], seed)
            for index, fault in enumerate(faults)]


def soak(faults: Sequence[Fault], duration_s: float, every_s: float, seed: int) -> list[Trial]:
    """Return a fault and a phase drawn for every period of a soak.

    Only faults that end no process are drawn: both nodes live through the whole of it.
    """
    draws = random.Random(seed)
    lasting = [fault for fault in faults if not ends_a_process(fault)]
    times = int(duration_s / every_s)
    return [Trial(draws.choice(lasting), draws.choice(PHASES), draws.randrange(2**31),
                  index * every_s) for index in range(times)]


def drills(faults: Sequence[Fault], times: int) -> list[Trial]:
    """Return kills of each node by turns, ``times`` of each."""
    killed = [fault for fault in faults if fault.name in DRILLS]
    return [Trial(fault, PHASES[(index + turn) % len(PHASES)], turn)
            for turn in range(times) for index, fault in enumerate(killed)]


def ends_a_process(fault: Fault) -> bool:
    """Whether a fault ends a process that has to be started again."""
    action = fault.action
    return isinstance(action, BadStart) or (
        isinstance(action, Signal) and action.number != signal.SIGSTOP)
