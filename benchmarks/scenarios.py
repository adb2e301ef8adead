# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Record, judge and replay shipped scenarios; write what became of them to docs/results.

python benchmarks/scenarios.py [--output results/scenarios] [--keep] [NAME ...]

Each scenario runs as two real processes over DDS (`manifold-mpc record`), is judged by its own
limits (`check`), and is given to a live controller again (`replay`). All of them are on one page,
OUTPUT/report/report.html. Entries of docs/results/scenarios.json are replaced by name. Scenarios
in real time need a machine that is not busy. Exit status 0 when every scenario passed.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from manifold_mpc_ros.cli.main import EXIT_INTERRUPTED, main
from manifold_mpc_ros.lab.recording.bags.run import read_run
from manifold_mpc_ros.lab.recording.bags.verdict import judge
from manifold_mpc_ros.lab.recording.verb_record import shipped_scenarios

RESULTS = Path(__file__).parents[1] / 'docs' / 'results' / 'scenarios.json'


def outcome(bag: Path, replayed: bool) -> dict[str, Any]:
    """Return what became of one scenario."""
    run = read_run(bag)
    verdict = judge(run)
    return {
        'verdict': 'PASS' if verdict.passed else 'FAIL',
        'not_kept': list(verdict.failed),
        'limits': {each.name: {'limit': each.limit, 'measured': each.measured}
                   for each in verdict.judgements},
        'replay': 'within the tolerance' if replayed else 'differs',
        'lockstep': run.scenario is not None and run.scenario.lockstep,
        'torques': len(run.commands),
        'bag_bytes': sum(file.stat().st_size for file in bag.iterdir()),
        'versions': dict(run.description.versions),
    }


def asked(*arguments: str) -> int:
    """Run a verb of manifold-mpc; return its exit status. Ctrl-C there ends everything here."""
    status = main(arguments)
    if status == EXIT_INTERRUPTED:
        sys.exit(EXIT_INTERRUPTED)
    return status


def study(names: list[str], folder: Path, *, keep: bool) -> dict[str, Any]:
    """Run the scenarios one after the other."""
    outcomes: dict[str, Any] = {}
    for name in names:
        bag = folder / 'bags' / name
        there = keep and bag.is_dir()
        if not there and asked('record', name, '--overwrite', '-o', str(bag)) not in (0, 1):
            outcomes[name] = {'verdict': 'FAIL', 'not_kept': ['recording']}
            continue
        asked('check', str(bag))
        outcomes[name] = outcome(bag, asked('replay', str(bag)) == 0)
    return outcomes


def run(arguments: argparse.Namespace) -> int:
    """Run everything, write the results, print the summary."""
    names = arguments.names or [path.stem for path in shipped_scenarios()]
    outcomes = study(names, arguments.output, keep=arguments.keep)
    bags = [str(arguments.output / 'bags' / name) for name in names]
    asked('report', *bags, '--output', str(arguments.output / 'report'))
    print(f'\n{"scenario":24} {"verdict":8} {"settling time":18} {"final error":16} replay')
    for name, found in outcomes.items():
        limits = found.get('limits', {})
        shown = [limits.get(key, {}).get('measured', '') for key in (
            'settle_time_s', 'final_error_deg')]
        print(f'{name:24} {found["verdict"]:8} {shown[0]:18} {shown[1]:16} '
              f'{found.get("replay", "")} {", ".join(found["not_kept"])}')
    passed = sum(found['verdict'] == 'PASS' for found in outcomes.values())
    print(f'{passed} of {len(outcomes)} passed')
    known = json.loads(RESULTS.read_text(encoding='utf-8')) if RESULTS.is_file() else {}
    RESULTS.write_text(json.dumps({**known, **outcomes}, indent=1, sort_keys=True) + '\n',
                       encoding='utf-8')
    print(f'Written: {RESULTS}')
    return 0 if passed == len(outcomes) else 1


if __name__ == '__main__':
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=(
        argparse.RawDescriptionHelpFormatter))
    parser.add_argument('names', nargs='*', metavar='NAME', help='scenarios (default: all)')
    parser.add_argument('--output', type=Path, default=Path('results/scenarios'), metavar='DIR')
    parser.add_argument('--keep', action='store_true', help='record only what is not there yet')
    sys.exit(run(parser.parse_args()))
