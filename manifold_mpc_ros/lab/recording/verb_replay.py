# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``replay``: recorded states to a live controller over DDS, its torques compared."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.cli.extras import require
from manifold_mpc_ros.cli.processes import end_on_sigterm, stay_private
from manifold_mpc_ros.lab.recording.bag_topics import add_topics, topics_given
from manifold_mpc_ros.lab.recording.replay_plan import ReplayPlan

if TYPE_CHECKING:
    from rich.console import Console

    from manifold_mpc_ros.lab.recording.bags.compare import Comparison

EXAMPLES = """\
  manifold-mpc replay results/bags/rest_to_rest_90
      in lockstep; with the build that recorded it every torque has to have the same bits
  manifold-mpc replay my_bag --tolerance 1e-9
      within 1e-9 N m, whatever build recorded it
  manifold-mpc replay my_bag --rate 2
      by the stamps of the states, twice as fast as real time
  manifold-mpc replay theirs.mcap --pose /pose --twist /twist --controller-config mine.yaml
      a bag from another stack, by its stamps"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    parser.add_argument('bag', type=Path, metavar='BAG', help='a bag: folder or storage file')
    parser.add_argument(
        '--rate', type=shared.positive_number, metavar='FACTOR',
        help='give the states by their stamps, FACTOR times as fast as real time (default: as '
             'fast as it was recorded; a recording that was in lockstep, each state when the one '
             'before has been answered)')
    parser.add_argument(
        '--tolerance', type=_tolerance, metavar='N_M',
        help='largest difference of a torque about any axis [N m]; 0 means the same bits '
             '(default: 0 with the build and the machine that recorded the bag, 1e-9 with '
             'another; 0.05 unless in lockstep)')
    shared.add_backend(parser, "the bag's")
    shared.add_controller_config(parser)
    parser.add_argument(
        '--start-limit', type=shared.positive_number, default=120.0, metavar='S',
        help='wall clock until the controller is ready (default: %(default)s)')
    add_topics(parser)


def run(arguments: argparse.Namespace) -> int:
    """Replay; 0 when every torque to compare is within the tolerance."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.lab.recording.bags.run import read_run
    from manifold_mpc_ros.lab.recording.replayer import replay
    topics = topics_given(arguments)
    recorded = read_run(arguments.bag, topics)
    plan = ReplayPlan.of(recorded, arguments.controller_config, arguments.backend,
                         arguments.rate)
    require('replay', 'rclpy')
    end_on_sigterm()
    stay_private(os.environ)  # a node is in this process
    console = report.make_console()
    for warning in recorded.warnings:
        console.print(f'damaged: {warning}', soft_wrap=True, markup=False)
    for note in recorded.notes:
        console.print(f'note: {note}', soft_wrap=True, markup=False)
    result = replay(plan, console, arguments.start_limit)
    compared = len(recorded.commands) or recorded.scenario or arguments.topic_torque
    tolerance = arguments.tolerance
    if tolerance is None:
        tolerance = plan.default_tolerance_n_m(result.backend)
    comparison = plan.compare(result.torques) if compared else None
    console.print(f'Replay of {recorded.path}', soft_wrap=True, markup=False)
    console.print(report.result_table('', [
        ('given', f'{len(plan.feed.states)} states, {len(plan.feed.setpoints)} setpoints, '
         + ('in lockstep' if plan.rate is None
            else f'{plan.rate:g} times as fast as real time')),
        ('controller', f'backend {result.backend}; the recording had '
         f'{recorded.backend or "an unknown one"}'),
        ('answers', f'{len(result.torques)} torques'),
        *(_compared_rows(comparison, tolerance) if comparison is not None else
          [('compared', 'with nothing: there are no torques in the bag')]),
    ]))
    if comparison is None:
        return 0 if result.torques else 1
    return _verdict(console, plan, comparison, tolerance)


def _compared_rows(comparison: Comparison, tolerance_n_m: float) -> list[tuple[str, str]]:
    """Return the rows about the comparison."""
    differences = comparison.difference_n_m
    finite = differences[np.isfinite(differences)]
    largest = float(finite.max()) if len(finite) else float('nan')
    bits = 'every bit is the same' if comparison.identical else f'{largest:.3g} N m'
    within = 'the same bits' if tolerance_n_m == 0.0 else f'at most {tolerance_n_m:g} N m'
    return [('compared', f'{len(comparison)} recorded torques, '
             f'{comparison.unanswered} of them without an answer now'),
            ('largest difference', f'{bits} (asked for: {within})')]


def _verdict(
    console: Console, plan: ReplayPlan, comparison: Comparison, tolerance_n_m: float,
) -> int:
    """Say the verdict, with the first tick that differs; return the exit status."""
    recorded = plan.recorded
    if not len(comparison):
        console.print(f'FAIL: no torque to compare with can be read in {recorded.path}',
                      soft_wrap=True, markup=False)
        return 1
    first = comparison.first_beyond(
        tolerance_n_m, unanswered=comparison.unanswered > plan.may_miss * len(comparison))
    if first is None and not recorded.warnings:
        console.print('PASS')
        return 0
    if first is None:
        console.print('FAIL: what could be read of the damaged bag agrees', soft_wrap=True)
        return 1
    console.print(
        f'FAIL: first at tick {first + 1} of {len(comparison)}, '
        f'{comparison.time_s[first]:g} s (stamp {comparison.stamp_ns[first]}):',
        soft_wrap=True, markup=False)
    for name, values in (('recorded', comparison.recorded[first]),
                         ('replayed', comparison.replayed[first])):
        text = ', '.join(f'{value!r}' for value in values.tolist())
        console.print(f'  {name}  ({text}) N m', soft_wrap=True, markup=False)
    return 1


def _tolerance(text: str) -> float:
    """Read a finite number of at least zero."""
    value = shared.number(text)
    if value < 0.0:
        raise argparse.ArgumentTypeError(f'{text!r} is below 0')
    return value
