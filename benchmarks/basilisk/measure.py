# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measure the controller on a spacecraft that Basilisk simulates; `make basilisk` runs this.

    python benchmarks/basilisk/measure.py [--only PART ...] [--output docs/results/basilisk.json]

The controller is the installed executable, over DDS in lockstep. What is not asked for stays in
the file.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

# The folder above has what draws.
sys.path.append(str(Path(__file__).parents[1]))

import basilisk_tables
import pointing
import slews
from body import STEP_S
from link import INTERPRETER

from manifold_mpc_ros.cli import provenance

RESULT = Path(__file__).parents[2] / 'docs' / 'results' / 'basilisk.json'


Run = Callable[[dict[str, Any]], dict[str, Any]]


def runs() -> dict[tuple[str, str], Run]:
    """Return every run by study and name; each is given what was measured before."""
    found: dict[tuple[str, str], Run] = {
        ('slews', name): lambda _, slew=slew: slews.run(slew)
        for name, slew in slews.slews().items()}
    flights = pointing.flights()
    for period_s, noise in ((STEP_S, ''), (STEP_S, ' with noise'), (0.1, '')):
        every = f'every {period_s:g} s'
        tuned = flights['nadir with noise' if noise else 'step of a disturbance']
        found['tuning', every + noise] = lambda _, tuned=tuned, period_s=period_s: pointing.tried(
            tuned, period_s)
        for name, flight in flights.items():
            if (flight.noise is None) == bool(noise):
                continue
            # An orbit of short periods over DDS takes too long.
            if flight.duration_s < 1000.0 or period_s == STEP_S:
                found['pointing', f'{name}, controller {every}'] = (
                    lambda _, flight=flight, period_s=period_s: pointing.by_controller(
                        flight, period_s))
            found['pointing', f'{name}, law {every}'] = (
                lambda data, flight=flight, key=every + noise: pointing.by_law(
                    flight, data['tuning'][key]['best']))
    return found


def main() -> None:
    """Measure and write; every run is written when it is done."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument('--only', nargs='+', metavar='PART', default=[''],
                        help='runs whose study or name has one of these in it')
    parser.add_argument('--output', type=Path, default=RESULT)
    given = parser.parse_args()
    if not INTERPRETER.exists():
        raise SystemExit(f'{INTERPRETER} is not there: make basilisk installs it')
    data: dict[str, Any] = {}
    if given.output.exists():
        data = json.loads(given.output.read_text(encoding='utf-8'))
    data['processor'], data['cores'] = provenance.processor(), os.cpu_count()
    for (study, name), run in runs().items():
        if any(part in f'{study}: {name}' for part in given.only):
            data.setdefault(study, {})[name] = found = run(data)
            print(f'{study}: {name}', json.dumps({
                key: value for key, value in found.items() if key != 'trace'}), flush=True)
            given.output.write_text(json.dumps(data, indent=1) + '\n', encoding='utf-8')
    basilisk_tables.draw(data, given.output.parent)


if __name__ == '__main__':
    main()
