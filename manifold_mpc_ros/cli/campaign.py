# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``campaign``: thousands of closed loops, and what the theory forbids counted."""

from __future__ import annotations

import argparse
import math
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.config_controller import ControllerConfig
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.sim.campaign import OPPOSITE, RANDOM, CampaignSettings, CaseName

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.console import Console

    from manifold_mpc_ros.sim.campaign_outcome import Outcome
    from manifold_mpc_ros.sim.campaign_workers import Work

SUMMARY = 'Run thousands of closed loops on the model; succeed when the theory holds in each.'
EXAMPLES = """\
  manifold-mpc campaign
      10,000 random starts and 1,000 exact 180 degree ones of the shipped controller, on all cores
  manifold-mpc campaign --random 300 --opposite 100 --output results/short.json
      a short one
  manifold-mpc campaign --target pointing --random 1000 --opposite 100
      of the controller that points one body axis and leaves roll free
  manifold-mpc campaign --case random-17
      one case again, tick by tick
"""
EXIT_NOT_ACHIEVED, EXIT_INTERRUPTED = 1, 130
# Where the output is no terminal, a line as often as this.
PLAIN_LINE_PERIOD_S = 10.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    shared.add_controller_config(parser)
    shared.add_backend(parser, "the parameter file's")
    parser.add_argument(
        '--target', choices=('attitude', 'pointing'),
        help="turn to an attitude, or point one body axis, roll free (default: the parameter "
             "file's)")
    parser.add_argument(
        '--random', type=count, default=10000, metavar='N',
        help='loops from uniform attitudes with rates uniform in a ball (default: %(default)s)')
    parser.add_argument(
        '--opposite', type=count, default=1000, metavar='N',
        help='loops from rest at exactly 180 degrees: about the principal axes, then random ones; '
             'for pointing from the exact antipode (default: %(default)s)')
    parser.add_argument(
        '--largest-rate', type=shared.number, default=0.3, metavar='RAD/S',
        help='radius of the ball of initial rates (default: %(default)s)')
    parser.add_argument(
        '--seed', type=count, default=0, metavar='N',
        help='a case depends on this and on its own name alone (default: %(default)s)')
    parser.add_argument(
        '--duration', type=shared.positive_number, default=30.0, metavar='S',
        help="length of each loop, a multiple of the controller's step (default: %(default)s)")
    parser.add_argument(
        '--settled-deg', type=shared.positive_number, default=0.1, metavar='DEG',
        help='settled: below this error to the end (default: %(default)s)')
    parser.add_argument(
        '--settled-rad-s', type=shared.positive_number, default=1e-3, metavar='RAD/S',
        help='and below this body rate (default: %(default)s)')
    parser.add_argument(
        '--workers', type=workers, default=os.cpu_count() or 1, metavar='N',
        help='processes that share the loops (default: one for each core)')
    parser.add_argument(
        '--case', metavar='NAME', help='run this case alone and print its course, write nothing')
    parser.add_argument(
        '--output', type=Path, default=Path('results/campaign.json'), metavar='FILE.json',
        help='every figure, and the cases that broke anything (default: %(default)s)')
    parser.add_argument(
        '--picture', type=Path, metavar='FILE.png', help='the picture (default: beside --output)')
    parser.add_argument(
        '--table', type=Path, metavar='FILE.csv', help='one row for each loop (default: none)')


def count(text: str) -> int:
    """Read a whole number that is not negative."""
    if not (text.isdecimal() and int(text) < 10**9):
        raise argparse.ArgumentTypeError(f'{text!r} is not a whole number from 0 to 999999999')
    return int(text)


def workers(text: str) -> int:
    """Read a number of processes."""
    if not (text.isdecimal() and 1 <= int(text) <= 1024):
        raise argparse.ArgumentTypeError(f'{text!r} is not a whole number from 1 to 1024')
    return int(text)


@dataclass(frozen=True, eq=False)
class Run:
    """What a campaign came to."""

    outcomes: list[Outcome]
    planned: int
    workers: int
    elapsed_s: float

    @property
    def complete(self) -> bool:
        """Whether every case was run."""
        return len(self.outcomes) == self.planned


def run(arguments: argparse.Namespace) -> int:
    """Run, print, write; 0 when every loop ran and none broke anything, otherwise 1 (or 130)."""
    from manifold_mpc_ros.cli import campaign_report, report
    from manifold_mpc_ros.sim.campaign_workers import Work, build_controller
    controller = ControllerConfig.from_yaml(
        shared.controller_config_path(arguments.controller_config))
    config = controller.mpc if arguments.target is None else replace(
        controller.mpc, target=arguments.target)
    settings = _settings(arguments, config.step_s)
    settings.check(config)
    work = Work(config, settings, arguments.backend or controller.backend,
                build_controller)
    console = report.make_console()
    if arguments.case is not None:
        return campaign_report.show_case(console, work, CaseName.parse(arguments.case))
    names = [CaseName(kind, index) for kind in (RANDOM, OPPOSITE)
             for index in range(getattr(arguments, kind))]
    if not names:
        raise ConfigurationError('--random and --opposite', 0, 'at least one loop in all')
    written = _destinations(arguments)
    processes = min(arguments.workers, len(names))
    if processes > 1:
        # What cannot be built is said now, and a compiled solver is there for every worker.
        with console.status('Designing the terminal set and building the solver'):
            build_controller(config, work.backend)
    done = _run_all(console, work, names, processes)
    if not done.outcomes:
        console.print('Interrupted before the first loop ended.')
        return EXIT_INTERRUPTED
    campaign_report.show(console, work, done)
    report.say_written(console, campaign_report.write(work, done, *written))
    if not done.complete:
        return EXIT_INTERRUPTED
    return EXIT_NOT_ACHIEVED if any(outcome.broken for outcome in done.outcomes) else 0


def _settings(arguments: argparse.Namespace, step_s: float) -> CampaignSettings:
    """Return what the arguments ask for; raises ConfigurationError."""
    steps = round(arguments.duration / step_s)
    if steps < 1 or not math.isclose(steps * step_s, arguments.duration, rel_tol=1e-9):
        raise ConfigurationError(
            '--duration', arguments.duration, f'a multiple of the step {step_s:g} s')
    return CampaignSettings(
        arguments.seed, arguments.largest_rate, steps, math.radians(arguments.settled_deg),
        arguments.settled_rad_s)


def _destinations(arguments: argparse.Namespace) -> tuple[Path, Path, Path | None]:
    """Return the files to write, their folders made; found out before the loops run."""
    def checked(path: Path) -> Path:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
            raise ConfigurationError('output file', str(path), 'a file that can be written')
        return path

    data = checked(arguments.output)
    return (data, checked(arguments.picture or data.with_suffix('.png')),
            None if arguments.table is None else checked(arguments.table))


def _run_all(console: Console, work: Work, names: list[CaseName], processes: int) -> Run:
    """Run every case; an interrupt keeps what has been done."""
    from manifold_mpc_ros.sim.campaign_workers import run_cases
    begin, outcomes = time.monotonic(), dict[str, 'Outcome']()
    chunks = run_cases(work, names, processes)
    try:
        with _progress(console, len(names), processes) as advance:
            for chunk in chunks:
                outcomes.update({outcome.name: outcome for outcome in chunk})
                advance(len(chunk), sum(bool(outcome.broken) for outcome in chunk))
    except KeyboardInterrupt:
        console.print('Interrupted; what follows is what has been done.')
    finally:
        chunks.close()  # type: ignore[attr-defined]
    in_order = [outcomes[str(name)] for name in names if str(name) in outcomes]
    return Run(in_order, len(names), processes, time.monotonic() - begin)


@contextmanager
def _progress(console: Console, total: int, processes: int
              ) -> Iterator[Callable[[int, int], None]]:
    """Show how far it is; yields what to call with the loops done and broken since."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    begin = last = time.monotonic()
    broken = 0
    with Progress(
        TextColumn(f'closed loops, {processes} at a time'), BarColumn(), MofNCompleteColumn(),
        TimeElapsedColumn(), TextColumn('left'), TimeRemainingColumn(),
        TextColumn('broken {task.fields[broken]}'), console=console,
        disable=not console.is_terminal,
    ) as progress:
        task = progress.add_task('', total=total, broken=0)
        done = 0
        if not console.is_terminal:
            _say(console, f'{total} loops, {processes} at a time')

        def advance(loops: int, broke: int) -> None:
            nonlocal done, broken, last
            done, broken, now = done + loops, broken + broke, time.monotonic()
            progress.update(task, completed=done, broken=broken)
            if not console.is_terminal and (now - last > PLAIN_LINE_PERIOD_S or done == total):
                last = now
                left_s = (now - begin) / done * (total - done)
                _say(console, f'{done} of {total} loops, {broken} broken, {left_s:.0f} s left')

        yield advance


def _say(console: Console, line: str) -> None:
    """Print a line at once."""
    console.print(line)
    console.file.flush()
