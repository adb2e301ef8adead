# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One replay from the controller's process to its last torque."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from manifold_mpc_ros.cli.processes import NodeProcesses, node_environment, reserved_domain
from manifold_mpc_ros.config.tables import CONTROLLER_NAME
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.recording.replay_plan import ReplayPlan

if TYPE_CHECKING:
    from rich.console import Console

    from manifold_mpc_ros.lab.recording.nodes.replay_node import Replayer
    from manifold_mpc_ros.lie.arrays import Array

#: A state that the controller does not answer for so long is never answered [s of wall clock].
STANDSTILL_S = 60.0
_EXECUTABLE = 'controller'


@dataclass(frozen=True, eq=False)
class ReplayResult:
    """What the live controller did: the backend of its solver, torques by stamp [ns]."""

    backend: str
    torques: Mapping[int, Array]


def replay(plan: ReplayPlan, console: Console, start_limit_s: float) -> ReplayResult:
    """Start a controller on a domain of its own, give it the feed, and end it.

    Raises ManifoldMpcError when the controller ends, refuses its configuration, or does not
    answer.
    """
    from manifold_mpc_ros.cli.progress import Progress
    from manifold_mpc_ros.lab.recording.nodes.replay_node import Replayer
    with ExitStack() as stack:
        folder = Path(stack.enter_context(
            tempfile.TemporaryDirectory(prefix='manifold-mpc-replay-')))
        domain = stack.enter_context(reserved_domain())
        replayer = stack.enter_context(Replayer(domain, plan.feed))
        processes = stack.enter_context(NodeProcesses())
        shown = stack.enter_context(
            Progress(console, 's replayed', plan.duration_s, 'starting the controller'))
        processes.start(_EXECUTABLE, plan.arguments(folder), node_environment(domain),
                        folder / f'{_EXECUTABLE}.log')
        patience = _Patience(processes, start_limit_s)
        _start(replayer, processes, patience)
        patience.renew(STANDSTILL_S)

        def progress(time_s: float) -> None:
            patience.renew(STANDSTILL_S)
            shown.show(min(time_s, plan.duration_s))

        if plan.rate is None:
            replayer.in_lockstep(progress, patience)
        else:
            replayer.at_pace(plan.rate, plan.first_tick_ns, plan.step_s, progress, patience)
        return ReplayResult(replayer.controller.get('backend', ''), replayer.torques)


def _start(replayer: Replayer, processes: NodeProcesses, watch: Callable[[], None]) -> None:
    """Bring the controller to where it answers states."""
    replayer.meet(CONTROLLER_NAME, watch)
    for change in (replayer.configure, replayer.activate):
        if not change(CONTROLLER_NAME, watch):
            raise ManifoldMpcError(f'the controller refused: {processes.nodes[0].last_words()}')
    replayer.meet_controller(watch)


class _Patience:
    """Raises when a process has ended, or nothing has happened for too long."""

    def __init__(self, processes: NodeProcesses, limit_s: float) -> None:
        """Begin to wait."""
        self._processes = processes
        self.renew(limit_s)

    def renew(self, limit_s: float) -> None:
        """Wait so long from now on [s]."""
        self._limit_s, self._until_s = limit_s, time.monotonic() + limit_s

    def __call__(self) -> None:
        """Look."""
        node = self._processes.ended()
        if node is not None:
            raise ManifoldMpcError(
                f'the {node.name} ended by itself with exit status {node.exit_status}: '
                f'{node.last_words()}')
        if time.monotonic() > self._until_s:
            raise ManifoldMpcError(
                f'the controller gave no answer within {self._limit_s:g} s; it said: '
                f'{self._processes.nodes[0].last_words()}')
