# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``campaign``: thousands of closed loops drawn from a file, judged, and tabulated."""

from __future__ import annotations

import argparse
import re
import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.cli.extras import require
from manifold_mpc_ros.cli.processes import end_on_sigterm
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.campaign.case import CaseName, all_names
from manifold_mpc_ros.lab.campaign.plan import CampaignPlan
from manifold_mpc_ros.lab.campaign.run import Run

if TYPE_CHECKING:
    from rich.console import Console

    from manifold_mpc_ros.lab.campaign.chunks import Chunks, Work
    from manifold_mpc_ros.lab.campaign.journal import Journal

EXAMPLES = """\
  manifold-mpc campaign
      what the theory promises: 10,000 random starts and 1,000 exact 180 degree ones, on all cores
  manifold-mpc campaign dispersed
      another shipped campaign: bodies, torques and sensors that the controller does not know of
  manifold-mpc campaign my_spacecraft.yaml -o results/mine
      your own; the same command again goes on where it was interrupted
  manifold-mpc campaign my_spacecraft.yaml -o results/mine --scheduler tcp://10.0.0.1:8786
      the same on a Dask cluster
  manifold-mpc campaign results/mine/campaign.yaml --case random-17
      one case again, tick by tick"""
EXIT_NOT_ACHIEVED, EXIT_INTERRUPTED = 1, 130
DEFAULT_CAMPAIGN, DEFAULT_FOLDER = 'theory', Path('results/campaigns')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    parser.add_argument(
        'campaign', nargs='?', default=DEFAULT_CAMPAIGN, metavar='CAMPAIGN',
        help='a campaign file, or the name of a shipped one (default: %(default)s)')
    parser.add_argument('--list', action='store_true', help='list the shipped campaigns')
    shared.add_controller_config(parser)
    shared.add_backend(parser, "the campaign's")
    parser.add_argument(
        '--seed', type=shared.whole_number(0, 10**9 - 1), metavar='N',
        help="another seed than the campaign's")
    parser.add_argument(
        '--loops', type=loops, action='append', default=[], metavar='[SET=]N',
        help='another number of loops, in one set or in each; may be given several times')
    where = parser.add_mutually_exclusive_group()
    shared.add_workers(where)
    where.add_argument(
        '--scheduler', metavar='ADDRESS',
        help='share the loops on the Dask cluster with this scheduler, tcp://HOST:PORT')
    parser.add_argument(
        '--case', metavar='NAME', help='run this case alone and print its course, write nothing')
    parser.add_argument(
        '-o', '--output', type=Path, metavar='DIR',
        help=f'folder of the table and the report; loops that are in it already are not run '
             f'again (default: {DEFAULT_FOLDER}/NAME)')
    parser.add_argument(
        '--overwrite', action='store_true', help='begin anew what the folder holds')


def loops(text: str) -> tuple[str | None, int]:
    """Read ``N`` or ``SET=N``."""
    match = re.fullmatch(r'(?:(\w+)=)?(\d{1,9})', text, re.ASCII)
    if match is None:
        raise argparse.ArgumentTypeError(f'{text!r} is neither a whole number nor SET=N')
    return match[1], int(match[2])


def run(arguments: argparse.Namespace) -> int:
    """Run, print, write; 0 when every loop ran and none broke anything, otherwise 1 (or 130)."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.lab.campaign import chunks, one_case
    from manifold_mpc_ros.lab.campaign.output import files, text_report
    console = report.make_console()
    if arguments.list:
        return _list(console)
    plan = _plan(arguments)
    work = chunks.Work(plan, chunks.build_controller)
    if arguments.case is not None:
        return one_case.show_case(console, work, CaseName.parse(arguments.case))
    end_on_sigterm()
    folder = arguments.output or DEFAULT_FOLDER / plan.name
    done = _run(console, work, folder, arguments)
    if not done.outcomes:
        console.print('Interrupted before the first loop ended.')
        return EXIT_INTERRUPTED
    text_report.show(console, plan, done, folder)
    with console.status('Writing the table and the report'):
        written = files.write(plan, done, folder)
    report.say_written(console, written)
    if not done.complete:
        console.print('The same command again goes on from here.')
        return EXIT_INTERRUPTED
    return EXIT_NOT_ACHIEVED if done.broken else 0


def find_campaign(given: str) -> Path:
    """Return a campaign file, or a shipped one by its name."""
    if Path(given).is_file() or given.endswith(('.yaml', '.yml')):
        return Path(given)
    shipped = {path.stem: path for path in shipped_campaigns()}
    if given not in shipped:
        raise ConfigurationError(
            'CAMPAIGN', given, 'a file that exists, or one of ' + ', '.join(sorted(shipped)))
    return shipped[given]


def shipped_campaigns() -> list[Path]:
    """Return the files of the shipped campaigns."""
    return sorted((shared.shipped_config('controller.yaml').parent / 'campaigns').glob('*.yaml'))


def _list(console: Console) -> int:
    """Print names, descriptions and sizes of the shipped campaigns."""
    from manifold_mpc_ros.cli import console as report
    plans = [CampaignPlan.from_yaml(path) for path in shipped_campaigns()]
    console.print(report.result_table('Shipped campaigns', [
        (plan.name, f'{plan.description} ' + ', '.join(
            f'{one.loops} {one.name}' for one in plan.sets)) for plan in plans]))
    return 0


def _plan(arguments: argparse.Namespace) -> CampaignPlan:
    """Return the campaign that is asked for; raises ConfigurationError."""
    plan = CampaignPlan.from_yaml(
        find_campaign(arguments.campaign), arguments.controller_config)
    if arguments.seed is not None:
        plan = replace(plan, seed=arguments.seed)
    if arguments.backend is not None:
        plan = replace(plan, controller={**plan.controller, 'mpc.backend': arguments.backend})
    for set_name, number in arguments.loops:
        plan = plan.with_loops(set_name, number)
    if not all_names(plan):
        raise ConfigurationError('--loops', 0, 'at least one loop in all')
    return plan


def _run(console: Console, work: Work, folder: Path, arguments: argparse.Namespace) -> Run:
    """Run what is not in the folder yet; an interrupt keeps what has been done."""
    from manifold_mpc_ros.lab.campaign.journal import Journal
    from manifold_mpc_ros.lab.campaign.software import software
    require('campaign', 'pyarrow')
    names = all_names(work.plan)
    begin = time.monotonic()
    with Journal(folder, work.plan, software(), overwrite=arguments.overwrite) as journal:
        todo = [name for name in names if str(name) not in journal.outcomes]
        if len(todo) < len(names):
            console.print(f'{len(names) - len(todo)} of {len(names)} loops are in {folder}',
                          soft_wrap=True, markup=False)
        try:
            _run_all(console, work, journal, todo, arguments)
        except KeyboardInterrupt:
            console.print('Interrupted; what follows is what has been done.')
        outcomes = [journal.outcomes[str(name)] for name in names
                    if str(name) in journal.outcomes]
    new = sum(str(name) in journal.outcomes for name in todo)
    return Run(outcomes, len(names), new, _where(arguments, todo), time.monotonic() - begin)


def _run_all(console: Console, work: Work, journal: Journal, todo: list[CaseName],
             arguments: argparse.Namespace) -> None:
    """Run cases and record them."""
    from manifold_mpc_ros.cli.progress import Progress
    if not todo:
        return
    with ExitStack() as stack:
        chunks = _started(console, stack, work, todo, arguments)
        stack.callback(chunks.close)
        progress = stack.enter_context(Progress(
            console, 'loops', len(todo), f'{len(todo)} loops, {_where(arguments, todo)}'))
        done = broken = 0
        for chunk in chunks:
            journal.append(chunk)
            done += len(chunk)
            broken += sum(bool(outcome.broken) for outcome in chunk)
            progress.show(done, f'{broken} broken')


def _started(console: Console, stack: ExitStack, work: Work, todo: list[CaseName],
             arguments: argparse.Namespace) -> Chunks:
    """Return the iterator of outcomes, on a cluster or on processes of this machine."""
    from manifold_mpc_ros.lab.campaign.chunks import run_on_processes
    if arguments.scheduler is not None:
        from manifold_mpc_ros.lab.campaign.cluster import connected
        return stack.enter_context(connected(arguments.scheduler)).run(work, todo)
    processes = min(arguments.workers, len(todo))
    if processes > 1:
        # What cannot be built is said now, and a compiled solver is there for every worker.
        with console.status('Designing the terminal set and building the solver'):
            work.build()
    return run_on_processes(work, todo, processes)


def _where(arguments: argparse.Namespace, todo: list[CaseName]) -> str:
    """Return what runs the loops, in words."""
    if arguments.scheduler is not None:
        return 'a Dask cluster'
    return f'{min(arguments.workers, len(todo))} process(es)'
