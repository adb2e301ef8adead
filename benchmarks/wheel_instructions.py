# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Instructions of a warm solve in the compiled solver, with four wheels and in the torque box.

    python benchmarks/wheel_instructions.py [--output docs/results/wheel_instructions.json]

By valgrind, the first steps of eight turns by 60 degrees of the 6U of benchmarks/wheels.py: near
enough that no solve searches again.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import wheels

from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lab.benchmark.instructions import by_object
from manifold_mpc_ros.lie import so3

RESULT = wheels.RESULT.with_name('wheel_instructions.json')
# Slews, and warm solves of each, whose instructions are counted.
_LOOPS, _WARM = 8, 40


def warm_loop(kind: str) -> None:
    """Solve the first steps of eight turns by 60 degrees; warm solves alone are counted."""
    mpc = wheels.controller(wheels.array() if kind == 'wheels' else None)
    rng = np.random.default_rng(16)
    passes = 0
    for _ in range(_LOOPS):
        R, momentum = wheels.random_slew(rng, 0.8)
        R = so3.exp(so3.log(R) / 3.0)
        omega, known = np.zeros(3), {'wheel_momentum_n_m_s': momentum} if kind == 'wheels' else {}
        total = R @ wheels.AXES_B.T @ momentum
        mpc.reset()
        for k in range(_WARM + 1):
            if k == 1:
                _count('on')
            plan = mpc.solve(R, omega, **known)
            passes += plan.iterations * (k > 0)
            R, omega = lgvi_step(R, omega, plan.torque_B_n_m, inertia_kg_m2=wheels.INERTIA,
                                 step_s=wheels.STEP_S)
            if known:
                known['wheel_momentum_n_m_s'] = wheels.array().inverse @ (
                    R.T @ total - wheels.INERTIA @ omega)
        _count('off')
    print(passes)


def _count(switch: str) -> None:
    """Switch callgrind's counting of this process."""
    subprocess.run(['callgrind_control', f'--instr={switch}', str(os.getpid())], check=True,
                   stdout=subprocess.DEVNULL)


def warm_instructions() -> dict[str, Any]:
    """Return instructions of the solver's library, and passes, per warm solve."""
    found: dict[str, Any] = {}
    for kind in ('box', 'wheels'):
        with tempfile.TemporaryDirectory() as folder:
            profile = Path(folder, 'out')
            done = subprocess.run(
                ['valgrind', '--tool=callgrind', '--instr-atstart=no',
                 f'--callgrind-out-file={profile}', sys.executable, __file__, '--loop', kind],
                check=True, text=True, stdout=subprocess.PIPE,
                env={**os.environ, 'CC': 'cc -mno-avx512f'})
            costs = by_object(profile.open(encoding='utf-8'))
        solver = sum(cost for name, cost in costs.items() if 'manifold' in name and '.so' in name)
        found[kind] = {'instructions': solver / (_LOOPS * _WARM),
                       'passes': int(done.stdout.split()[-1]) / (_LOOPS * _WARM)}
    found['ratio'] = found['wheels']['instructions'] / found['box']['instructions']
    return found


def main() -> None:
    """Count, write and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument('--loop', choices=('box', 'wheels'), help=argparse.SUPPRESS)
    parser.add_argument('--output', type=Path, default=RESULT)
    given = parser.parse_args()
    if given.loop:
        warm_loop(given.loop)
        return
    text = json.dumps(warm_instructions(), indent=2)
    given.output.write_text(text + '\n', encoding='utf-8')
    print(text)


if __name__ == '__main__':
    main()
