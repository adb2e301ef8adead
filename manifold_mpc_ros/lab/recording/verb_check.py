# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``check``: judge recorded runs by the acceptance limits inside their bags."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from manifold_mpc_ros.errors import BagError

if TYPE_CHECKING:
    from rich.table import Table

    from manifold_mpc_ros.lab.recording.bags.run import BagRun
    from manifold_mpc_ros.lab.recording.bags.verdict import Verdict

EXAMPLES = """\
  manifold-mpc check results/bags/rest_to_rest_90
      the table of limits; exit status 0 when all of them were kept
  manifold-mpc check results/bags/* --junit verdict.xml
      several bags, and a file that continuous integration reads"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    parser.add_argument(
        'bags', nargs='+', type=Path, metavar='BAG',
        help='a bag that manifold-mpc record made: its folder, or its storage file')
    parser.add_argument(
        '--junit', type=Path, metavar='FILE', help='write the verdict as JUnit XML too')


def run(arguments: argparse.Namespace) -> int:
    """Print a table for each bag; 0 when every run passed."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.lab.recording.junit import Suite, write_junit
    console = report.make_console()
    suites: list[Suite] = []
    for path in arguments.bags:
        try:
            recorded, verdict = judged(path)
        except BagError as error:
            if len(arguments.bags) == 1:
                raise
            suites.append(Suite(str(path), error=str(error)))
            console.print(f'{error}\n', soft_wrap=True, markup=False)
            continue
        suites.append(Suite(recorded.title, verdict))
        console.print(verdict_table(recorded, verdict))
        console.print(sentence(verdict), soft_wrap=True, markup=False)
    if arguments.junit is not None:
        write_junit(arguments.junit, suites)
        report.say_written(console, [arguments.junit])
    passed = sum(each.verdict is not None and each.verdict.passed for each in suites)
    if len(suites) > 1:
        console.print(f'{passed} of {len(suites)} bags passed')
    return 0 if passed == len(suites) else 1


def judged(path: Path) -> tuple[BagRun, Verdict]:
    """Read a bag and judge it; raises BagError when there is nothing to judge."""
    from manifold_mpc_ros.lab.recording.bags.run import read_run
    from manifold_mpc_ros.lab.recording.bags.verdict import judge
    recorded = read_run(path)
    return recorded, judge(recorded)


def verdict_table(recorded: BagRun, verdict: Verdict) -> Table:
    """Return the judgements as a table."""
    from rich.table import Table
    from rich.text import Text
    table = Table(title=Text(f'{recorded.title}: {recorded.path}'), title_justify='left')
    for name in ('', 'limit', 'measured', 'verdict'):
        table.add_column(name)
    for each in verdict.judgements:
        table.add_row(each.name, Text(each.limit), Text(each.measured),
                      Text('ok') if each.passed else Text('FAIL', style='bold red'))
    return table


def sentence(verdict: Verdict) -> str:
    """Return the verdict in one line."""
    if verdict.passed:
        return 'PASS\n'
    return f'FAIL: {", ".join(verdict.failed)}\n'
