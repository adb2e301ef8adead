# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``bench``: our solver beside others on the same instances, in one run on one core."""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.cli.extras import require
from manifold_mpc_ros.errors import ConfigurationError, ManifoldMpcError

if TYPE_CHECKING:
    from rich.console import Console

    from manifold_mpc_ros.lab.benchmark.peers.instances import Instance
    from manifold_mpc_ros.lab.benchmark.peers.solver import Entry

EXAMPLES = """\
  manifold-mpc bench
      every solver that is installed, N = 5 to 160: about a quarter of an hour
  manifold-mpc bench --quick
      few instances at N = 10 and 20: a minute or two
  manifold-mpc bench --solvers ours acados --horizons 20
      only solvers with these words in their names
  manifold-mpc bench --instructions
      instructions per solve of our solver by valgrind, which no other load changes
  manifold-mpc bench --tick
      latency of the controller node over DDS, at 10 to 200 Hz: ten minutes
  manifold-mpc bench --batch
      10,000 closed loops of 200 steps on all cores: a minute
  manifold-mpc bench --constrained
      public slews with cones, beside others and time-optimal bounds: minutes
"""
HORIZONS = (5, 10, 20, 40, 80, 160)
QUICK_HORIZONS = (10, 20)
INSTANCES, QUICK_INSTANCES = 200, 20
STARTUP_HORIZON = 20
# Counted: so many cold solves with so many warm steps after each.
COUNTED_COLD, COUNTED_WARM = 5, 10
TICK_S, QUICK_TICK_S = 60.0, 5.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    parser.add_argument('--quick', action='store_true', help='a short run, for a first look')
    parser.add_argument(
        '--horizons', type=shared.whole_number(1, 1000), nargs='+', metavar='N',
        help=f'numbers of steps (default: {" ".join(map(str, HORIZONS))})')
    parser.add_argument(
        '--instances', type=shared.whole_number(1, INSTANCES), metavar='N',
        help=f'random instances, beside the half turns (default: {INSTANCES})')
    parser.add_argument(
        '--solvers', nargs='+', metavar='WORD',
        help='only solvers with one of these words in their names (default: all)')
    parser.add_argument(
        '--core', type=int, metavar='NUMBER',
        help='the core that everything is measured on (default: the last one allowed)')
    instead = parser.add_mutually_exclusive_group()
    instead.add_argument(
        '--instructions', action='store_true',
        help='instead: count instructions of our solver, which needs valgrind')
    instead.add_argument(
        '--tick', action='store_true', help='instead: latency of the controller node over DDS')
    instead.add_argument(
        '--batch', action='store_true', help='instead: many closed loops at once on all cores')
    instead.add_argument(
        '--constrained', action='store_true',
        help='instead: public slews with cones, beside others and time-optimal bounds')
    parser.add_argument(
        '--seconds', type=shared.positive_number, metavar='S',
        help=f'length of each run of --tick (default: {TICK_S:g}, {QUICK_TICK_S:g} with --quick)')
    parser.add_argument(
        '--output', type=Path, metavar='FILE.json',
        help='every figure (default: results/bench.json, instructions.json, tick.json or '
             'batch.json, constrained.json); a picture goes beside it')


def run(arguments: argparse.Namespace) -> int:
    """Measure, print, write; 0 when what was asked for was measured, whoever won."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.lab.benchmark import text_report
    from manifold_mpc_ros.lab.benchmark.peers import instances
    console = report.make_console()
    core, entries = _core(arguments.core), _entries(arguments.solvers)
    kind = next((kind for kind in ('instructions', 'tick', 'batch', 'constrained')
                 if getattr(arguments, kind)), 'bench')
    output = arguments.output or Path('results', f'{kind}.json')
    output.parent.mkdir(parents=True, exist_ok=True)
    if arguments.tick:
        return _measure_ticks(console, output, arguments)
    if arguments.batch:
        return _close_loops(console, output, arguments)
    if arguments.constrained:
        return _fly_slews(console, output, core, quick=arguments.quick)
    if arguments.instructions:
        return _count_instructions(console, output, arguments, entries)
    states = instances.draw(
        arguments.instances or (QUICK_INSTANCES if arguments.quick else INSTANCES))
    written = [instances.write(output.with_name(f'{output.stem}_instances.json'), states)]
    data = _measure(console, arguments, core, entries, states)
    output.write_text(json.dumps(data, indent=1, allow_nan=False) + '\n', encoding='utf-8')
    text_report.show(console, data)
    from manifold_mpc_ros.lab.benchmark.plot_bench import plot_bench
    written += [output, plot_bench(data, output.with_suffix('.png'))]
    report.say_written(console, written)
    return 0 if any(row['start'] != 'none' for row in data['rows']) else 1


def _core(wanted: int | None) -> int:
    """Return the core to measure on; raises ConfigurationError for one that is not there."""
    allowed = os.sched_getaffinity(0)
    if wanted is not None and wanted not in allowed:
        raise ConfigurationError('--core', wanted, f'one of {sorted(allowed)}')
    return max(allowed) if wanted is None else wanted


def _entries(words: list[str] | None) -> list[Entry]:
    """Return the solvers asked for; raises ConfigurationError when there are none."""
    from manifold_mpc_ros.lab.benchmark.peers.solver import ENTRIES
    found = [entry for entry in ENTRIES
             if words is None or any(word.lower() in entry.name.lower() for word in words)]
    if not found:
        raise ConfigurationError('--solvers', words, 'words that occur in '
                                 + '; '.join(entry.name for entry in ENTRIES))
    return found


def _measure(console: Console, arguments: argparse.Namespace, core: int, entries: list[Entry],
             states: list[Instance]) -> dict[str, Any]:
    """Run everything and return it as JSON values."""
    from manifold_mpc_ros.cli.progress import activity
    from manifold_mpc_ros.lab.benchmark import measure, startup, summary, targets, text_report
    horizons = arguments.horizons or (QUICK_HORIZONS if arguments.quick else HORIZONS)
    settings = measure.Settings(core, repeats=2, loops=3) if arguments.quick else (
        measure.Settings(core))
    begin, rows = time.monotonic(), []
    with activity(console) as say:
        for horizon in horizons:
            comparison = measure.compare(horizon, entries, states, settings, say)
            rows += summary.rows_of(comparison, states)
        started = []
        for entry in entries:
            say(f'start-up of {entry.name}')
            started.append(startup.start_up(entry, STARTUP_HORIZON, core))
        say("the core's rate")
        machine = text_report.machine(core, _or_none(core))
    return {
        'statement': text_report.STATEMENT, 'machine': machine,
        'settings': {'horizons': list(horizons), 'instances': len(states),
                     'repeats': settings.repeats, 'loops': settings.loops,
                     'loop_steps': settings.loop_steps,
                     'cold_budget_s': settings.cold_budget_s,
                     'warm_budget_s': settings.warm_budget_s,
                     'elapsed_s': round(time.monotonic() - begin)},
        'targets': targets.targets(rows, started), 'behind': targets.losses(rows),
        'limit': text_report.limits(machine, horizons), 'startup': started, 'rows': rows,
    }


def _or_none(core: int) -> float | None:
    """Return the core's rate [flop/s], None where it cannot be measured."""
    from manifold_mpc_ros.lab.benchmark import flops
    try:
        return flops.core_rate(core)
    except ManifoldMpcError:
        return None


def _count_instructions(console: Console, output: Path, arguments: argparse.Namespace,
                        entries: list[Entry]) -> int:
    """Count instructions of our compiled solvers, print and write them."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.cli.progress import activity
    from manifold_mpc_ros.lab.benchmark import instructions, text_report
    from manifold_mpc_ros.lab.benchmark.peers import solver
    compiled = (solver.OUR_LOCAL, solver.OUR_SEARCH)
    wanted = [entry for entry in entries if entry in compiled or arguments.solvers]
    jobs: list[tuple[Entry, int, int, int]] = []
    for horizon in arguments.horizons or QUICK_HORIZONS:
        for entry in wanted:
            if entry.cold:
                jobs.append((entry, horizon, COUNTED_COLD, 0))
            if entry.warm:
                jobs.append((entry, horizon, COUNTED_COLD, COUNTED_WARM))
    count: Callable[..., dict[str, Any]] = instructions.count
    with activity(console) as say:
        rows = []
        for entry, horizon, cold, warm in jobs:
            say(f'{entry.name}, N = {horizon}: {cold} cold, {cold * warm} warm solves')
            rows.append(count(entry, horizon, cold, warm))
    output.write_text(json.dumps({'rows': rows}, indent=1) + '\n', encoding='utf-8')
    text_report.show_instructions(console, rows)
    report.say_written(console, [output])
    return 0


def _measure_ticks(console: Console, output: Path, arguments: argparse.Namespace) -> int:
    """Measure the controller's latency over DDS, print, draw and write it."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.cli.progress import activity
    from manifold_mpc_ros.lab.benchmark import text_report, tick
    from manifold_mpc_ros.lab.benchmark.plot_tick import plot_ticks
    require('bench --tick', 'rclpy')
    cores = sorted(os.sched_getaffinity(0))
    settings = tick.TickSettings(
        tick.RATES_HZ, arguments.seconds or (QUICK_TICK_S if arguments.quick else TICK_S),
        (cores[-1], cores[0]))
    with activity(console) as say:
        rows = tick.measure(settings, say)
    data = {'statement': tick.STATEMENT, 'seconds': settings.seconds,
            'machine': text_report.machine(cores[-1], None), 'rows': rows,
            'targets': tick.targets(rows)}
    output.write_text(json.dumps(data, indent=1, allow_nan=False) + '\n', encoding='utf-8')
    tick.show(console, data)
    report.say_written(console, [output, plot_ticks(rows, output.with_suffix('.png'))])
    return 0


def _close_loops(console: Console, output: Path, arguments: argparse.Namespace) -> int:
    """Close many loops at once, print and write what came of them."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.cli.progress import activity
    from manifold_mpc_ros.lab.benchmark import batch, closed_loops, text_report
    loops = batch.QUICK_LOOPS if arguments.quick else batch.LOOPS
    with activity(console) as say:
        row = closed_loops.close_loops(loops, batch.TICKS, batch.HORIZON, say)
    data = {'statement': batch.STATEMENT, 'machine': text_report.machine(None, None),
            'row': row, 'targets': batch.targets(row)}
    output.write_text(json.dumps(data, indent=1, allow_nan=False) + '\n', encoding='utf-8')
    batch.show(console, data)
    report.say_written(console, [output])
    return 0


def _fly_slews(console: Console, output: Path, core: int, *, quick: bool) -> int:
    """Fly the public slews with cones, print, draw and write them."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.cli.progress import activity
    from manifold_mpc_ros.lab.benchmark import text_report
    from manifold_mpc_ros.lab.benchmark.constrained import run as constrained
    from manifold_mpc_ros.lab.benchmark.constrained.plot import plot_slews
    with activity(console) as say:
        data = constrained.measure(
            constrained.QUICK_FRAMES if quick else constrained.FRAMES, core, say, peers=not quick)
    data['machine'] = text_report.machine(core, None)
    output.write_text(json.dumps(data, indent=1, allow_nan=False) + '\n', encoding='utf-8')
    constrained.show(console, data)
    report.say_written(console, [output, plot_slews(data, output.with_suffix('.png'))])
    return 0
