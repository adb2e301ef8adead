# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Count and time warm solves about a target that moves, beside those about a fixed one.

    python benchmarks/moving_cost.py --output docs/results/moving_cost.json

The body of config/controller.yaml follows its model from 5 degrees off for 60 ticks. Only the
generated solver's library counts (valgrind's callgrind). `solve` is per warm solve, `pass` per
pass of the local solver. `call_us` and `solver_us` are times of `AttitudeMpc.solve` and of the
solver in it: the least of 20 flights at each tick, then the median.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.lab.benchmark.instructions import by_object
from manifold_mpc_ros.lab.closed_loop import ModelPlant
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.reference import Reference
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution

TOP = Path(__file__).resolve().parent.parent
TICKS, RATE = 60, np.deg2rad([0.6, -0.48, 0.64])
KINDS, FLIGHTS = ('fixed', 'fixed_moving_solver', 'moving'), 20


def controller(kind: str) -> AttitudeMpc:
    """Return the controller of a kind of target."""
    config = ControllerConfig.from_yaml(TOP / 'config' / 'controller.yaml').mpc
    return AttitudeMpc(config, moving=kind != 'fixed')


def solves(mpc: AttitudeMpc, kind: str) -> Iterator[tuple[float, AttitudeMpcSolution]]:
    """Yield the time of the call [s] and the solution of each tick of a flight."""
    config = mpc.config
    body = ModelPlant(config, so3.exp([0.05, -0.05, 0.05]),
                      RATE if kind == 'moving' else np.zeros(3))
    nodes = config.step_s * np.arange(config.horizon + 1)[:, None]
    mpc.reset()
    for tick in range(TICKS):
        reference = None if kind != 'moving' else Reference(
            so3.exp((tick * config.step_s + nodes) * RATE),
            np.tile(RATE, (config.horizon + 1, 1)))
        state, begin_s = body.measure(), time.perf_counter()
        solution = mpc.solve(*state, reference=reference)
        yield time.perf_counter() - begin_s, solution
        assert solution.searched == (tick == 0)
        body.step(solution.torque_B_n_m)


def fly(kind: str) -> None:
    """Solve; print the passes of the warm solves, which alone are counted."""
    passes = 0
    for _, solution in solves(controller(kind), kind):
        passes += 0 if solution.searched else solution.iterations
        if solution.searched:
            subprocess.run(['callgrind_control', '--instr=on', str(os.getpid())], check=True,
                           stdout=subprocess.DEVNULL)
    print(passes)


def timed() -> dict[str, dict[str, float]]:
    """Return the times of warm calls and of the solver in them [us], by kind of target."""
    controllers = {kind: controller(kind) for kind in KINDS}
    flights: dict[str, list[Any]] = {kind: [] for kind in KINDS}
    for _ in range(FLIGHTS):
        for kind, mpc in controllers.items():
            flights[kind].append([(call_s, solution.local_time_s)
                                  for call_s, solution in solves(mpc, kind)])
    return {kind: dict(zip(('call_us', 'solver_us'), np.round(
        1e6 * np.median(np.min(found, axis=0)[1:], axis=0), 2).tolist()))
            for kind, found in flights.items()}


def counted(kind: str) -> dict[str, Any]:
    """Return the instructions of a kind of target."""
    environment = dict(os.environ)
    if platform.machine() in ('x86_64', 'AMD64'):  # valgrind knows no AVX-512
        environment['CC'] = f'{environment.get("CC", "cc")} -mno-avx512f'
    with tempfile.TemporaryDirectory(prefix='callgrind_') as folder:
        profile = Path(folder, 'out')
        done = subprocess.run(
            ['valgrind', '--tool=callgrind', '--instr-atstart=no',
             f'--callgrind-out-file={profile}', sys.executable, __file__, '--child', kind],
            text=True, capture_output=True, check=True, env=environment)
        with profile.open(encoding='utf-8') as lines:
            objects = by_object(lines)
    solver = sum(cost for name, cost in objects.items() if 'manifold_mpc' in name
                 or 'solver' in Path(name).name)
    passes = int(done.stdout.split()[-1])
    return {'passes_per_solve': passes / (TICKS - 1),
            'instructions_per_solve': round(solver / (TICKS - 1)),
            'instructions_per_pass': round(solver / passes), 'objects': {
                Path(name).name: cost for name, cost in sorted(
                    objects.items(), key=lambda item: -item[1])[:6]}}


def main() -> None:
    """Count and write the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--output', type=Path)
    parser.add_argument('--child', choices=KINDS)
    arguments = parser.parse_args()
    if arguments.child:
        fly(arguments.child)
        return
    times = timed()
    rows = {kind: {**counted(kind), **times[kind]} for kind in KINDS}
    ratios = {name: rows['moving'][key] / rows['fixed'][key] for name, key in (
        ('solve', 'instructions_per_solve'), ('pass', 'instructions_per_pass'),
        ('solver_us', 'solver_us'), ('call_us', 'call_us'))}
    text = json.dumps({**rows, 'moving_over_fixed': ratios}, indent=1) + '\n'
    print(text)
    if arguments.output:
        arguments.output.write_text(text, encoding='utf-8')


if __name__ == '__main__':
    main()
