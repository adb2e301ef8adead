# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One run: every solver on every instance, interleaved instance by instance on one core."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.benchmark.peers import problem
from manifold_mpc_ros.lab.benchmark.peers.instances import Instance
from manifold_mpc_ros.lab.benchmark.peers.solver import REFERENCES, Answer, Entry
from manifold_mpc_ros.lab.benchmark.peers.worker import Worker, fastest
from manifold_mpc_ros.lie.arrays import Array


@dataclass(frozen=True)
class Settings:
    """How much is run: what a solver does not finish within its budget it is not asked again."""

    core: int
    repeats: int = 5
    loops: int = 10
    loop_steps: int = 20
    cold_budget_s: float = 6.0
    warm_budget_s: float = 5.0
    reference_budget_s: float = 15.0


@dataclass
class Record:
    """What one solver did at one horizon; row i of cold belongs to instance ``asked[i]``."""

    entry: Entry
    build_s: float = np.nan
    version: str = ''
    undisturbed: bool = False
    why_not: str = ''
    peak_memory_bytes: int = 0
    asked: list[int] = field(default_factory=list)
    cold: list[Answer] = field(default_factory=list)
    cold_s: list[tuple[float, float]] = field(default_factory=list)
    group_cost: list[float] = field(default_factory=list)
    warm: list[Answer] = field(default_factory=list)
    warm_s: list[tuple[float, float]] = field(default_factory=list)


@dataclass
class Comparison:
    """All records of one horizon, and the least cost known of each instance (inf: none)."""

    horizon: int
    records: list[Record]
    best: dict[str, Array]


Progress = Callable[[str], None]


def compare(horizon: int, entries: Sequence[Entry], instances: Sequence[Instance],
            settings: Settings, progress: Progress) -> Comparison:
    """Build all solvers, run them side by side, and end them."""
    wanted = [entry for entry in entries if horizon <= entry.largest_horizon]
    records = [Record(entry) for entry in wanted]
    workers: dict[int, Worker] = {}
    progress(f'N = {horizon}: building {len(wanted)} solvers')
    started = [Worker(entry, horizon, settings.core) for entry in wanted]
    references = {form: Worker(entry, horizon, settings.core)
                  for form, entry in REFERENCES.items()}
    try:
        for index, worker in enumerate(started):
            _await(worker, records[index], workers, index)
        _run_cold(workers, records, instances, settings, progress, horizon)
        _run_warm(workers, records, instances, settings, progress, horizon)
        progress(f'N = {horizon}: looking for better optima with IPOPT')
        best = _best_known(references, records, instances, settings)
        for index, worker in workers.items():
            records[index].peak_memory_bytes = worker.peak_memory_bytes()
    finally:
        for worker in (*started, *references.values()):
            worker.end()
    _judge_on_the_group(horizon, records, instances)
    return Comparison(horizon, records, best)


def _await(worker: Worker, record: Record, workers: dict[int, Worker], index: int) -> None:
    """Wait until a solver is built, or note why it is not."""
    try:
        ready = worker.wait()
    except ManifoldMpcError as error:
        record.why_not = str(error)
        return
    record.build_s, record.version = ready.build_s, ready.version
    record.undisturbed = ready.undisturbed
    workers[index] = worker


def _order(instances: Sequence[Instance]) -> list[int]:
    """Return the order of the instances: the few special ones come before any budget ends."""
    return sorted(range(len(instances)), key=lambda i: instances[i].kind == 'random')


def _run_cold(workers: dict[int, Worker], records: list[Record], instances: Sequence[Instance],
              settings: Settings, progress: Progress, horizon: int) -> None:
    """Ask every solver every instance before the next instance comes."""
    left_s = {index: settings.cold_budget_s for index in workers if records[index].entry.cold}
    for count, i in enumerate(_order(instances)):
        progress(f'N = {horizon}: cold, instance {count + 1} of {len(instances)}')
        for index in [index for index, left in left_s.items() if left > 0]:
            begin, record = time.perf_counter(), records[index]
            try:
                answers = workers[index].cold(instances[i].state, settings.repeats)
            except ManifoldMpcError as error:
                record.why_not = str(error)
                del left_s[index]
                continue
            record.asked.append(i)
            record.cold.append(answers[-1])
            record.cold_s.append(fastest(answers))
            left_s[index] -= time.perf_counter() - begin


def _run_warm(workers: dict[int, Worker], records: list[Record], instances: Sequence[Instance],
              settings: Settings, progress: Progress, horizon: int) -> None:
    """Close the loops over the first random instances, each as often as there are repeats."""
    left_s = {index: settings.warm_budget_s for index in workers if records[index].entry.warm}
    starts = [each for each in instances if each.kind == 'random'][:settings.loops]
    for count, instance in enumerate(starts):
        progress(f'N = {horizon}: warm, loop {count + 1} of {len(starts)}')
        for index in [index for index, left in left_s.items() if left > 0]:
            begin, record = time.perf_counter(), records[index]
            runs: list[list[Answer]] = []
            try:
                while len(runs) < settings.repeats and left_s[index] > 0:
                    runs.append(workers[index].loop(instance.state, settings.loop_steps))
                    left_s[index] -= time.perf_counter() - begin
                    begin = time.perf_counter()
            except ManifoldMpcError as error:
                record.why_not = str(error)
                del left_s[index]
                continue
            record.warm += runs[-1]
            record.warm_s += [fastest(step) for step in zip(*runs)]


def _best_known(references: dict[str, Worker], records: list[Record],
                instances: Sequence[Instance], settings: Settings) -> dict[str, Array]:
    """Return the least cost of each instance in each formulation.

    Over all solvers, and over IPOPT started from our plan in either formulation.
    """
    best = {form: np.full(len(instances), np.inf) for form in references}
    for record in records:
        for i, answer in zip(record.asked, record.cold):
            if answer.converged:
                form = record.entry.formulation
                best[form][i] = min(best[form][i], answer.cost)
    ours = _our_best_plans(records)
    for form, worker in references.items():
        try:
            worker.wait()
            _improve(worker, best[form], ours, instances, settings.reference_budget_s)
        except ManifoldMpcError:
            continue
    return best


def _our_best_plans(records: list[Record]) -> dict[int, Answer]:
    """Return the cheapest of our plans for each instance, in the order they were asked."""
    plans: dict[int, Answer] = {}
    for record in records:
        for i, answer in zip(record.asked, record.cold):
            if record.entry.ours and (i not in plans or answer.cost < plans[i].cost):
                plans[i] = answer
    return plans


def _improve(worker: Worker, best: Array, plans: dict[int, Answer],
             instances: Sequence[Instance], budget_s: float) -> None:
    """Lower the least costs by IPOPT from plans, within a budget."""
    end = time.perf_counter() + budget_s
    for i, answer in plans.items():
        if time.perf_counter() > end:
            return
        best[i] = min(best[i], worker.improve(instances[i].state, answer.torques_n_m))


def _judge_on_the_group(horizon: int, records: list[Record], instances: Sequence[Instance]
                        ) -> None:
    """Work out what everybody's torques cost on our model."""
    config = problem.comparison_config(horizon)
    weight = problem.terminal_weight()
    for record in records:
        record.group_cost = [
            problem.cost_on_the_group(config, weight, instances[i].state, answer.torques_n_m)
            for i, answer in zip(record.asked, record.cold)]
