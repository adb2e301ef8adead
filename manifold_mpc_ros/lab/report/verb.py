# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``report``: recorded runs as one HTML page, and as pictures for a paper."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.lab.recording.bag_topics import add_topics, topics_given

if TYPE_CHECKING:
    from manifold_mpc_ros.lab.recording.bags.run import BagRun, TopicNames
    from manifold_mpc_ros.lab.report.page import Reported

EXAMPLES = """\
  manifold-mpc report results/bags/rest_to_rest_180
      results/report/rest_to_rest_180.html, which needs no network, and pictures
  manifold-mpc report results/bags/* --output results/all
      several runs side by side on one page
  manifold-mpc report theirs.mcap --pose /pose --twist /twist --torque /wrench
      a bag from another stack"""
SNAPSHOTS = 8


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    parser.add_argument('bags', nargs='+', type=Path, metavar='BAG',
                        help='a bag: folder or storage file')
    shared.add_output(parser, 'results/report')
    add_topics(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write page and pictures; 0 when that was done, whatever the verdicts are."""
    from manifold_mpc_ros.cli import console as report
    console = report.make_console()
    topics = topics_given(arguments)
    written = write_report(arguments.output, arguments.bags, topics)
    report.say_written(console, written)
    return 0


def write_report(
    folder: Path, bags: list[Path], topics: TopicNames | None = None,
) -> list[Path]:
    """Write the page about some bags and the pictures of each; return where they are."""
    from manifold_mpc_ros.lab.report.page import write_page
    reported = [_reported(path, topics) for path in bags]
    names = _distinct([each.name for each in reported])
    folder.mkdir(parents=True, exist_ok=True)
    page = folder / (f'{names[0]}.html' if len(reported) == 1 else 'report.html')
    written = [write_page(page, reported)]
    for name, each in zip(names, reported, strict=True):
        written += _pictures(each.run, name, folder)
    return written


def _reported(path: Path, topics: TopicNames | None) -> Reported:
    """Read a bag and judge it where it has limits."""
    from manifold_mpc_ros.errors import BagError
    from manifold_mpc_ros.lab.recording.bags.run import read_run
    from manifold_mpc_ros.lab.recording.bags.verdict import judge
    from manifold_mpc_ros.lab.report.page import Reported
    recorded = read_run(path, topics)
    try:
        verdict = judge(recorded)
    except BagError:
        verdict = None
    return Reported(recorded.title, recorded, verdict)


def _distinct(names: list[str]) -> list[str]:
    """Return names for files, numbered where one comes again."""
    seen: dict[str, int] = {}
    distinct = []
    for given in names:
        name = re.sub(r'[^\w-]+', '_', given) or 'run'  # a bag may say anything
        seen[name] = seen.get(name, 0) + 1
        distinct.append(name if seen[name] == 1 else f'{name}_{seen[name]}')
    return distinct


def _pictures(run: BagRun, name: str, folder: Path) -> list[Path]:
    """Draw the response and the orientation of a run, and its cones."""
    from manifold_mpc_ros.lab.recording.bags.cones import cone_histories
    from manifold_mpc_ros.lab.recording.bags.measures import settled_at_s
    from manifold_mpc_ros.lab.recording.scenarios.parts import AcceptanceLimits
    from manifold_mpc_ros.lab.report.plot_cones import plot_cones
    from manifold_mpc_ros.lab.report.plot_orientation import plot_orientation, snapshot_rows
    from manifold_mpc_ros.lab.report.plot_response import Response, plot_response
    limits = AcceptanceLimits() if run.scenario is None else run.scenario.acceptance
    config = None if run.scenario is None else run.scenario.controller_config.mpc
    settled_s = settled_at_s(run, limits.attitude_tolerance_deg, limits.rate_tolerance_rad_s)
    response = plot_response(Response(
        title=name, state_time_s=run.states.time_s, attitude_error_rad=run.error_rad,
        omega_BN_B=run.states.omega_BN_B, torque_time_s=run.commands.time_s,
        torque_B_n_m=run.commands.torque_B_n_m,
        max_rate_rad_s=None if config is None else config.max_rate_rad_s,
        max_torque_n_m=None if config is None else config.max_torque_n_m,
        attitude_tolerance_rad=float(np.radians(limits.attitude_tolerance_deg)),
        settled_s=settled_s, target='attitude' if config is None else config.target),
        folder / f'{name}_response.png')
    rows = snapshot_rows(run.states.time_s, 2.0, settled_s, SNAPSHOTS)
    orientation = plot_orientation(
        f'Orientation: {name}', run.states.time_s[rows], run.states.R_NB[rows],
        folder / f'{name}_orientation.png')
    cones = cone_histories(run)
    return [response, orientation, *([plot_cones(
        f'Cones: {name}', run.states.time_s, cones, folder / f'{name}_cones.png')
        ] if cones else [])]
