# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``discontinuity``: the jump of the law at 180 degrees and at the antipode of S^2."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.discontinuity.findings import LAWS, WHY, Findings, paper_config

if TYPE_CHECKING:
    from rich.console import Console

    from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc

EXAMPLES = """\
  manifold-mpc discontinuity
      across 180 degrees about (1, -2, 3), about all axes, and around the antipode of S^2
  manifold-mpc discontinuity --axis 0 0 1 --span 5 --target attitude --map-axes 0
      one axis, closely, and nothing else
  manifold-mpc discontinuity --law configured --controller-config mine.yaml
      the law of your own spacecraft alone"""
TARGETS = ('attitude', 'pointing')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    shared.add_controller_config(parser)
    parser.add_argument(
        '--axis', type=shared.number, nargs=3, default=(1.0, -2.0, 3.0), metavar=('X', 'Y', 'Z'),
        help='body axis of the turn, of any length (default: 1 -2 3)')
    parser.add_argument(
        '--span', type=_span, default=20.0, metavar='DEG',
        help='follow the law from 180 - DEG to 180 + DEG degrees (default: %(default)s)')
    parser.add_argument(
        '--target', choices=(*TARGETS, 'both'), default='both',
        help='SO(3) (attitude), S^2 (pointing) or both (default: %(default)s)')
    parser.add_argument(
        '--law', choices=tuple(LAWS), nargs='+', default=list(LAWS),
        help="the paper's law, that of the controller's file without limits and with them "
             '(default: all three)')
    parser.add_argument(
        '--map-axes', type=shared.whole_number(0), default=300, metavar='N',
        help='measure the jump about N axes over the hemisphere, 0: do not (default: %(default)s)')
    shared.add_backend(parser, 'auto')
    shared.add_output(parser, 'results/discontinuity')


def run(arguments: argparse.Namespace) -> int:
    """Measure, print, draw; 0 when every law jumps where theory says that it must."""
    from manifold_mpc_ros.cli import console as report
    axis = _axis(arguments.axis)
    path = shared.controller_config_path(arguments.controller_config)
    configs = law_configs(AttitudeMpcConfig.from_yaml(path))
    console = report.make_console()
    arguments.output.mkdir(parents=True, exist_ok=True)
    console.print(f'Controller: {path}', soft_wrap=True, markup=False)
    found = [_measure(console, name, configs[name], axis, arguments) for name in
             LAWS if name in arguments.law]
    _print(console, found)
    report.say_written(console, _write(found, axis, arguments.output))
    return 0 if all(jumps_as_it_must(one) for one in found) else 1


def law_configs(config: AttitudeMpcConfig) -> dict[str, AttitudeMpcConfig]:
    """Return the laws by name; each is used with either target."""
    return {'paper': paper_config(), 'configured': config,
            'unlimited': replace(config, max_torque_n_m=None, max_rate_rad_s=None)}


def jumps_as_it_must(found: Findings) -> bool:
    """Return whether the side of the turn jumps, and the torque winds or jumps on each circle."""
    axis = found.axis is None or found.axis.side_jump is not None
    around = found.antipode is None or all(
        circle.shows_discontinuity for circle in found.antipode.circles)
    return axis and around


def _measure(console: Console, name: str, config: AttitudeMpcConfig, axis: np.ndarray,
             arguments: argparse.Namespace) -> Findings:
    """Build the controllers of a law and measure what was asked for."""
    from manifold_mpc_ros.lab.discontinuity import study
    from manifold_mpc_ros.lab.discontinuity.discontinuity import hemisphere
    found, label = Findings(name), LAWS[name]
    if arguments.target != 'pointing':
        with console.status(f'{label}: building the attitude controller') as status:
            mpc = _controller(config, 'attitude', arguments.backend)
            status.update(f'{label}: across 180 degrees')
            found.axis = study.study_axis(mpc, axis, arguments.span)
            if arguments.map_axes:
                found.map = study.map_jumps(
                    mpc, hemisphere(arguments.map_axes), arguments.span,
                    _progress(lambda text: status.update(f'{label}: {text}')))
    if arguments.target != 'attitude':
        with console.status(f'{label}: around the antipode'):
            found.antipode = study.study_antipode(
                _controller(config, 'pointing', arguments.backend))
    return found


def _controller(config: AttitudeMpcConfig, target: str, backend: str | None) -> AttitudeMpc:
    """Return the controller of a configuration with this target."""
    from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
    return AttitudeMpc(replace(config, target=target), backend=backend or 'auto')


def _progress(show: Callable[[str], None]) -> Callable[[int, int], None]:
    """Return a report of how many axes are done."""
    return lambda done, of: show(f'jump about {done} of {of} axes')


def _print(console: Console, found: list[Findings]) -> None:
    """Print the tables and why it is so."""
    from manifold_mpc_ros.lab.discontinuity import text_report as tables
    for table in (tables.axis_table, tables.map_table, tables.antipode_table):
        shown = table(found)
        if shown is not None:
            console.print(shown)
    console.print(WHY)


def _write(found: list[Findings], axis: np.ndarray, folder: Path) -> list[Path]:
    """Write the data and the pictures; return where they are."""
    from manifold_mpc_ros.lab.discontinuity import text_report
    from manifold_mpc_ros.lab.discontinuity.plot_antipode import plot_antipode
    from manifold_mpc_ros.lab.discontinuity.plot_discontinuity import plot_turn
    from manifold_mpc_ros.lab.discontinuity.plot_map import plot_map
    path = folder / 'discontinuity.json'
    data: dict[str, Any] = text_report.as_data(found, axis)
    path.write_text(json.dumps(data, allow_nan=False) + '\n', encoding='utf-8')
    written = [path]
    if any(one.axis for one in found):
        written.append(plot_turn(found, folder / 'discontinuity_attitude.png'))
    if any(one.map for one in found):
        written.append(plot_map(found, folder / 'discontinuity_map.png'))
    if any(one.antipode for one in found):
        written.append(plot_antipode(found, folder / 'discontinuity_pointing.png'))
    return written


def _axis(values: tuple[float, ...]) -> np.ndarray:
    """Return the unit vector of an axis.

    Raises ConfigurationError when it has no direction.
    """
    vector = np.array(values, dtype=float)
    largest = float(np.abs(vector).max())
    if largest < 1e-150:
        raise ConfigurationError('--axis', list(values), 'a direction: not all three zero')
    return np.asarray(vector / largest / np.linalg.norm(vector / largest))


def _span(text: str) -> float:
    """Read a span in degrees."""
    value = shared.positive_number(text)
    if value > 90.0:
        raise argparse.ArgumentTypeError(f'{text!r} is above 90 degrees')
    return value

