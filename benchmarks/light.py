# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measure how light the package is: start-up, and the size of what an installation brings.

    python benchmarks/light.py [--runs 15] [--output docs/results/light.json]

Run it with the interpreter of an environment that has the package with all extras (`make setup`).
Times are of whole processes, beside the interpreter alone; the ROS wheels start it twice. The
size of a set is that of all files of its distributions, as installed, each once. ``before`` is
what `pip install .` brought when the laboratory's packages were required by everyone.
"""

from __future__ import annotations

import argparse
import importlib.metadata as metadata
import json
import os
import re
import resource
import statistics
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

from packaging.requirements import Requirement

from manifold_mpc_ros.cli import provenance

PACKAGE = 'manifold_mpc_ros'
RESULT = Path(__file__).parents[1] / 'docs' / 'results' / 'light.json'
COMMAND = Path(sysconfig.get_path('scripts'), 'manifold-mpc')
PROGRAMS = {
    'python -c pass': [sys.executable, '-c', 'pass'],
    f'import {PACKAGE}': [sys.executable, '-c', f'import {PACKAGE}'],
    'manifold-mpc --help': [str(COMMAND), '--help'],
    'manifold-mpc check --help': [str(COMMAND), 'check', '--help'],
}
SETS = {'flies': PACKAGE, 'flies, with ROS 2 as wheels': f'{PACKAGE}[ros]',
        'flies and laboratory (before)': f'{PACKAGE}[lab]'}


def distributions(requirement: str, found: dict[str, set[str]] | None = None) -> set[str]:
    """Return the installed distributions that a requirement brings, itself included."""
    found = {} if found is None else found
    wanted = Requirement(requirement)
    name = re.sub(r'[-_.]+', '-', wanted.name).lower()
    if name in found and wanted.extras <= found[name]:
        return set(found)
    found[name] = found.get(name, set()) | wanted.extras
    for line in metadata.requires(name) or []:
        needed = Requirement(line)
        if needed.marker is None or any(
                needed.marker.evaluate({'extra': extra}) for extra in ('', *wanted.extras)):
            distributions(line, found)
    return set(found)


def bytes_of(names: set[str]) -> int:
    """Return the size of all files of some distributions."""
    paths = {Path(str(file.locate())).resolve()
             for name in names for file in metadata.files(name) or []}
    return sum(path.stat().st_size for path in paths if path.is_file())


def seconds_of(runs: int) -> dict[str, dict[str, float]]:
    """Return the least and the median time of each program; they take turns.

    Wall time, and processor time (user and system), which a busy machine changes less.
    """
    took: dict[str, list[tuple[float, float]]] = {name: [] for name in PROGRAMS}
    environment = {name: value for name, value in os.environ.items()
                   if name not in ('_ROS_WHEELS_BOOTSTRAP_COMPLETE', 'LD_LIBRARY_PATH')}
    for _ in range(runs + 1):
        for name, command in PROGRAMS.items():
            begin, used = time.perf_counter(), processor_s()
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment)
            took[name].append((time.perf_counter() - begin, processor_s() - used))
    found = {}
    for name, times in took.items():
        wall, processor = zip(*times[1:])  # the first one fills the disk's cache
        found[name] = {key: round(value, 3) for key, value in (
            ('least_s', min(wall)), ('median_s', statistics.median(wall)),
            ('least_processor_s', min(processor)),
            ('median_processor_s', statistics.median(processor)))}
    return found


def processor_s() -> float:
    """Return the processor time of all children that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--runs', type=int, default=15, help='of each program (%(default)s)')
    parser.add_argument('--output', type=Path, default=RESULT, help='(%(default)s)')
    arguments = parser.parse_args()
    sets = {name: distributions(requirement) for name, requirement in SETS.items()}
    data = {
        'processor': provenance.processor(), 'python': provenance.versions('')['python'],
        'load_average': round(os.getloadavg()[0], 2),
        'seconds': seconds_of(arguments.runs),
        'installed': {name: {'megabytes': round(bytes_of(names) / 1e6, 1),
                             'distributions': len(names)} for name, names in sets.items()},
        'packages': {name: round(bytes_of({name}) / 1e6, 1) for name in sorted(
            sets['flies and laboratory (before)'])},
    }
    arguments.output.write_text(json.dumps(data, indent=1) + '\n', encoding='utf-8')
    print(json.dumps(data, indent=1))


if __name__ == '__main__':
    main()
