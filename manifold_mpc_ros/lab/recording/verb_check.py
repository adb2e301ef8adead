# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``check``: judge recorded runs by the acceptance limits of their scenarios."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bag_topics import add_topics, topics_given

if TYPE_CHECKING:
    from rich.table import Table

    from manifold_mpc_ros.lab.recording.bags.run import BagRun, TopicNames
    from manifold_mpc_ros.lab.recording.bags.verdict import Verdict

EXAMPLES = """\
  manifold-mpc check results/bags/rest_to_rest_90
      the table of limits; exit status 0 when all of them were kept
  manifold-mpc check results/bags/* --junit verdict.xml
      several bags, and a file that continuous integration reads
  manifold-mpc check theirs --scenario my_slew.yaml --state /gnc/odometry
      a bag that ros2 bag recorded, by the limits of a scenario file"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    parser.add_argument(
        'bags', nargs='+', type=Path, metavar='BAG',
        help='a bag: folder or storage file')
    parser.add_argument(
        '--scenario', metavar='SCENARIO',
        help='judge by this scenario, a file or the name of a shipped one (default: the scenario '
             'inside the bag)')
    parser.add_argument(
        '--junit', type=Path, metavar='FILE', help='write the verdict as JUnit XML too')
    add_topics(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print a table for each bag; 0 when every run passed."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.lab.recording.junit import Suite, write_junit
    console = report.make_console()
    suites: list[Suite] = []
    topics = topics_given(arguments)
    for path in arguments.bags:
        try:
            recorded, verdict = judged(path, topics, arguments.scenario)
        except BagError as error:
            if len(arguments.bags) == 1:
                raise
            suites.append(Suite(str(path), error=str(error)))
            console.print(f'{error}\n', soft_wrap=True, markup=False)
            continue
        suites.append(Suite(recorded.title, verdict))
        for note in recorded.notes:
            console.print(f'note: {note}', soft_wrap=True, markup=False)
        console.print(verdict_table(recorded, verdict))
        console.print(sentence(verdict), soft_wrap=True, markup=False)
    if arguments.junit is not None:
        write_junit(arguments.junit, suites)
        report.say_written(console, [arguments.junit])
    passed = sum(each.verdict is not None and each.verdict.passed for each in suites)
    if len(suites) > 1:
        console.print(f'{passed} of {len(suites)} bags passed')
    return 0 if passed == len(suites) else 1


def judged(
    path: Path, topics: TopicNames | None = None, scenario: str | None = None,
) -> tuple[BagRun, Verdict]:
    """Read a bag and judge it; raises BagError when there is nothing to judge."""
    from manifold_mpc_ros.lab.recording.bags.run import read_run
    from manifold_mpc_ros.lab.recording.bags.verdict import judge
    from manifold_mpc_ros.lab.recording.verb_record import find_scenario
    given = None if scenario is None else find_scenario(scenario)
    recorded = read_run(path, topics, given)
    return recorded, judge(recorded, own=given is None)


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
