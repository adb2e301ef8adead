# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Instructions per solve by valgrind's callgrind: the same on a noisy machine as on a quiet one.

Only what is executed inside shared libraries of the solver counts, not the Python around it:
callgrind says for each instruction which object it belongs to. Code without a symbol it gives to
the caller's object; that is libffi where Python calls C, which therefore counts. valgrind knows no
AVX-512, so on an x86 processor the solver is compiled without it, whatever the processor has.
"""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.benchmark.peers.driver import Task
from manifold_mpc_ros.lab.benchmark.peers.solver import ENTRIES, Entry

_PATIENCE_S = 1800.0
#: Objects that are Python and its helpers, not a solver.
_INTERPRETER = re.compile(
    r'libpython|cpython|openblas|_casadi\.so|^libc\.so|^ld-linux|^\?\?\?|vgpreload|libstdc|libgcc')


def count(entry: Entry, horizon: int, cold: int, warm_steps: int) -> dict[str, Any]:
    """Return instructions per solve and per object, of cold solves with warm steps after each.

    Raises ManifoldMpcError when valgrind is missing or the process fails under it.
    """
    if shutil.which('valgrind') is None:
        raise ManifoldMpcError('instruction counts need valgrind, which is not installed')
    task = Task(ENTRIES.index(entry), horizon, cold, warm_steps, counted=True)
    with tempfile.TemporaryDirectory(prefix='callgrind_') as folder:
        profile = Path(folder, 'out')
        command = ['valgrind', '--tool=callgrind', '--instr-atstart=no',
                   f'--callgrind-out-file={profile}', *task.command]
        try:
            done = subprocess.run(command, text=True, capture_output=True, check=False,
                                  timeout=_PATIENCE_S, cwd=folder, env=_environment())
        except subprocess.TimeoutExpired:
            raise ManifoldMpcError(f'{entry.name}: valgrind took more than {_PATIENCE_S:.0f} s'
                                   ) from None
        if done.returncode != 0:
            words = done.stderr.strip().splitlines() or ['no message']
            raise ManifoldMpcError(f'{entry.name} under valgrind: {words[-1][:200]}')
        report = json.loads(done.stdout.strip().splitlines()[-1])
        with profile.open(encoding='utf-8') as lines:
            objects = by_object(lines)
    solves = report['solves']
    kept = {Path(name).name: round(cost / solves) for name, cost in objects.items()
            if not _INTERPRETER.search(Path(name).name)}
    return {'solver': entry.name, 'horizon': horizon, 'solves': solves, 'cold': cold,
            'warm_steps': warm_steps, 'instructions_per_solve': sum(kept.values()),
            'by_library': dict(sorted(kept.items(), key=lambda item: -item[1]))}


def _environment() -> dict[str, str]:
    """Return the environment in which a solver is compiled for valgrind."""
    given = dict(os.environ)
    if platform.machine() in ('x86_64', 'AMD64'):
        given['CC'] = f'{given.get("CC", "cc")} -mno-avx512f'
    return given


def by_object(lines: Iterable[str]) -> dict[str, int]:
    """Return the self cost of each object file of a callgrind profile.

    The format: ``ob=(id) name`` names the object of the costs that follow, the name only the
    first time; the line after ``calls=`` is the cost of a callee and belongs elsewhere.
    """
    names: dict[str, str] = {}
    costs: dict[str, int] = {}
    current, callee = '???', False
    for line in lines:
        if match := re.match(r'c?ob=\((\d+)\)(?: (.*))?$', line):
            if match[2] is not None:
                names[match[1]] = match[2]
            if not line.startswith('c'):
                current = names[match[1]]
        elif line.startswith('calls='):
            callee = True
        elif line[:1] in '+-*0123456789' and line.strip():
            if not callee:
                costs[current] = costs.get(current, 0) + int(line.split()[1])
            callee = False
    return costs
