# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cases in chunks, the unit of work, and the processes of this machine that share them.

Whoever runs a chunk builds one controller for all of them (one for each case that draws cones)
and starts every case cold, so what comes out does not depend on who ran what, nor in which order.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.campaign.case import CaseName, draw_case
from manifold_mpc_ros.lab.campaign.loop import PlanningController
from manifold_mpc_ros.lab.campaign.outcome import Outcome, outcome_of
from manifold_mpc_ros.lab.campaign.plan import CampaignPlan
from manifold_mpc_ros.lab.workers import WorkerDiedError, Workers
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

MakeController: TypeAlias = Callable[[AttitudeMpcConfig, str], PlanningController]
Chunks: TypeAlias = Generator[list[Outcome], None, None]

# Cases of a chunk, a fraction of a second. An interrupt waits for the chunks that are being run
# and for the few that are already on their way to a worker.
CHUNK = 8
# Pools that may end one after the other, each by the death of a worker, without one chunk done.
MOST_FRUITLESS = 2
# Threads of a Dask worker share a process, which builds one controller at a time.
_BUILDING = threading.Lock()


class CampaignError(ManifoldMpcError):
    """A campaign could not be run; the message names the case, the folder or the cluster."""


def build_controller(config: AttitudeMpcConfig, backend: str) -> PlanningController:
    """Build the controller that a campaign is about."""
    return AttitudeMpc(config, backend=backend)


@dataclass(frozen=True)
class Work:
    """What whoever runs a chunk needs: the plan, and how to build its controller."""

    plan: CampaignPlan
    make_controller: MakeController

    def build(self, cones: tuple[Cone, ...] | None = None) -> PlanningController:
        """Build the controller, or one with the cones that a case drew."""
        config = self.plan.config
        with _BUILDING:
            return self.make_controller(
                config if cones is None else replace(config, cones=cones),
                self.plan.node.backend)


class ChunkRunner:
    """One controller, built at the first case, and the chunks that it runs."""

    def __init__(self, work: Work) -> None:
        """Keep what is needed for building it."""
        self.work = work
        self._controller: PlanningController | None = None

    def build(self) -> PlanningController:
        """Return the controller, built when it is not there yet."""
        if self._controller is None:
            self._controller = self.work.build()
        return self._controller

    def run(self, names: Sequence[CaseName]) -> list[Outcome]:
        """Run some cases one after the other; raises CampaignError."""
        return [self._run_one(name) for name in names]

    def _run_one(self, name: CaseName) -> Outcome:
        """Run one case."""
        try:
            case = draw_case(self.work.plan, name)
            controller = (self.build() if case.drawn_from.cones is None
                          else self.work.build(case.cones))
            return outcome_of(controller, self.work.plan, name)
        except Exception as error:
            raise CampaignError(f'case {name}: {type(error).__name__}: {error}') from error


def in_chunks(names: Sequence[CaseName], size: int) -> list[Sequence[CaseName]]:
    """Return the names in chunks of a size, the last one perhaps smaller."""
    return [names[at:at + size] for at in range(0, len(names), size)]


def run_on_processes(work: Work, names: Sequence[CaseName], workers: int
                     ) -> Chunks:
    """Yield the outcomes of all cases, a chunk at a time, in whatever order they end.

    One worker is this process. A worker that dies is replaced, and what it was running is run
    again. Closing the iterator, or an interrupt, ends the pool after the chunks that are being
    run.

    Raises
    ------
    CampaignError
        When a case raises, naming it.
    WorkerDiedError
        When workers die and no chunk ends, twice in a row.

    """
    left = in_chunks(names, CHUNK if workers > 1 else 1)
    fruitless = 0
    while left:
        done: set[int] = set()
        try:
            with Workers(functools.partial(ChunkRunner, work), workers) as pool:
                for at, outcomes in pool.run(ChunkRunner.run, left):
                    done.add(at)
                    yield outcomes
        except WorkerDiedError:
            fruitless = 0 if done else fruitless + 1
            if fruitless == MOST_FRUITLESS:
                raise
        left = [chunk for at, chunk in enumerate(left) if at not in done]
