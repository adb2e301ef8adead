# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``chaos``: inject faults between and into both nodes over DDS, count what survives."""

from __future__ import annotations

import argparse
import os
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.cli.extras import require
from manifold_mpc_ros.cli.processes import end_on_sigterm, stay_private
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.fault_injection import schedule
from manifold_mpc_ros.lab.fault_injection.fault import CONTROLLER, Fault
from manifold_mpc_ros.lab.fault_injection.schedule import Trial
from manifold_mpc_ros.lab.fault_injection.table import FAULTS, QUICK, faults_named

if TYPE_CHECKING:
    from rich.console import Console

    from manifold_mpc_ros.lab.fault_injection.evidence import TrialVerdict
    from manifold_mpc_ros.lab.fault_injection.rig import BenchPlan
    from manifold_mpc_ros.lab.fault_injection.run import Done

EXAMPLES = """\
  manifold-mpc chaos
      the quick selection: one seed, about a minute
  manifold-mpc chaos --matrix --seeds 5 --output docs/results/chaos_matrix.json
      every fault in every phase of the manoeuvre
  manifold-mpc chaos --soak 1h --rate-hz 50 --every 30
      one hour in one pair of processes, a random fault every 30 s
  manifold-mpc chaos --drills 200
      SIGKILL and restart of each node, 200 times, without an operator
  manifold-mpc chaos --matrix --fault state-frozen --fault hogs
      some faults alone; --list names them
  manifold-mpc chaos --controller-command 'ros2 run my_package my_controller'
      another controller with the same topics and diagnostics"""

EXIT_NOT_ACHIEVED, EXIT_INTERRUPTED = 1, 130
_UNITS = {'s': 1.0, 'min': 60.0, 'm': 60.0, 'h': 3600.0}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    what = parser.add_mutually_exclusive_group()
    what.add_argument('--matrix', action='store_true',
                      help='every fault in every phase with every seed')
    what.add_argument('--soak', type=duration, metavar='DURATION',
                      help='random faults for so long (90s, 20min, 1h), in one pair of processes')
    what.add_argument('--drills', type=shared.whole_number(1), metavar='N',
                      help='kill each node N times; it has to come back by itself')
    what.add_argument('--list', action='store_true', help='list the faults and end')
    parser.add_argument('--fault', action='append', metavar='NAME',
                        help='only this fault; may be given several times')
    parser.add_argument('--seeds', type=shared.whole_number(1), default=1, metavar='N',
                        help='seeds of the matrix (default: %(default)s)')
    parser.add_argument('--seed', type=int, default=0, metavar='N',
                        help='of manoeuvres and of the soak (default: %(default)s)')
    parser.add_argument('--every', type=shared.positive_number, default=30.0, metavar='S',
                        help='period of the faults of a soak (default: %(default)s)')
    parser.add_argument('--rate-hz', type=shared.positive_number, metavar='HZ',
                        help='rate of control, that of the states in proportion (default: as '
                             'in the parameter file, shipped: 50)')
    parser.add_argument('--pairs', type=shared.whole_number(1), default=2, metavar='N',
                        help='pairs of nodes side by side, each on a domain of its own; a soak '
                             'has one (default: %(default)s)')
    parser.add_argument('--controller-command', metavar='COMMAND',
                        help='run this as the controller; --ros-args are added')
    parser.add_argument('--controller-config', type=Path, metavar='FILE',
                        help='parameter file of the controller (default: shipped, chaos/)')
    parser.add_argument('--simulator-config', type=Path, metavar='FILE',
                        help='parameter file of the simulator (default: shipped, chaos/)')
    parser.add_argument('--output', type=Path, metavar='FILE.json',
                        help='write every figure (default: results/chaos_KIND.json)')


def duration(text: str) -> float:
    """Read a time in seconds, or with a unit: 90s, 20min, 1h."""
    number = text.rstrip('abcdefghijklmnopqrstuvwxyz')
    unit = text[len(number):] or 's'
    if unit not in _UNITS:
        raise argparse.ArgumentTypeError(f'{text!r} is not a time such as 90s, 20min or 1h')
    return shared.positive_number(number) * _UNITS[unit]


def run(arguments: argparse.Namespace) -> int:
    """Inject, print, write; 0 when every fault was survived, 1 when not, 130 after Ctrl-C."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.lab.fault_injection import text_report
    console = report.make_console()
    faults = faults_named(arguments.fault) if arguments.fault else FAULTS
    if arguments.list:
        console.print(text_report.fault_list(faults))
        return 0
    kind, trials = _trials(arguments, faults)
    if not trials:
        raise ConfigurationError('--fault', arguments.fault, 'a fault that this run can inject')
    output = _destination(arguments.output or Path(f'results/chaos_{kind}.json'))
    require('chaos', 'rclpy')
    end_on_sigterm()
    stay_private(os.environ)  # this process joins in
    done = _inject(_plan(arguments), trials, arguments, console)
    if not done.verdicts:
        console.print(f'Nothing was measured: {done.failure or "interrupted"}')
        return EXIT_NOT_ACHIEVED if done.failure else EXIT_INTERRUPTED
    text_report.show(console, done)
    report.say_written(console, [text_report.write(output, kind, arguments, done)])
    if done.failure or not all(verdict.survived for verdict in done.verdicts):
        return EXIT_NOT_ACHIEVED
    return 0 if len(done.verdicts) == done.planned else EXIT_INTERRUPTED


def _trials(arguments: argparse.Namespace, faults: Sequence[Fault]) -> tuple[str, list[Trial]]:
    """Return what is asked for: its name, and the faults to inject."""
    if arguments.soak is not None:
        chosen = [fault for fault in faults if not fault.simulated_time]
        return 'soak', schedule.soak(chosen, arguments.soak, arguments.every, arguments.seed)
    if arguments.drills is not None:
        return 'drills', schedule.drills(faults, arguments.drills)
    if arguments.matrix or arguments.fault:
        return 'matrix', schedule.matrix(faults, arguments.seeds)
    return 'quick', schedule.one_phase_each(faults_named(QUICK), arguments.seed)


def _plan(arguments: argparse.Namespace) -> BenchPlan:
    """Return what every pair of nodes is started with; raises ConfigurationError."""
    from manifold_mpc_ros.lab.fault_injection.rig import BenchPlan
    plan = BenchPlan(
        arguments.controller_config or shared.shipped_config('chaos/controller.yaml'),
        arguments.simulator_config or shared.shipped_config('chaos/simulator.yaml'),
        None if arguments.rate_hz is None else 1.0 / arguments.rate_hz,
        {} if arguments.controller_command is None else {
            CONTROLLER: shlex.split(arguments.controller_command)})
    plan.check()
    return plan


def _inject(
    plan: BenchPlan, trials: list[Trial], arguments: argparse.Namespace, console: Console,
) -> Done:
    """Run all trials with live progress."""
    from manifold_mpc_ros.cli.progress import Progress
    from manifold_mpc_ros.lab.fault_injection.run import run_trials
    pairs = 1 if arguments.soak is not None else arguments.pairs
    said = 0
    with Progress(console, 'faults injected', len(trials), 'starting the nodes') as progress:
        def show(verdicts: Sequence[TrialVerdict]) -> None:
            nonlocal said
            if len(verdicts) == said:
                return
            for verdict in verdicts[said:]:
                if not verdict.survived:
                    progress.say(f'NOT survived: {verdict.fault} ({verdict.phase}, seed '
                                 f'{verdict.seed}): ' + '; '.join(verdict.reasons))
            said = len(verdicts)
            progress.show(said, f'{sum(one.survived for one in verdicts)} survived')

        return run_trials(plan, trials, pairs, arguments.seed, show)


def _destination(path: Path) -> Path:
    """Return a file that can be written, its folder made; found out before the faults."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
        raise ConfigurationError('--output', str(path), 'a file that can be written')
    return path
