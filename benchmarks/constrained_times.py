# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Our warm solves on B1 and B1b again, with cones and without, in docs/results/constrained.json.

    python benchmarks/constrained_times.py [B1] [B1b]

Where a problem is named its other solvers are measured again too, as far as they are installed.
What ``manifold-mpc bench --constrained`` measured of flights, of other solvers and of first
searches of as many passes stays.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

from manifold_mpc_ros.lab.benchmark.constrained import run, slews, timing

RESULT = Path(__file__).parents[1] / 'docs' / 'results' / 'constrained.json'


def main() -> None:
    """Measure, and write them into the file."""
    data = json.loads(RESULT.read_text(encoding='utf-8'))
    for old, slew in zip(data['timing'], slews.slews()):
        new = timing.measure(slew, run.TIMED_TICKS, peers=slew.name in sys.argv[1:])
        for row, before in zip(new['rows'], old['rows']):
            if row.get('first_passes', -1) == before.get('first_passes'):
                row['first_ms'] = before['first_ms']
        known = {row['solver']: row for row in [*old['rows'], *(
            row for row in new['rows'] if 'why_not' not in row)]}
        old |= new | {'rows': list(known.values()), 'load_average': os.getloadavg()}
        print(slew.name, new['cones_cost'])
    data['targets'] = run.targets(data['rows'], data['timing'])
    RESULT.write_text(json.dumps(data, indent=1) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
