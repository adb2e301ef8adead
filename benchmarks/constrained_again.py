# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of ``manifold-mpc bench --constrained`` again, in docs/results/constrained.json.

    python benchmarks/constrained_again.py fly B1 B1b 'B4, slew 1'
    python benchmarks/constrained_again.py time [B1] [B1b]

``fly``: the slews that are named, in 20 frames each; time-optimal bounds stay. ``time``: ours on
B1 and B1b, with cones and without; where a problem is named its other solvers too, as far as they
are installed. What was measured of all else stays.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

from manifold_mpc_ros.lab.benchmark.constrained import run, slews, timing

RESULT = Path(__file__).parents[1] / 'docs' / 'results' / 'constrained.json'


def fly(data: dict[str, Any], names: list[str]) -> None:
    """Fly the slews of these names."""
    every = {slew.name: slew for slew in slews.slews()}
    for row in data['rows']:
        if row['problem'] in names:
            row |= run.flown(every[row['problem']], run.FRAMES, row['bound_s'])


def time(data: dict[str, Any], names: list[str]) -> None:
    """Measure solve times, of other solvers on the problems of these names."""
    for old, slew in zip(data['timing'], slews.slews()):
        new = timing.measure(slew, run.TIMED_TICKS, peers=slew.name in names)
        known = {row['solver']: row for row in [*old['rows'], *(
            row for row in new['rows'] if 'why_not' not in row)]}
        old |= new | {'rows': list(known.values()), 'load_average': os.getloadavg()}


def main() -> None:
    """Do what the command line says, and write it into the file."""
    data = json.loads(RESULT.read_text(encoding='utf-8'))
    {'fly': fly, 'time': time}[sys.argv[1]](data, sys.argv[2:])
    data['targets'] = run.targets(data['rows'], data['timing'])
    for each in data['targets']:
        print(each)
    RESULT.write_text(json.dumps(data, indent=1) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
