# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Many faults on several pairs of nodes at a time."""

from __future__ import annotations

import queue
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.fault_injection.evidence import TrialVerdict
from manifold_mpc_ros.lab.fault_injection.rig import Bench, BenchPlan, Interrupted
from manifold_mpc_ros.lab.fault_injection.schedule import Trial
from manifold_mpc_ros.lab.fault_injection.summary import MemoryUse, memory_of
from manifold_mpc_ros.lab.fault_injection.trial import Trials

#: Told of every verdict, with what is being done now.
Show = Callable[[list[TrialVerdict]], None]
#: A trial in which the machine took too much time away is repeated, this often in all.
MOST_ATTEMPTS = 5
#: Between two looks for verdicts [s].
_LOOK_S = 0.2


@dataclass
class Done:
    """What a run came to."""

    planned: int
    pairs: int
    verdicts: list[TrialVerdict] = field(default_factory=list)
    memory: list[MemoryUse] = field(default_factory=list)
    voided: list[TrialVerdict] = field(default_factory=list)
    start_s: list[float] = field(default_factory=list)
    rates_hz: list[float] = field(default_factory=list)
    elapsed_s: float = 0.0
    failure: str = ''
    middleware: str = ''


class _Pair(threading.Thread):
    """Takes trials from a common list and runs them on a bench of its own."""

    def __init__(
        self, number: int, plan: BenchPlan, trials: dict[bool, deque[Trial]], seed: int,
        results: queue.Queue[TrialVerdict], stopped: threading.Event,
    ) -> None:
        """Keep what is needed."""
        super().__init__(name=f'pair {number}', daemon=True)
        self._plan, self._trials, self._seed = plan, trials, seed + number
        self._results, self._stopped = results, stopped
        self.memory: list[MemoryUse] = []
        self.voided: list[TrialVerdict] = []
        self.start_s: list[float] = []
        self.rates_hz: list[float] = []
        self.left_behind: list[str] = []
        self.failure = self.middleware = ''

    def run(self) -> None:
        """Run what there is: first where time is the clock's, then where it is simulated."""
        try:
            for simulated_time, trials in self._trials.items():
                if trials:
                    self._run_on_bench(trials, simulated_time)
        except Interrupted:
            pass
        except ManifoldMpcError as error:
            self.failure = str(error)
        except BaseException as error:
            self.failure = f'{type(error).__name__}: {error}'
            raise
        finally:
            if self.failure:
                self._stopped.set()

    def _run_one(self, each: Trials, trial: Trial) -> None:
        """Run a trial, again while the machine lets it say nothing."""
        for attempt in range(1, MOST_ATTEMPTS + 1):
            verdict = each.run(trial.fault, trial.phase, trial.seed)
            if not verdict.void or attempt == MOST_ATTEMPTS:
                self._results.put(verdict)
                return
            self.voided.append(verdict)

    def _run_on_bench(self, trials: deque[Trial], simulated_time: bool) -> None:
        """Start a bench and run trials on it until none is left."""
        with tempfile.TemporaryDirectory(prefix='manifold-mpc-chaos-') as folder:
            bench = Bench(self._plan, Path(folder), simulated_time=simulated_time,
                          seed=self._seed, stopped=self._stopped)
            begun_s = time.monotonic()
            try:
                with bench:
                    self.middleware = bench.listener.middleware
                    each = Trials(bench, self._plan.check(), self._seed)
                    each.settle_in()
                    self.start_s.append(time.monotonic() - begun_s)
                    begun_s = time.monotonic()
                    while (trial := _taken(trials)) is not None:
                        each.rest(begun_s + trial.at_s)
                        self._run_one(each, trial)
            finally:
                self.left_behind += bench.left_behind
                self.rates_hz += [1.0 / step_s for step_s in bench.steps_s]
                for node, lives in bench.lives.items():
                    longest = max(lives, key=lambda life: len(life.memory), default=None)
                    if longest is not None and longest.memory:
                        self.memory.append(memory_of(node, longest.memory))


def run_trials(
    plan: BenchPlan, trials: list[Trial], pairs: int, seed: int, show: Show,
) -> Done:
    """Run all trials; Ctrl-C, or a pair that cannot go on, ends it with what there is."""
    by_time = {False: deque(t for t in trials if not t.fault.simulated_time),
               True: deque(t for t in trials if t.fault.simulated_time)}
    results: queue.Queue[TrialVerdict] = queue.Queue()
    stopped = threading.Event()
    done = Done(len(trials), min(pairs, len(trials)))
    threads = [_Pair(number, plan, by_time, seed, results, stopped)
               for number in range(done.pairs)]
    begun_s = time.monotonic()
    for thread in threads:
        thread.start()
    try:
        while any(thread.is_alive() for thread in threads):
            _collect(results, done, show, _LOOK_S)
    except KeyboardInterrupt:
        pass
    finally:
        stopped.set()
        for thread in threads:
            thread.join()
    _collect(results, done, show, 0.0)
    done.elapsed_s = time.monotonic() - begun_s
    done.failure = '; '.join(
        words for thread in threads for words in (thread.failure, *thread.left_behind) if words)
    done.middleware = threads[0].middleware
    for thread in threads:
        done.memory += thread.memory
        done.voided += thread.voided
        done.start_s += thread.start_s
        done.rates_hz += thread.rates_hz
    return done


def _taken(trials: deque[Trial]) -> Trial | None:
    """Return the next trial, None when there is none left."""
    try:
        return trials.popleft()
    except IndexError:
        return None


def _collect(results: queue.Queue[TrialVerdict], done: Done, show: Show, wait_s: float) -> None:
    """Take in the verdicts that there are."""
    try:
        done.verdicts.append(results.get(timeout=wait_s) if wait_s else results.get_nowait())
        while True:
            done.verdicts.append(results.get_nowait())
    except queue.Empty:
        pass
    show(done.verdicts)
