# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``domain``: from where the controller is sure to have a plan, and how long it is."""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.config.controller import ControllerConfig

if TYPE_CHECKING:
    from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
    from manifold_mpc_ros.lab.domain.states import Plane, States

EXAMPLES = """\
  manifold-mpc domain
      the shipped controller, from rest, on all cores: minutes
  manifold-mpc domain --largest-rate 0.3
      from rest, and from rates up to 0.3 rad/s as well
  manifold-mpc domain --controller-config mine.yaml --states 500 --no-picture
      another one, coarsely, numbers only
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    shared.add_controller_config(parser)
    parser.add_argument(
        '--states', type=shared.whole_number(10), default=4000, metavar='N',
        help='points of the uniform grid on SO(3), for pointing on S^2 (default: %(default)s)')
    parser.add_argument(
        '--half-turns', type=shared.whole_number(1), default=1000, metavar='N',
        help='axes of exact half turns, beside x, y and z; pointing has its antipode alone '
             '(default: %(default)s)')
    parser.add_argument(
        '--largest-rate', type=shared.positive_number, metavar='RAD/S',
        help='also ask the grid with rates uniform in a ball of this radius')
    parser.add_argument(
        '--resolution', type=shared.whole_number(5), default=61, metavar='N',
        help='points across each plane of the picture (default: %(default)s)')
    parser.add_argument(
        '--no-picture', action='store_true', help='neither the planes nor the picture')
    shared.add_workers(parser)
    shared.add_backend(parser, "the parameter file's")
    shared.add_output(parser, 'results/domain')


@dataclass(frozen=True)
class Groups:
    """The groups of states that one run asks, in this order."""

    grid: States
    half_turns: States
    moving: States | None
    planes: tuple[tuple[Plane, States], ...]

    @property
    def all(self) -> list[States]:
        """Return them as a list."""
        moving = [] if self.moving is None else [self.moving]
        return [self.grid, self.half_turns, *moving, *(states for _, states in self.planes)]


def run(arguments: argparse.Namespace) -> int:
    """Search, print, draw; return 0, whatever the result."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.cli.progress import Progress
    from manifold_mpc_ros.lab.domain import domain, text_report
    from manifold_mpc_ros.terminal.problem_of import terminal_design
    path = shared.controller_config_path(arguments.controller_config)
    controller = ControllerConfig.from_yaml(path)
    config = controller.mpc.with_equal_steps
    groups = _groups(arguments, config)
    arguments.output.mkdir(parents=True, exist_ok=True)
    console = report.make_console()
    console.print(f'Controller: {path}', soft_wrap=True, markup=False)
    begin = time.monotonic()
    with console.status('Designing the terminal set'):
        terminal = terminal_design(config)
    settings = domain.Settings(
        workers=arguments.workers, backend=arguments.backend or controller.backend)
    with Progress(console, 'states tried', starting='building the first solver') as progress:
        found = domain.smallest_horizons(
            config, terminal, groups.all, settings=settings,
            progress=lambda now: text_report.show_round(progress, now))
    elapsed_s = time.monotonic() - begin
    cut = len(found) - len(groups.planes)
    asked, planes = found[:cut], list(zip((plane for plane, _ in groups.planes), found[cut:]))
    text_report.show(console, config, asked, elapsed_s)
    data = text_report.as_data(config, terminal, asked, planes)
    written = [arguments.output / 'domain.json']
    written[0].write_text(json.dumps(data, allow_nan=False) + '\n', encoding='utf-8')
    if planes:
        from manifold_mpc_ros.lab.domain.picture import Picture
        from manifold_mpc_ros.lab.domain.plot_domain import plot_domain
        written.append(plot_domain(
            Picture(config, terminal.P, terminal.c, asked[0], asked[1], asked[2:], planes),
            arguments.output / 'domain.png'))
    report.say_written(console, written)
    return 0


def _groups(arguments: argparse.Namespace, config: AttitudeMpcConfig) -> Groups:
    """Return the states that the arguments ask for; raises ConfigurationError."""
    from manifold_mpc_ros.lab.domain import states as states
    moving = None
    if arguments.largest_rate is not None:
        moving = states.moving_states(config, arguments.states, arguments.largest_rate)
    planes = () if arguments.no_picture else tuple(
        (plane, states.plane_states(plane, arguments.resolution))
        for plane in states.planes(config))
    return Groups(states.uniform_states(config, arguments.states),
                  states.half_turns(config, arguments.half_turns), moving, planes)
