# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a fault is: something done to the closed loop, and what must then be seen from outside."""

from __future__ import annotations

import signal
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from manifold_mpc_ros.lab.fault_injection.disturbances import MakeDisturbance

CONTROLLER, SIMULATOR = 'controller', 'simulator'
STATE, TORQUE, SIMULATED_TIME = 'odometry', 'torque_command', 'clock'
#: What a topic is called behind the proxy.
BEHIND = '_link'


class Phase(str, Enum):
    """Where in a manoeuvre a fault begins."""

    ACCELERATION = 'acceleration'
    SLEW = 'slew'
    SETTLE = 'settle'


@dataclass(frozen=True)
class OnTopic:
    """Messages of a topic are disturbed on their way."""

    topic: str
    disturbance: MakeDisturbance


@dataclass(frozen=True)
class SecondPublisher:
    """Another participant publishes on a topic too: disturbed copies of what passes there."""

    topic: str
    disturbance: MakeDisturbance


@dataclass(frozen=True)
class PublisherGone:
    """The publisher of a topic is destroyed, and made again afterwards."""

    topic: str


@dataclass(frozen=True)
class MisfitSubscriber:
    """A subscriber asks a node's publisher for a quality of service that it does not offer."""

    topic: str


@dataclass(frozen=True)
class Datagrams:
    """Noise is sent to the UDP ports on which a node's DDS participant listens."""

    node: str


@dataclass(frozen=True)
class Signal:
    """A node's process is sent a signal; a supervisor starts again what has ended."""

    node: str
    number: signal.Signals
    exit_status: int | None = None


@dataclass(frozen=True)
class BadStart:
    """A node is killed and started with a parameter file that has a mistake in it."""

    node: str
    changes: Mapping[str, object]


@dataclass(frozen=True)
class Hogs:
    """Other processes take all the processor time that they can get."""

    processes: int


@dataclass(frozen=True)
class Requests:
    """Service requests of a kind are sent to a node, again and again."""

    node: str
    kind: str


Action = (OnTopic | SecondPublisher | PublisherGone | MisfitSubscriber | Datagrams | Signal
          | BadStart | Hogs | Requests)


@dataclass(frozen=True)
class Expectation:
    """What must be seen when a fault has been injected.

    Attributes
    ----------
    modes
        One of these modes of the controller has to be seen.
    counters
        One of these has to grow: ``node.key`` on /diagnostics, with shell wildcards.
    stays
        The controller has to remain in these modes; empty: in whichever.
    recovery_s
        Bound on the time from the end of the fault until the controller is in NOMINAL again.
    silent
        Commands may cease while the fault lasts: their source is dead, stopped, deactivated,
        without time or without the processor.
    reset
        It latches; an operator resets both nodes afterwards.
    surplus
        Commands beyond one per tick that belong to it: the zeros at a deactivation.

    """

    modes: frozenset[str] = frozenset()
    counters: tuple[str, ...] = ()
    stays: frozenset[str] = frozenset()
    recovery_s: float = 1.0
    silent: bool = False
    reset: bool = False
    surplus: int = 0

    @property
    def visible(self) -> bool:
        """Whether there is a sign that has to be seen."""
        return bool(self.modes or self.counters)


@dataclass(frozen=True)
class Fault:
    """One entry of the table.

    Attributes
    ----------
    name
        Short, unique.
    does
        What is done, as a sentence.
    row
        The row of the table in docs/safety.md that it shows.
    action
        How it is done.
    expected
        What must be seen.
    duration_s
        How long it lasts [s].
    simulated_time
        It needs nodes whose time comes from /clock.

    """

    name: str
    does: str
    row: str
    action: Action
    expected: Expectation = field(default_factory=Expectation)
    duration_s: float = 0.5
    simulated_time: bool = False
