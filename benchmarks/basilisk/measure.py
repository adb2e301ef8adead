# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measure the controller on a spacecraft that Basilisk simulates; `make basilisk` runs this.

    python benchmarks/basilisk/measure.py [--only NAME ...] [--output docs/results/basilisk.json]

The controller is the installed executable, over DDS in lockstep. What is not asked for stays in
the file.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any

# The folder above has what draws.
sys.path.append(str(Path(__file__).parents[1]))

import basilisk_tables
import slews
from link import INTERPRETER

from manifold_mpc_ros.cli import provenance

RESULT = Path(__file__).parents[2] / 'docs' / 'results' / 'basilisk.json'


def main() -> None:
    """Measure and write; every run is written when it is done."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    runs = {('slews', name): slew for name, slew in slews.slews().items()}
    parser.add_argument('--only', nargs='+', metavar='NAME', help=', '.join(
        name for _, name in runs))
    parser.add_argument('--output', type=Path, default=RESULT)
    given = parser.parse_args()
    if not INTERPRETER.exists():
        raise SystemExit(f'{INTERPRETER} is not there: make basilisk installs it')
    data: dict[str, Any] = {}
    if given.output.exists():
        data = json.loads(given.output.read_text(encoding='utf-8'))
    data['processor'], data['cores'] = provenance.processor(), os.cpu_count()
    for (study, name), slew in runs.items():
        if given.only and name not in given.only:
            continue
        data.setdefault(study, {})[name] = found = slews.run(slew)
        print(name, json.dumps({key: value for key, value in found.items() if key != 'trace'}),
              flush=True)
        given.output.write_text(json.dumps(data, indent=1) + '\n', encoding='utf-8')
    print(basilisk_tables.draw_slews(data, given.output.with_name('basilisk_slews.png')))


if __name__ == '__main__':
    main()
