# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A campaign in parallel: cases in chunks over a pool of processes.

Each worker builds one controller and runs its chunks with it, every case from a cold start, so
what comes out does not depend on how many workers there are.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from manifold_mpc_ros.config import AttitudeMpcConfig
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.workers import Workers
from manifold_mpc_ros.sim.campaign import (
    CampaignSettings,
    CaseName,
    PlanningController,
    run_case,
)
from manifold_mpc_ros.sim.campaign_outcome import Outcome, judge

MakeController: TypeAlias = Callable[[AttitudeMpcConfig, str], PlanningController]

# Cases that a worker takes at a time, a fraction of a second. An interrupt waits for the chunks
# that are being run and for the few that are already on their way to a worker.
CHUNK = 4


class CampaignError(ManifoldMpcError):
    """A case could not be run; the message names it."""


def build_controller(config: AttitudeMpcConfig, backend: str) -> PlanningController:
    """Build the controller that a campaign is about."""
    return AttitudeMpc(config, backend=backend)


@dataclass(frozen=True, eq=False)
class Work:
    """What every worker needs: the model, the settings and how to build the controller."""

    config: AttitudeMpcConfig
    settings: CampaignSettings
    backend: str
    make_controller: MakeController


class _Worker:
    """A worker's own controller, built at its first case."""

    def __init__(self, work: Work) -> None:
        """Keep what is needed for building it."""
        self._work = work
        self._controller: PlanningController | None = None

    def run(self, names: Sequence[CaseName]) -> list[Outcome]:
        """Run some cases one after the other; raises CampaignError."""
        return [self._run_one(name) for name in names]

    def _run_one(self, name: CaseName) -> Outcome:
        """Run one case."""
        work = self._work
        try:
            if self._controller is None:
                self._controller = work.make_controller(work.config, work.backend)
            course = run_case(self._controller, work.config, work.settings, name)
            return judge(course, work.config, work.settings)
        except Exception as error:
            raise CampaignError(f'case {name}: {type(error).__name__}: {error}') from error


def run_cases(work: Work, names: Sequence[CaseName], workers: int) -> Iterator[list[Outcome]]:
    """Yield the outcomes of all cases, a chunk at a time, in whatever order they end.

    One worker is this process. Closing the iterator, or an interrupt, ends the pool after the
    chunks that are being run.

    Raises
    ------
    CampaignError
        When a case raises, naming it.
    ManifoldMpcError
        When a worker dies.

    """
    size = CHUNK if workers > 1 else 1
    chunks = [names[at:at + size] for at in range(0, len(names), size)]
    with Workers(functools.partial(_Worker, work), workers) as pool:
        for _, outcomes in pool.run(_Worker.run, chunks):
            yield outcomes
