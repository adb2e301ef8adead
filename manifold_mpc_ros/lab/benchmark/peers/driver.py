# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A fresh process that builds one solver and uses it, for start-up times and instruction counts.

    python -m manifold_mpc_ros.lab.benchmark.peers.driver '{"entry": 1, "horizon": 20, ...}'

The argument is a `Task` as JSON, the answer one line of JSON at the end of the output.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Task:
    """Build entry number ``entry``, then solve so many instances cold, then a warm loop each.

    ``core``: pin to it, ahead of ordinary processes where allowed; anywhere when None.
    ``counted``: switch the counting of callgrind, under which this runs, on for the solves.
    """

    entry: int
    horizon: int
    cold: int
    warm_steps: int = 0
    core: int | None = None
    counted: bool = False

    @property
    def command(self) -> list[str]:
        """The command line of the process."""
        return [sys.executable, '-m', __spec__.name, json.dumps(asdict(self))]


def main(argument: str) -> None:
    """Do the task and print what it took."""
    task = Task(**json.loads(argument))
    from manifold_mpc_ros.lab.benchmark.peers import instances, memory, solver, worker
    if task.core is not None:
        worker.take_core(task.core)
    entry = solver.ENTRIES[task.entry]
    entry.load()
    imported = time.perf_counter()
    built = entry.build(task.horizon)
    ready = time.perf_counter()
    states = [each.state for each in instances.draw(max(1, task.cold))][:task.cold]
    if task.counted:
        built.cold(states[0])
        _count('on')
    answers = 0
    for state in states:
        plan = built.cold(state)
        answers += 1
        for _ in range(task.warm_steps):
            state = built.advance(state, plan.torques_n_m[0])
            plan = built.warm(state)
            answers += 1
    if task.counted:
        _count('off')
    report: dict[str, Any] = {
        'build_s': ready - imported, 'solves_s': time.perf_counter() - ready, 'solves': answers,
        'peak_memory_bytes': memory.peak_memory_bytes()}
    print(f'\n{json.dumps(report)}')


def _count(switch: str) -> None:
    """Switch callgrind's counting of this process."""
    subprocess.run(['callgrind_control', f'--instr={switch}', str(os.getpid())], check=True,
                   stdout=subprocess.DEVNULL)


if __name__ == '__main__':
    main(sys.argv[1])
